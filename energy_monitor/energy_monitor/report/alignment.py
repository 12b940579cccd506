"""Streams of one ride brought together by cycle number: duplicates dropped, gaps listed, restarts cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, BagError, Table
from energy_monitor.cycles import AHEAD, JumpFilter
from energy_monitor.report.results import Stream
from energy_monitor.topics import CATENARY_STATE, COMMAND, RIG_STATE

RESTART = 64
"""Cycles that a stream has to fall back to count as a new ride and not as messages out of order."""


@dataclass(frozen=True)
class Aligned:
    """The three cycle streams at their common cycles, how complete each is, and what else there is to say."""

    cycle: NDArray[np.int64]
    rig: Table
    catenary: Table
    command: Table
    streams: list[Stream]
    expected: int
    missing: list[int]
    ended: bool
    notes: list[str]


def align(bag: Bag, whole: bool = False) -> Aligned:
    """Bring rig state, catenary state and command together by cycle number.

    A ride that was recorded as a `whole` has to begin with cycle 0; otherwise the recording may begin later.

    Raises
    ------
    BagError
        One of the three is not in the bag, or they have no cycle in common.
    """
    names = (
        (RIG_STATE, "RigState", ("w_tr", "v_tr", "f_tr", "work", "impulse")),
        (CATENARY_STATE, "CatenaryState", ("w_cat", "v_cat", "f_cat", "work", "impulse", "speed")),
        (COMMAND, "ImpedanceCommand", ("f_tr", "f_predicted", "f_cor", "f_cat")),
    )
    recorded = [bag.table(name, kind) for name, kind, _ in names]
    raw = [valid(table, needed) for table, (_, _, needed) in zip(recorded, names, strict=True)]
    streams = [completeness(table) for table in raw]
    rig, *_ = tables = [unique(last_ride(table)) for table in raw]
    notes = []
    for table, before in zip(raw, recorded, strict=True):
        if len(table) < len(before):
            refused = f"{len(before) - len(table)} messages on {table.topic} are left out"
            notes.append(f"{refused}: NaN, infinity or a cycle number far ahead.")
    if any(stream.restarts for stream in streams):
        notes.append("The nodes were reset while the bag was recorded: the last ride in it is analysed.")
    ended = bool(rig["last"].any())
    cycles = [table["cycle"].astype(np.int64) for table in tables]
    begin = 0 if whole or cycles[0][0] == 0 else max(int(c[0]) for c in cycles)
    end = int(cycles[0][-1]) if ended else min(int(c[-1]) for c in cycles)
    if begin > 0:
        notes.append(f"The recording began at cycle {begin}: energy and momentum are summed from there on.")
    if not ended:
        notes.append("The ride did not come to its last cycle: it was aborted, or the recording was.")
    common = cycles[0]
    for other in cycles[1:]:
        common = np.intersect1d(common, other, assume_unique=True)
    common = common[(common >= begin) & (common <= end)]
    if len(common) == 0:
        raise BagError("rig state, catenary state and command have no cycle in common")
    missing = np.setdiff1d(np.arange(begin, end + 1), common, assume_unique=True)
    taken = [table.take(np.searchsorted(c, common)) for table, c in zip(tables, cycles, strict=True)]
    return Aligned(
        cycle=common,
        rig=taken[0],
        catenary=taken[1],
        command=taken[2],
        streams=streams,
        expected=end - begin + 1,
        missing=[int(cycle) for cycle in missing],
        ended=ended,
        notes=notes,
    )


def completeness(table: Table) -> Stream:
    """Count the missing and double cycles of a stream's last ride."""
    restarts = len(_restarts(table))
    cycle = last_ride(table)["cycle"].astype(np.int64)
    present = np.unique(cycle)
    missing = np.setdiff1d(np.arange(present[0], present[-1] + 1), present, assume_unique=True)
    return Stream(
        topic=table.topic,
        messages=len(table),
        first=int(present[0]),
        last=int(present[-1]),
        expected=int(present[-1] - present[0]) + 1,
        missing=len(missing),
        missing_ranges=ranges(missing),
        duplicates=len(cycle) - len(present),
        restarts=restarts,
    )


def valid(table: Table, needed: Sequence[str]) -> Table:
    """Drop what the nodes refuse too: messages with a number that is not finite, or with a stray cycle number."""
    good = np.logical_and.reduce([np.isfinite(table.real(name)) for name in needed])
    return believable(table if good.all() else table.take(good))


def believable(table: Table) -> Table:
    """Drop messages whose cycle number is far ahead of the one before and that no others follow there."""
    cycle = table["cycle"].astype(np.int64)
    if len(cycle) < 2 or not (np.diff(cycle) > AHEAD).any():
        return table
    jumps, expected = JumpFilter(), int(cycle[0]) + 1
    good = np.zeros(len(cycle), np.bool_)
    for row, number in enumerate(cycle.tolist()):
        good[row] = jumps.believes(number, expected)
        if good[row]:
            expected = number + 1
    return table.take(good)


def last_ride(table: Table) -> Table:
    """Cut all that came before the last reset, which shows as a cycle number that falls back."""
    table = believable(table)
    restarts = _restarts(table)
    return table.take(np.arange(restarts[-1], len(table))) if len(restarts) else table


def unique(table: Table) -> Table:
    """Sort by cycle number and keep the first message of each cycle."""
    _, first = np.unique(table["cycle"], return_index=True)
    return table if len(first) == len(table) and np.all(np.diff(first) == 1) else table.take(first)


def cycle_time(bag: Bag, rig: Table) -> float:
    """Give Ts in s: from the catenary's reduced model, else from a timing batch, else from the rig's stamps.

    Raises
    ------
    BagError
        Nothing in the bag tells it.
    """
    for kind, name in (("ImpedanceModel", "ts"), ("CycleTiming", "budget")):
        for table in bag.of_type(kind):
            value = float(table[name][-1])
            if value > 0.0:
                return value
    stamp = rig["header.stamp.sec"].astype(np.int64) * 10**9 + rig["header.stamp.nanosec"].astype(np.int64)
    cycles = np.diff(rig["cycle"].astype(np.int64))
    if len(cycles) == 0 or (step := float(np.median(np.diff(stamp) / cycles))) <= 0.0:
        raise BagError("the cycle time cannot be told from this bag: too few states in it")
    return round(step * 1e-9, 5)


def ranges(numbers: NDArray[np.int64] | list[int], most: int = 20) -> list[str]:
    """Write sorted cycle numbers as ranges ("7", "12..15"), `most` of them and a remark for the rest."""
    array = np.asarray(numbers, dtype=np.int64)
    if len(array) == 0:
        return []
    groups = np.split(array, np.flatnonzero(np.diff(array) > 1) + 1)
    texts = [str(g[0]) if len(g) == 1 else f"{g[0]}..{g[-1]}" for g in groups[:most]]
    if len(groups) > most:
        texts.append(f"and {len(groups) - most} more")
    return texts


def _restarts(table: Table) -> NDArray[np.int64]:
    cycle = table["cycle"].astype(np.int64)
    if len(cycle) == 0:
        raise BagError(f"no message on {table.topic} could be read")
    before, after = cycle[:-1], cycle[1:]
    found: NDArray[np.int64] = np.flatnonzero((before - after > RESTART) | ((after == 0) & (before > 0))) + 1
    return found
