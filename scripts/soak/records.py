"""What a long ride's bag must hold: every cycle, none again without a reason, and nodes that keep together.

In real time a node sends a message again when the ride has gone on without an answer: then the rig has counted late
commands, and a message that came again where it counted none is one too many. And the nodes have to keep together: what
they send for a cycle may not come ever later after the rig's state of that cycle.
In lockstep nobody is late, and a node sends again what was not answered for a third of a second. All wait for all in
each cycle: they keep together by that, and how much later something comes says how quick the machine is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, Table, read_bag
from soak.judge import Floats, Trend, Verdict, trend

EVERY_CYCLE = {"RigState": 0, "ImpedanceCommand": 0, "CatenaryState": 1}
"""Types of which there is one message a cycle; and how many cycles more than the ride's it goes on."""
DECIMATED = ("ConservedQuantities", "ContactQuality")
"""Of the decimated types those that are kept for a listener that is held up; the others are for viewing."""
FIELDS = dict.fromkeys((*EVERY_CYCLE, *DECIMATED), ("cycle",)) | {
    "RigState": ("cycle", "late_commands"),
    "CycleTiming": ("cycle", "turnaround"),
}
REPEATED = 0.2
"""s after which a node in lockstep says again what nobody answers."""
BLOCK = 250
"""Cycles over which the earliest messages are looked for: some dozen batches."""
SOON = 64
"""Cycles after that of a message that came again within which the rig counted it, or its answer, as late."""


@dataclass(frozen=True)
class Stream:
    """One topic: its messages, those that are missing, and those that came more than once."""

    topic: str
    messages: int
    missing: int
    doubles: int


@dataclass(frozen=True)
class Records:
    """A bag, looked at: whole or not, its streams, how far the nodes' messages are behind the rig's states in s.

    ``late`` is the number of late commands that the rig counted.
    """

    whole: bool
    notes: list[str]
    streams: list[Stream]
    behind: Mapping[str, Trend]
    late: int = 0


def records(bag: Path, cycles: int, lockstep: bool) -> Records:
    """Look at the bag of a ride of ``cycles`` cycles, in lockstep or in real time.

    Raises
    ------
    BagError
        It cannot be read.
    """
    return records_of(read_bag(bag, fields=FIELDS), cycles, lockstep)


def records_of(bag: Bag, cycles: int, lockstep: bool = False) -> Records:
    """Look at a bag that is read."""
    tables = sorted(bag.tables.values(), key=lambda table: table.topic)
    rig = next((table for table in tables if table.msgtype == "RigState"), None)
    followed = [] if rig is None or lockstep else [table for table in tables if table.msgtype in EVERY_CYCLE]
    behind = {table.topic: found for table in followed if rig is not None and (found := _behind(rig, table))}
    streams = [stream(table, cycles, rig, lockstep) for table in tables]
    late = int(rig["late_commands"].max()) if rig is not None and "late_commands" in rig.columns and len(rig) else 0
    return Records(bag.complete, bag.notes, streams, behind, late)


def stream(table: Table, cycles: int, rig: Table | None = None, lockstep: bool = False) -> Stream:
    """Count what is missing, and what came again without a reason, in a stream of a ride of ``cycles`` cycles.

    Batches of timing have to hold so many cycles together; of a decimated topic every one up to the last has to be
    there.
    """
    order = np.argsort(table["cycle"].astype(np.int64), kind="stable")
    cycle = table["cycle"].astype(np.int64)[order]
    step = np.diff(cycle)
    again = cycle[1:][step == 0]
    if table.msgtype in EVERY_CYCLE:
        reason = np.zeros(len(again), bool)
        if table.msgtype == "CatenaryState":  # its first state it says to each listener that comes
            reason |= (again == cycle[0]) | (again == cycle[-1])
        if rig is not None:
            later = np.diff(table.log_time[order])[step == 0] * 1e-9
            reason |= _unanswered(rig, table, again, later) if lockstep else _late(rig, again)
        again = again[~reason]
        wanted = cycles + EVERY_CYCLE[table.msgtype]
        missing = wanted - len(np.unique(cycle[(cycle >= 0) & (cycle < wanted)]))
    elif table.msgtype == "CycleTiming":
        missing = abs(cycles - sum(map(len, table.entries("turnaround"))))
    else:
        rising = step[step > 0]
        usual = int(np.median(rising)) if len(rising) else 1
        missing = int((np.maximum(0, rising - 1) // usual).sum()) + max(0, int(cycles - 1 - cycle[-1])) // usual
    return Stream(table.topic, len(table), missing, len(again))


def _late(rig: Table, again: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell of cycles whether the rig counted late commands in or soon after them."""
    if "late_commands" not in rig.columns or not len(rig):
        return np.zeros(len(again), bool)
    order = np.argsort(rig["cycle"].astype(np.int64), kind="stable")
    cycle, late = rig["cycle"].astype(np.int64)[order], rig["late_commands"].astype(np.int64)[order]
    before = np.clip(np.searchsorted(cycle, again - 1), 0, len(cycle) - 1)
    after = np.clip(np.searchsorted(cycle, again + SOON), 0, len(cycle) - 1)
    return np.asarray(late[after] > late[before])


def _unanswered(rig: Table, table: Table, again: NDArray[np.int64], later: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell of cycles whether nobody had answered for some time; a state of the rig that came again may be answered."""
    asked, count = np.unique(rig["cycle"].astype(np.int64), return_counts=True)
    answers = np.isin(again, asked[count > 1]) if table.msgtype == "ImpedanceCommand" else np.zeros(len(again), bool)
    return np.asarray(answers | (later >= REPEATED))


def _behind(rig: Table, table: Table) -> Trend | None:
    """Tell how much later than the rig's states the messages of the same cycles were sent, s, block by block."""
    if table is rig or not len(table) or not len(rig):
        return None
    known, at = _sent(rig)
    period = float((at[-1] - at[0]) / max(1, known[-1] - known[0]))
    reference, other = _earliest(known, at, period), _earliest(*_sent(table), period)
    blocks = sorted(reference.keys() & other.keys())
    since: Floats = np.array([block * BLOCK * period for block in blocks]) * 1e-9
    return trend(since, np.array([other[block] - reference[block] for block in blocks]) * 1e-9)


def _sent(table: Table) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give cycles (rising) and times in ns of the messages that were the last of what was handed over at once.

    Nodes hand over batches, and what waited in one is logged with its last message.
    """
    known, first = np.unique(table["cycle"].astype(np.int64), return_index=True)
    logged: NDArray[np.int64] = table.log_time[first]
    step = np.diff(logged)
    at_once = 0.5 * (logged[-1] - logged[0]) / max(1, known[-1] - known[0])
    last = np.append(step >= at_once, True)
    return known[last], logged[last]


def _earliest(cycle: NDArray[np.int64], time: NDArray[np.int64], period: float) -> dict[int, float]:
    """Give for each block of cycles how much later than its cycle the earliest tenth came, ns.

    The last message of a batch waits for up to a cycle too, until the batch goes; the earliest have not waited.
    """
    later = time - period * cycle
    return {
        int(block): float(np.percentile(part, 10.0))
        for block, part in zip(
            np.unique(cycle // BLOCK),
            np.split(later, np.flatnonzero(np.diff(cycle // BLOCK)) + 1),
            strict=True,
        )
    }


def judge_records(found: Records, cycle_time: float, lockstep: bool) -> list[Verdict]:
    """Judge a bag."""
    verdicts = [Verdict("bag: cut off or damaged", 0.0 if found.whole else 1.0, 0.0, "", " ".join(found.notes[:2]))]
    for kind in ("missing", "doubles"):
        wrong = [f"{one.topic} {getattr(one, kind)}" for one in found.streams if getattr(one, kind)]
        count = float(sum(getattr(one, kind) for one in found.streams)) if found.streams else None
        what = "messages that are missing" if kind == "missing" else "messages that came again, nobody being late"
        remark = ", ".join(wrong[:4])
        if kind == "doubles" and not wrong and not lockstep:
            remark = f"late commands that the rig counted: {found.late}"
        verdicts.append(Verdict(f"bag: {what}", count, 0.0, "", remark))
    present = {one.topic.rsplit("/", 2)[-2:][-1] for one in found.streams}
    verdicts.append(Verdict("bag: cyclic topics that are not in it", float("state" not in present), 0.0, ""))
    if lockstep:
        return verdicts
    drifts = {topic: one.last - one.first for topic, one in found.behind.items()}
    worst = max(drifts, key=lambda topic: abs(drifts[topic]), default="")
    drift = abs(drifts[worst]) * 1e3 if worst else None
    verdicts.append(Verdict("cycles: drift of a node against the rig", drift, cycle_time * 1e3, "ms", worst))
    return verdicts
