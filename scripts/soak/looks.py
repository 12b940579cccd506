"""What is seen of the processes of a ride from outside, by /proc: memory, processor time, threads, files, logs."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from bench.realtime.usage import PROC, processor_seconds

SHARED = "/dev/shm/"
_STATUS = {"VmRSS": "resident", "RssAnon": "anonymous", "RssFile": "file", "RssShmem": "shared", "Threads": "threads"}


@dataclass(frozen=True)
class Look:
    """One process at one time: memory in kiB, processor time in s, counts."""

    resident: int
    """Resident memory: anonymous + file + shared."""
    anonymous: int
    file: int
    shared: int
    """Pages of shared memory that it has touched: the middleware's transport."""
    seconds: float
    threads: int
    files: int
    """Open file descriptors."""


@dataclass(frozen=True)
class Deep:
    """What costs the process more to look at: its share of memory that others map too (kiB), shared memory it maps."""

    proportional: int
    segments: frozenset[str]


QUANTITIES = tuple(one.name for one in fields(Look))


@dataclass(frozen=True)
class Sample:
    """All processes at one time; ``wall`` in ns as the log times of a bag, ``logs`` in bytes.

    ``deep`` is empty where they were not looked at so closely; ``segments`` is the size in bytes of the shared memory
    that they map together.
    """

    wall: int
    looks: Mapping[str, Look]
    logs: int
    deep: Mapping[str, Deep]
    segments: int | None = None


def look(pid: int) -> Look | None:
    """Look at a process; None if it is gone."""
    try:
        status = (PROC / str(pid) / "status").read_text()
        files = len(os.listdir(PROC / str(pid) / "fd"))  # noqa: PTH208 - the names alone, once a second
    except OSError:
        return None
    found = dict.fromkeys(_STATUS.values(), 0)
    for line in status.splitlines():
        key, _, value = line.partition(":")
        if key in _STATUS:
            found[_STATUS[key]] = int(value.split()[0])
    if not found["resident"]:
        return None  # it has ended and waits for its parent
    return Look(**found, seconds=processor_seconds(pid), files=files)


def deep_look(pid: int) -> Deep | None:
    """Look closely at a process; None if it is gone.

    Both files make the kernel walk through its memory: not to be done once a cycle.
    """
    try:
        rollup = (PROC / str(pid) / "smaps_rollup").read_text()
        maps = (PROC / str(pid) / "maps").read_text()
    except OSError:
        return None
    proportional = next((int(line.split()[1]) for line in rollup.splitlines() if line.startswith("Pss:")), 0)
    paths = (line.split(maxsplit=5)[5] for line in maps.splitlines() if SHARED in line)
    return Deep(proportional, frozenset(path.removeprefix(SHARED) for path in paths))


def size_of(folder: Path) -> int:
    """Sum up the bytes of all files below a folder."""
    total = 0
    for file in folder.rglob("*"):
        try:
            total += file.stat().st_size if file.is_file() else 0
        except OSError:
            continue
    return total


def size_of_segments(names: frozenset[str]) -> int:
    """Sum up the memory in bytes that files of /dev/shm take; those that are deleted count nothing."""
    total = 0
    for name in names:
        try:
            total += Path(SHARED, name).stat().st_blocks * 512
        except OSError:
            continue
    return total


def sample(processes: Mapping[str, int], logs: Sequence[Path], closely: bool) -> Sample:
    """Look at all processes (name to process number); those that are gone are left out."""
    looks = {name: found for name, pid in processes.items() if (found := look(pid))}
    deep = {name: close for name, pid in processes.items() if closely and (close := deep_look(pid))}
    segments = size_of_segments(frozenset().union(*(one.segments for one in deep.values()))) if deep else None
    return Sample(time.time_ns(), looks, sum(map(size_of, logs)), deep, segments)
