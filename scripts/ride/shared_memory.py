"""Shared memory that the middleware leaves behind when a process is killed."""

from __future__ import annotations

import fcntl
import time
from pathlib import Path

SHM = Path("/dev/shm")
OURS = ("fastrtps_", "fastdds_", "sem.fastrtps_", "sem.fastdds_", "lttng-ust-wait-")
"""Prefixes of segments, ports and locks of Fast DDS, and of the tracing library that ROS 2 links."""
OLD_SECONDS = 60.0
"""Age from which what nobody holds is removed whoever left it; younger may belong to a process that just starts."""


def snapshot(folder: Path = SHM) -> frozenset[str]:
    """List what is there now."""
    return frozenset(entry.name for entry in folder.iterdir()) if folder.is_dir() else frozenset()


def remove_litter(before: frozenset[str], folder: Path = SHM) -> list[str]:
    """Remove what belongs to the middleware, is used by nobody, and came since ``before`` or is old; give the names.

    Old litter is that of a ride whose run script was killed and could not clean up.
    A living Fast DDS process holds a lock on the ``*_el`` file of each of its segments and on those of its ports:
    what is locked, or belongs to a name that is, stays.
    """
    names = litter(before, folder)
    for name in names:
        (folder / name).unlink(missing_ok=True)
    return names


def litter(before: frozenset[str], folder: Path = SHM) -> list[str]:
    """List what :func:`remove_litter` would remove."""
    there = [name for name in snapshot(folder) if name.startswith(OURS)]
    # The tracing library's file carries no lock: an old one may be in use.
    fresh = [name for name in there if name not in before or ("lttng" not in name and _old(folder / name))]
    busy = {_stem(name) for name in there if name.endswith(("_el", "_sl")) and _locked(folder / name)}
    return sorted(name for name in fresh if _stem(name) not in busy)


def _old(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime > OLD_SECONDS
    except OSError:
        return False


def _stem(name: str) -> str:
    return name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el").removesuffix("_sl")


def _locked(path: Path) -> bool:
    try:
        with path.open("rb") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.flock(handle, fcntl.LOCK_UN)
    except OSError:
        return True
    return False
