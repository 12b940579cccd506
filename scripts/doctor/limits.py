"""What this user may ask of the system: real-time priority and locked memory, tried and not only read."""

from __future__ import annotations

import os
import resource
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from doctor.finding import CHANGE, NOTE, Finding, Machine
from phil_base.memory import MIB, advice_to_lock, may_lock
from phil_base.scheduling import CYCLE, PRIORITY, highest_priority, why_not_first


def priority(machine: Machine) -> Iterator[Finding]:
    """The highest priority of SCHED_FIFO that a thread was really given."""
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
    allowed = highest_priority()
    value = f"{allowed} granted (ulimit -Hr: {_limit(limit, 1)}; wanted: {CYCLE})"
    if allowed >= CYCLE:
        yield Finding("real-time priority", value)
    elif allowed:
        yield Finding("real-time priority", value, NOTE, "interrupt threads and others may come first", why_not_first())
    else:
        why = (
            "every ordinary process takes its turn before the loop: tens to hundreds of late commands beside other work"
        )
        yield Finding(
            "real-time priority", f"none granted (ulimit -Hr: {_limit(limit, 1)})", CHANGE, why, why_not_first()
        )


def locked_memory(machine: Machine) -> Iterator[Finding]:
    """Whether a node may lock its memory."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    value = f"ulimit -Hl: {_limit(limit, MIB)}{'' if limit == resource.RLIM_INFINITY else ' MiB'}"
    if may_lock():
        yield Finding("locked memory", f"granted ({value})")
    else:
        why = "under memory pressure the nodes wait for pages that were taken from them"
        yield Finding("locked memory", f"none granted ({value})", NOTE, why, advice_to_lock())


def rivals(machine: Machine) -> Iterator[Finding]:
    """Processes of others that have the processor before, or in turn with, the loop."""
    found: Counter[str] = Counter()
    for folder in machine.all("/proc/[0-9]*"):
        # Threads of the kernel have no command line; they are there on every machine.
        if folder.name == str(os.getpid()) or not machine.text(f"/proc/{folder.name}/cmdline"):
            continue
        if _first_of(folder) >= PRIORITY:
            found[machine.text(f"/proc/{folder.name}/comm") or folder.name] += 1
    if not found:
        yield Finding("other real-time processes", "none")
        return
    listed = ", ".join(f"{name} ({count})" if count > 1 else name for name, count in sorted(found.items()))
    why = f"at SCHED_FIFO {PRIORITY} or above they take the processor from a ride, or make it wait for its turn"
    do = "look what they are: ps -eLo rtprio,pid,comm,args --sort=-rtprio | head -20   and end what is not needed"
    yield Finding("other real-time processes", listed, NOTE, why, do)


def _first_of(folder: Path) -> int:
    """Give the highest real-time priority of a process's threads, 0 if all are ordinary: field 40 of its stat."""
    priorities = [0]
    for path in folder.glob("task/*/stat"):
        try:
            # The name in brackets may hold anything: fields are counted from the last bracket, which ends the second.
            priorities.append(int(path.read_text().rpartition(")")[2].split()[37]))
        except (OSError, ValueError, IndexError):
            continue  # it has just ended
    return max(priorities)


def _limit(value: int, unit: int) -> str:
    return "unlimited" if value == resource.RLIM_INFINITY else f"{value / unit:g}"


LOOKS = (priority, locked_memory, rivals)
