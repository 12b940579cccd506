"""Files that are written whole or not at all: a reader sees the old one or the new one, also if two write at once."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to; it takes the place of `path` only if nothing went wrong.

    A link stays one: the file that it names is replaced.

    Raises
    ------
    OSError
        Writing failed; it names `path`.
    """
    special = path.exists() and not path.is_file() and not path.is_dir()  # /dev/null, a pipe: never to be replaced
    place = path.resolve() if path.is_symlink() else path
    draft = path if special else place.with_name(f".{place.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield draft
        if not special:
            draft.replace(place)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        if not special:
            with suppress(OSError):
                draft.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a file of UTF-8 text, see `whole`. Raises OSError that names it."""
    with whole(path) as draft:
        draft.write_text(text, encoding="utf-8")


@contextmanager
def together(folder: Path) -> Iterator[Path]:
    """Give a temporary folder inside `folder` for files that belong together; they take their places at the end.

    Nothing of it is seen before all of them are written, and nothing at all if something went wrong.
    """
    with TemporaryDirectory(prefix=".draft_", dir=folder) as name:
        drafts = Path(name)
        yield drafts
        for draft in sorted(file for file in drafts.rglob("*") if file.is_file()):
            place = folder / draft.relative_to(drafts)
            place.parent.mkdir(parents=True, exist_ok=True)
            draft.replace(place)
