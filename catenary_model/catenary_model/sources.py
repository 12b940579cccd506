"""A digest of source files: what was made by other code than the present is made anew."""

import functools
import hashlib
import os
from pathlib import Path


@functools.cache
def digest(*places: Path) -> str:
    """Return a digest of Python files, and of those in and below folders: other sources give another one."""
    found = hashlib.sha256()
    for place in places:
        for path in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            found.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()[:16]


def user_cache() -> Path:
    """Return $XDG_CACHE_HOME or ~/.cache; without a home a folder that cannot be written, so that nothing is kept."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return Path(os.devnull)
