"""Streams of one ride brought together by cycle number: duplicates dropped, gaps listed, restarts cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, BagError, Table
from energy_monitor.bag_channel import left_out
from energy_monitor.report.doubles import ranges, repeated, unique
from energy_monitor.report.results import Stream
from energy_monitor.report.rides import (
    SEVERAL,
    STEP_BACK,
    bag_of_ride,
    cycles_of,
    described,
    last_ride,
    paired,
    rides_of,
)
from energy_monitor.topics import CATENARY_STATE, COMMAND, RIG_STATE

__all__ = ["Aligned", "align", "completeness", "cycle_time", "last_ride", "ranges", "unique", "valid"]


@dataclass(frozen=True)
class Aligned:
    """The three cycle streams at their common cycles, how complete each is, and what else there is to say.

    `bag` holds what was recorded during this ride.
    """

    bag: Bag
    cycle: NDArray[np.int64]
    rig: Table
    catenary: Table
    command: Table
    streams: list[Stream]
    expected: int
    missing: list[int]
    ended: bool
    notes: list[str]


def align(bag: Bag, whole: bool = False, ride: int | None = None) -> Aligned:
    """Bring rig state, catenary state and command of the last ride (or of number `ride`, from 1) together by cycle.

    A ride that was recorded as a `whole` has to begin with cycle 0; otherwise the recording may begin later.

    Raises
    ------
    BagError
        One of the three is not in the bag, they have no cycle in common, there is no such ride, or files of several
        rides lie together and none is chosen.
    """
    if ride is None and len(bag.rides_of_files) > 1:
        several = "; ".join(str(files) for files in bag.rides_of_files)
        raise BagError(
            f"{bag.path} holds files of several rides: {several}: name one file, or choose by --ride N (1, 2, ..)"
        )
    names = (
        (RIG_STATE, "RigState", ("w_tr", "v_tr", "f_tr", "work", "impulse")),
        (CATENARY_STATE, "CatenaryState", ("w_cat", "v_cat", "f_cat", "work", "impulse", "speed")),
        (COMMAND, "ImpedanceCommand", ("f_tr", "f_predicted", "f_cor", "f_cat")),
    )
    recorded = [bag.table(name, kind) for name, kind, _ in names]
    finite = [valid(table, needed) for table, (_, _, needed) in zip(recorded, names, strict=True)]
    streams = [rides_of(table) for table in finite]
    rides = paired(streams)
    if ride is not None and not 1 <= ride <= len(rides):
        raise BagError(f"there is no ride {ride} in this bag; it holds {described(rides)}")
    chosen = len(rides) - 1 if ride is None else ride - 1
    notes = list(bag.notes)
    for table, good, parts in zip(recorded, finite, streams, strict=True):
        notes += _left_out(table, good, parts)
    if len(rides) > 1:
        which = "The last one" if ride is None else f"Number {ride}"
        notes.append(
            f"The nodes were reset while the bag was recorded: it holds {len(rides)} rides ({described(rides)}). "
            f"{which} is analysed; --ride N chooses."
        )
    parts, beyond = _until_its_end(rides[chosen])
    notes += beyond
    notes += [note for table in parts for note in repeated(table)]
    counted = [completeness(table, len(rides) - 1) for table in parts]
    rig, *_ = tables = [unique(table) for table in parts]
    ended = bool(rig["last"].any())
    cycles = [cycles_of(table) for table in tables]
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
    taken = [
        table if len(c) == len(common) else table.take(np.searchsorted(c, common))
        for table, c in zip(tables, cycles, strict=True)
    ]
    return Aligned(
        bag=bag_of_ride(bag, rides, chosen),
        cycle=common,
        rig=taken[0],
        catenary=taken[1],
        command=taken[2],
        streams=counted,
        expected=end - begin + 1,
        missing=[int(cycle) for cycle in missing],
        ended=ended,
        notes=notes,
    )


def completeness(table: Table, restarts: int = 0) -> Stream:
    """Count the missing and double cycles of a ride's stream."""
    cycle = cycles_of(table)
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
    """Drop what the nodes refuse too: messages with a number that is not finite, or with an impossible cycle.

    Raises BagError if none is left.
    """
    good = np.logical_and.reduce([np.isfinite(table.real(name)) for name in needed] + [cycles_of(table) >= 0])
    if not good.any():
        raise BagError(f"no message on {table.topic} can be used: NaN, infinity or an impossible cycle number in each")
    return table if good.all() else table.take(good)


def _left_out(recorded: Table, finite: Table, rides: Sequence[Table]) -> list[str]:
    """Say how many messages of a stream are not used, and why."""
    bad, used = len(recorded) - len(finite), sum(len(ride) for ride in rides)
    stray = len(finite) - used
    if not bad + stray:
        return []
    reasons = [f"{bad} with NaN, infinity or an impossible cycle number"] if bad else []
    reasons += [f"{stray} with a cycle number that is far ahead, far behind or repeated"] if stray else []
    return [left_out(bad + stray, recorded.topic, ", ".join(reasons))]


def _until_its_end(ride: Sequence[Table]) -> tuple[list[Table], list[str]]:
    """Leave out what a few stray messages say of cycles behind the ride's last state, and say how many they are."""
    rig, *_ = ride
    cycle = cycles_of(rig)
    if not rig["last"].any():
        return list(ride), []
    end = int(cycle[rig["last"].astype(np.bool_)].max())
    if np.count_nonzero(cycle > end) >= SEVERAL:  # a state that says so and is not
        return list(ride), []
    parts, notes = [], []
    for table, margin in zip(ride, (0, STEP_BACK, STEP_BACK), strict=True):
        behind = cycles_of(table) > end + margin
        count = int(behind.sum())
        stray = 0 < count < SEVERAL
        parts.append(table.take(~behind) if stray else table)
        if stray:
            notes.append(left_out(count, table.topic, f"the ride ended at cycle {end}"))
    return parts, notes


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
