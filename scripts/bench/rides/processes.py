"""The processes of a ride, seen from outside: who they are, and what they use."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.realtime.figures import NODES
from bench.realtime.session import OF_TOPICS, RECORDER, TOPICS
from bench.realtime.usage import PROC, children, processor_seconds

COMPOSED = "all nodes"
SCRIPT = "run script"
MODULES = {
    **{f"{node}.node": node for node in NODES},
    "energy_monitor.record": RECORDER,
    "ride.composed": COMPOSED,
    TOPICS: OF_TOPICS,
}
"""Modules by which a process is told, and what it is called."""
ORDER = (*(name for node in NODES for name in (node, f"{node}, {OF_TOPICS}")), COMPOSED, RECORDER, SCRIPT)
MIB = 1 << 20


@dataclass(frozen=True)
class Memory:
    """Resident memory in bytes: all of it, and with what is shared counted in part (PSS)."""

    resident: int
    proportional: int


@dataclass(frozen=True)
class Look:
    """What was seen of a process at a time in ns: processor time in s since its start."""

    wall: int
    seconds: float


def role(line: Sequence[str], comm: str = "") -> str | None:
    """Tell what a process of a ride is by its command line, or by its short name; None if it is none of them."""
    found = next((MODULES[word] for word in line if word in MODULES), None)
    if found is None and comm in NODES:
        return comm
    return found or (SCRIPT if "ride" in line else None)


def rides_of(command: int) -> dict[str, int]:
    """Find the processes of a ride below that of its command: what they are called, and their numbers."""
    found: dict[str, int] = {}
    waiting = [(command, "")]
    while waiting:
        parent, owner = waiting.pop()
        own = {parent: _line(parent)} if not owner else {}
        for pid, line in (own | children(parent)).items():
            name = role(line, _comm(pid))
            if name == OF_TOPICS:
                name = f"{owner}, {OF_TOPICS}"
            if name is not None:
                found.setdefault(name, pid)
            if pid != parent:
                waiting.append((pid, name or owner or SCRIPT))
    return found


def _line(pid: int) -> list[str]:
    try:
        return (PROC / str(pid) / "cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def _comm(pid: int) -> str:
    try:
        return (PROC / str(pid) / "comm").read_text().strip()
    except OSError:
        return ""


def look(pid: int) -> Look:
    """Read a process's clock."""
    seconds = processor_seconds(pid)
    return Look(time.time_ns(), seconds)


def used(looks: Sequence[Look], begin: int, end: int) -> float:
    """Give the processor time in s that a process used between two times in ns, from what was seen between them."""
    inside = [one for one in looks if begin <= one.wall <= end]
    if len(inside) < 2 or inside[-1].wall == inside[0].wall:
        return 0.0
    share = (inside[-1].seconds - inside[0].seconds) / (inside[-1].wall - inside[0].wall)
    return share * (end - begin)


def memory(pid: int, proc: Path = PROC) -> Memory | None:
    """Read a process's memory; None for one that is gone, or may not be looked at."""
    try:
        text = (proc / str(pid) / "smaps_rollup").read_text()
    except OSError:
        return None
    kilobytes = {words[0]: int(words[1]) for words in map(str.split, text.splitlines()[1:]) if len(words) == 3}
    if "Rss:" not in kilobytes:
        return None
    return Memory(kilobytes["Rss:"] * 1024, kilobytes.get("Pss:", 0) * 1024)


def ordered(names: Mapping[str, object]) -> list[str]:
    """Give names of processes in the order of the tables."""
    return sorted(names, key=lambda name: (ORDER.index(name) if name in ORDER else len(ORDER), name))
