"""Designs on disk, found by what they were designed for.

They lie in the folder of `phil_base.cache`, one .npz a design. A
file that cannot be read, or that was made for something else or by other sources, is made anew; a folder that cannot
be written is no error, the design is only slower the next time.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phil_base import newmark
from phil_base.atomic import whole
from phil_base.cache import digest, folder

Array = NDArray[np.float64]

_BOUNDARY = Path(__file__).parents[1]
SOURCES = (_BOUNDARY, _BOUNDARY.parent / "moving_frame.py", Path(newmark.__file__))
"""Code that makes a design what it is: what it made before it was changed is not taken any more."""


def cached(
    what: str, parameters: Mapping[str, float | str], compute: Callable[[], dict[str, Array]]
) -> dict[str, Array]:
    """Return what `compute` returns for these parameters, from disk if it is there."""
    key = json.dumps({"sources": digest(*SOURCES), "what": what, **parameters}, sort_keys=True)
    path = folder() / f"{what}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.npz"
    stored = _read(path, key)
    if stored is None:
        stored = compute()
        with contextlib.suppress(OSError):
            _write(path, key, stored)
    return stored


def _read(path: Path, key: str) -> dict[str, Array] | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            stored = {name: np.asarray(file[name]) for name in file.files}
    except Exception:  # whatever a damaged archive raises (NotImplementedError, RuntimeError, ...): it is made anew
        return None
    made_for, names = stored.pop("key", None), stored.pop("names", None)
    complete = (
        made_for is not None and str(made_for) == key and names is not None and set(names.tolist()) == set(stored)
    )
    return stored if complete else None


def _write(path: Path, key: str, stored: dict[str, Array]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole(path) as draft, draft.open("wb") as file:
        np.savez(file, key=np.array(key), names=np.array(list(stored)), **stored)  # type: ignore[arg-type]
