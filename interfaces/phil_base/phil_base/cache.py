"""Where results are kept between runs, and by which code they were made.

All lies in $PHIL_CACHE, else in $XDG_CACHE_HOME/phil-catenary, else in ~/.cache/phil-catenary.
"""

from __future__ import annotations

import functools
import hashlib
import os
from pathlib import Path

OURS = "phil-catenary"


def given() -> Path | None:
    """Return $PHIL_CACHE if it is set."""
    place = os.environ.get("PHIL_CACHE")
    return Path(place).absolute() if place else None


def user_cache() -> Path:
    """Return $XDG_CACHE_HOME or ~/.cache.

    Raises
    ------
    RuntimeError
        There is no home.
    """
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def folder(below: str = "") -> Path:
    """Return where results are kept, which need not exist; without a home it cannot be written: nothing is kept."""
    try:
        return (given() or user_cache() / OURS) / below
    except RuntimeError:
        return Path(os.devnull) / below


@functools.cache
def digest(*places: Path) -> str:
    """Return a digest of Python files, and of those in and below folders: other sources give another one."""
    found = hashlib.sha256()
    for place in places:
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            found.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()[:16]
