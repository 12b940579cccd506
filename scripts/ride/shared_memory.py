"""Shared memory that the middleware leaves behind when a process is killed."""

from __future__ import annotations

import fcntl
from pathlib import Path

SHM = Path("/dev/shm")
OURS = ("fastrtps_", "fastdds_", "sem.fastrtps_", "sem.fastdds_", "lttng-ust-wait-")
"""Prefixes of segments, ports and locks of Fast DDS, and of the tracing library that ROS 2 links."""


def snapshot(folder: Path = SHM) -> frozenset[str]:
    """List what is there now."""
    return frozenset(entry.name for entry in folder.iterdir()) if folder.is_dir() else frozenset()


def remove_litter(before: frozenset[str], folder: Path = SHM) -> list[str]:
    """Remove what came since ``before``, belongs to the middleware and is used by nobody; give the names.

    A living Fast DDS process holds a lock on the ``*_el`` file of each of its segments and on those of its ports:
    what is locked, or belongs to a name that is, stays.
    """
    fresh = [name for name in snapshot(folder) - before if name.startswith(OURS)]
    busy = {_stem(name) for name in fresh if name.endswith(("_el", "_sl")) and _locked(folder / name)}
    removed = []
    for name in sorted(fresh):
        if _stem(name) in busy:
            continue
        (folder / name).unlink(missing_ok=True)
        removed.append(name)
    return removed


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
