"""What this user may ask of the system: real-time priority and locked memory, tried and not only read."""

from __future__ import annotations

import resource
from collections.abc import Iterator

from doctor.finding import CHANGE, NOTE, Finding, Machine
from phil_node.memory import MIB, advice_to_lock, may_lock
from phil_node.scheduling import CYCLE, highest_priority, why_not_first


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


def _limit(value: int, unit: int) -> str:
    return "unlimited" if value == resource.RLIM_INFINITY else f"{value / unit:g}"


LOOKS = (priority, locked_memory)
