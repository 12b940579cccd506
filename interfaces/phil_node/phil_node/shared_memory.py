"""Shared memory that the middleware leaves behind when a process is killed."""

from __future__ import annotations

import contextlib
import fcntl
import time
from pathlib import Path

SHM = Path("/dev/shm")
LOCKS = Path("/proc/locks")
OURS = ("fastrtps_", "fastdds_", "sem.fastrtps_", "sem.fastdds_", "lttng-ust-wait-")
"""Prefixes of segments, ports and locks of Fast DDS, and of the tracing library that ROS 2 links."""
OLD_SECONDS = 5.0
"""Age from which what nobody holds is removed whoever left it; younger may belong to a process that just starts."""


def snapshot(folder: Path = SHM) -> frozenset[str]:
    """List what is there now."""
    return frozenset(entry.name for entry in folder.iterdir()) if folder.is_dir() else frozenset()


def remove_litter(before: frozenset[str] | None = None, folder: Path = SHM) -> list[str]:
    """Remove what belongs to the middleware, is used by nobody, and came since ``before`` or is old; give the names.

    Old litter is that of a process that was killed and could not clean up. Without ``before`` only old litter goes.
    A living Fast DDS process holds a lock on the ``*_el`` file of each of its segments and on those of its ports:
    what is locked, or belongs to a name that is, stays. A process that starts may take up the name of a port again:
    the files of a name are removed under its lock, so that it gets all of them, or none.
    """
    names = litter(before, folder)
    removed = []
    for stem in dict.fromkeys(map(_stem, names)):
        mine = [name for name in names if _stem(name) == stem]
        removed += _remove_unless_locked(sorted(mine, key=_is_lock), folder)
    return sorted(removed)


def _remove_unless_locked(names: list[str], folder: Path) -> list[str]:
    removed = []
    with contextlib.ExitStack() as held, contextlib.suppress(OSError):  # taken just now, or somebody else's
        for name in filter(_is_lock, names):
            fcntl.flock(held.enter_context((folder / name).open("rb")), fcntl.LOCK_EX | fcntl.LOCK_NB)
        for name in names:
            (folder / name).unlink(missing_ok=True)
            removed.append(name)
    return removed


def litter(before: frozenset[str] | None = None, folder: Path = SHM) -> list[str]:
    """List what :func:`remove_litter` would remove."""
    there = [name for name in snapshot(folder) if name.startswith(OURS)]
    before = frozenset(there) if before is None else before
    # The tracing library's file carries no lock: an old one may be in use.
    fresh = [name for name in there if name not in before or ("lttng" not in name and _old(folder / name))]
    stems, held = set(map(_stem, fresh)), _held()
    busy = {_stem(name) for name in there if _is_lock(name) and _stem(name) in stems and _locked(folder / name, held)}
    return sorted(name for name in fresh if _stem(name) not in busy)


def _old(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime > OLD_SECONDS
    except OSError:
        return False


def _is_lock(name: str) -> bool:
    return name.endswith(("_el", "_sl"))


def _stem(name: str) -> str:
    return name.removeprefix("sem.").removesuffix("_mutex").removesuffix("_el").removesuffix("_sl")


def _held() -> frozenset[int]:
    """Give the inodes of the files that somebody holds a lock on, as far as the kernel shows them."""
    try:
        return frozenset(int(line.split()[5].rsplit(":", 1)[1]) for line in LOCKS.read_text().splitlines())
    except (OSError, ValueError, IndexError):
        return frozenset()


def _locked(path: Path, held: frozenset[int]) -> bool:
    """Tell whether somebody holds the lock; it is not tried where that is known: Fast DDS would report the trial."""
    try:
        if path.stat().st_ino in held:
            return True
        with path.open("rb") as handle:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            fcntl.flock(handle, fcntl.LOCK_UN)
    except OSError:
        return True
    return False
