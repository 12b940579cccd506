"""What a long ride's bag must hold: every cycle of every cyclic topic exactly once, and nodes that keep together."""

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
FIELDS = dict.fromkeys((*EVERY_CYCLE, *DECIMATED), ("cycle",)) | {"CycleTiming": ("cycle", "turnaround")}
REPEATED = 0.2
"""s after which a node says again what nobody answers; sooner the same cycle is a record too many."""
DRIFT_LOCKSTEP = 0.1
"""s by which a node may come to be further behind the rig where nobody follows a clock."""


@dataclass(frozen=True)
class Stream:
    """One topic: its messages, those that are missing, and those that came more than once."""

    topic: str
    messages: int
    missing: int
    doubles: int


@dataclass(frozen=True)
class Records:
    """A bag, looked at: whole or not, its streams, and how far each stream is behind the rig's states, in s."""

    whole: bool
    notes: list[str]
    streams: list[Stream]
    behind: Mapping[str, Trend]


def records(bag: Path, cycles: int) -> Records:
    """Look at the bag of a ride of ``cycles`` cycles.

    Raises
    ------
    BagError
        It cannot be read.
    """
    return records_of(read_bag(bag, fields=FIELDS), cycles)


def records_of(bag: Bag, cycles: int) -> Records:
    """Look at a bag that is read."""
    tables = sorted(bag.tables.values(), key=lambda table: table.topic)
    rig = next((table for table in tables if table.msgtype == "RigState"), None)
    behind = {} if rig is None else {table.topic: found for table in tables if (found := _behind(rig, table))}
    return Records(bag.complete, bag.notes, [stream(table, cycles, rig) for table in tables], behind)


def stream(table: Table, cycles: int, rig: Table | None = None) -> Stream:
    """Count what is missing and double in a stream of a ride of ``cycles`` cycles.

    Batches of timing have to hold so many cycles together; of a decimated topic every one up to the last has to be
    there.
    What is sent in every cycle may come again after some time: a node repeats it until it is answered. A state of the
    ``rig`` that came again may be answered again.
    """
    order = np.argsort(table["cycle"].astype(np.int64), kind="stable")
    cycle = table["cycle"].astype(np.int64)[order]
    step = np.diff(cycle)
    again = cycle[1:][step == 0]
    if table.msgtype in EVERY_CYCLE:
        later = np.diff(table.log_time[order])[step == 0] * 1e-9
        edges = table.msgtype == "CatenaryState"  # its first state it says to each listener that comes
        if table.msgtype == "ImpedanceCommand" and rig is not None:
            asked, count = np.unique(rig["cycle"].astype(np.int64), return_counts=True)
            later = np.where(np.isin(again, asked[count > 1]), REPEATED, later)
        again = again[(later < REPEATED) & ~(edges & ((again == cycle[0]) | (again == cycle[-1])))]
    if table.msgtype in EVERY_CYCLE:
        wanted = cycles + EVERY_CYCLE[table.msgtype]
        missing = wanted - len(np.unique(cycle[(cycle >= 0) & (cycle < wanted)]))
    elif table.msgtype == "CycleTiming":
        missing = abs(cycles - sum(map(len, table.entries("turnaround"))))
    else:
        rising = step[step > 0]
        usual = int(np.median(rising)) if len(rising) else 1
        missing = int((np.maximum(0, rising - 1) // usual).sum()) + max(0, int(cycles - 1 - cycle[-1])) // usual
    return Stream(table.topic, len(table), missing, len(again))


def _behind(rig: Table, table: Table) -> Trend | None:
    """Tell how much later than the rig's state of its cycle each message was logged, s."""
    if table is rig or not len(table):
        return None
    known, first = np.unique(rig["cycle"].astype(np.int64), return_index=True)
    cycle = table["cycle"].astype(np.int64)
    at = np.minimum(np.searchsorted(known, cycle), len(known) - 1)
    good = known[at] == cycle
    logged: NDArray[np.int64] = table.log_time[good]
    later = (logged - rig.log_time[first[at[good]]]) * 1e-9
    since: Floats = (logged - rig.log_time[0]) * 1e-9
    return trend(since, later)


def judge_records(found: Records, cycle_time: float, lockstep: bool) -> list[Verdict]:
    """Judge a bag."""
    verdicts = [Verdict("bag: cut off or damaged", 0.0 if found.whole else 1.0, 0.0, "", " ".join(found.notes[:2]))]
    for kind in ("missing", "doubles"):
        wrong = [f"{one.topic} {getattr(one, kind)}" for one in found.streams if getattr(one, kind)]
        count = float(sum(getattr(one, kind) for one in found.streams)) if found.streams else None
        what = "messages that are missing" if kind == "missing" else "messages that came again"
        verdicts.append(Verdict(f"bag: {what}", count, 0.0, "", ", ".join(wrong[:4])))
    present = {one.topic.rsplit("/", 2)[-2:][-1] for one in found.streams}
    verdicts.append(Verdict("bag: cyclic topics that are not in it", float("state" not in present), 0.0, ""))
    drifts = {topic: one.last - one.first for topic, one in found.behind.items()}
    worst = max(drifts, key=lambda topic: abs(drifts[topic]), default="")
    limit = DRIFT_LOCKSTEP if lockstep else cycle_time
    drift = abs(drifts[worst]) * 1e3 if worst else None
    verdicts.append(Verdict("cycles: drift of a node against the rig", drift, limit * 1e3, "ms", worst))
    return verdicts
