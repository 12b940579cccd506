"""Files that are written whole or not at all: a reader sees the old one or the new one, also if two write at once."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path` to write to; it takes the place of `path` only if nothing went wrong.

    Raises
    ------
    OSError
        Writing failed; it names `path`.
    """
    special = path.exists() and not path.is_file() and not path.is_dir()  # /dev/null, a pipe: never to be replaced
    draft = path if special else path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        yield draft
        if not special:
            draft.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from error
    finally:
        if not special:
            with suppress(OSError):
                draft.unlink(missing_ok=True)
