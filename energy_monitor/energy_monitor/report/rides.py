"""The rides in a bag, told by the cycle numbers of its streams.

A stream is a sequence of chains: runs of cycle numbers that go on from each other. A chain is a ride of its own only if
numbers fall back and go on from there; a few stray messages, or old ones that come again, are none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, BagError, Table
from energy_monitor.cycles import AHEAD

STEP_BACK = 64
"""Cycles that a message may be behind the newest and be one out of order; beyond, it is a stray one or a new ride."""
SEVERAL = 10
"""Messages that go on from each other and so are no stray ones."""
LONGEST_GAP = 10_000_000
"""Cycles that may be missing within a ride: hours."""
_OPEN = 8
"""Chains that a message may go on from: the ones that were met last."""

_MOST = 100
"""Chains that are looked at: more than any bag has rides."""
EVERY_CYCLE = ("RigState", "CatenaryState", "ImpedanceCommand")
"""Types that are sent in every cycle."""

Rows = NDArray[np.int64]
Cycles = NDArray[np.int64]


@dataclass
class Chain:
    """Rows of a stream whose cycle numbers go on from each other."""

    rows: Rows
    cycle: Cycles

    @property
    def first(self) -> int:
        """Give the smallest cycle."""
        return int(self.cycle.min())

    @property
    def last(self) -> int:
        """Give the largest cycle."""
        return int(self.cycle.max())


def rides_of(table: Table) -> list[Table]:
    """Split a stream into its rides, in their order; stray messages and those that came again are in none."""
    cycle = cycles_of(table)
    chains = _chains(cycle, 1 if table.msgtype in EVERY_CYCLE else None)
    if not chains:
        return []
    if len(chains) == 1:
        return [table if len(chains[0].rows) == len(table) else table.take(chains[0].rows)]
    chains = _longest(_with_gaps(chains))
    rides: list[Chain] = []
    for chain in chains:
        if not (_inserted(chain, chains) or any(_repeats(table, chain, ride) for ride in rides)):
            rides.append(chain)
    loose = np.setdiff1d(np.arange(len(table)), np.concatenate([ride.rows for ride in rides]), assume_unique=True)
    found = []
    for ride in rides:
        taken = _with_late(table, ride, cycle, loose)
        loose = np.setdiff1d(loose, taken, assume_unique=True)
        found.append(table.take(taken))
    return found


def last_ride(table: Table) -> Table:
    """Give the last ride of a stream."""
    rides = rides_of(table)
    if not rides:
        raise BagError(f"no message on {table.topic} could be read")
    return rides[-1]


def cycles_of(table: Table) -> Cycles:
    """Give the cycle numbers; those beyond any sense come out negative."""
    return table["cycle"].astype(np.int64)


def paired(streams: Sequence[list[Table]]) -> list[list[Table]]:
    """Bring the rides of several streams together; one that is not in all of them is none.

    Streams with equally many rides have the same ones; else those belong together that were recorded at the same time.
    """
    if len({len(rides) for rides in streams}) == 1:
        return [list(ride) for ride in zip(*streams, strict=True)]
    found = []
    for first in streams[0]:
        ride = [first]
        for others in streams[1:]:
            best = max(others, key=lambda other: _overlap(first, other), default=None)
            if best is None or not len(np.intersect1d(cycles_of(first), cycles_of(best))):
                break
            ride.append(best)
        if len(ride) == len(streams):
            found.append(ride)
    return found or [[rides[-1] for rides in streams]]


def bag_of_ride(bag: Bag, rides: Sequence[Sequence[Table]], chosen: int) -> Bag:
    """Give the bag with what was recorded during one of its rides only; the model stays, it is sent once."""
    if len(rides) < 2:
        return bag
    begins = [min(int(table.log_time[0]) for table in ride) for ride in rides]
    begin = begins[chosen]
    ends = [time for time in begins if time > begin]
    end = min(ends) if ends else None

    def within(table: Table) -> Table:
        after = np.ones(len(table), np.bool_) if table.msgtype == "ImpedanceModel" else table.log_time >= begin
        return table.take(after if end is None else after & (table.log_time < end))

    tables = {name: within(table) for name, table in bag.tables.items()}
    first = begin == min(begins)
    diagnostics = [
        entry
        for entry in bag.diagnostics
        if (first or entry.log_time >= begin) and (end is None or entry.log_time < end)
    ]
    return replace(bag, tables=tables, diagnostics=diagnostics)


def described(rides: Sequence[Sequence[Table]]) -> str:
    """List rides by number and cycles."""
    texts = []
    for number, (rig, *_) in enumerate(rides, 1):
        cycle = cycles_of(rig)
        texts.append(f"{number}: cycles {cycle.min()} to {cycle.max()}")
    return ", ".join(texts)


def _longest(chains: list[Chain]) -> list[Chain]:
    """Choose the chains of several messages, or the longest if there is none; of very many the longest."""
    several = [chain for chain in chains if len(chain.rows) >= SEVERAL]
    if len(several) > _MOST:
        several = sorted(several, key=lambda chain: len(chain.rows))[-_MOST:]
    several.sort(key=lambda chain: int(chain.rows[0]))
    return several or [max(chains, key=lambda chain: len(chain.rows))]


def _chains(cycle: Cycles, usual: int | None) -> list[Chain]:
    """Split cycle numbers into chains, in the order in which these begin; `usual` is the step where that is known."""
    rows = np.flatnonzero(cycle >= 0)  # a number beyond any sense goes on from nothing, and nothing from it
    if not len(rows):
        rows = np.arange(len(cycle))
    if not len(rows):
        return []
    cycle = cycle[rows]
    step = np.diff(cycle)
    to_zero = (cycle[1:] == 0) & (cycle[:-1] > 0)
    rising = step[step > 0]
    usual = usual or (int(np.median(rising)) if len(rising) else 1)
    reach = max(STEP_BACK, 2 * usual)
    if not ((step < -STEP_BACK) | (step > reach) | to_zero).any():
        return [Chain(rows, cycle)]
    cuts = np.flatnonzero((step != 0) & (step != usual)) + 1
    begins, ends = np.concatenate([[0], cuts]), np.concatenate([cuts, [len(cycle)]])
    chains: list[list[tuple[int, int]]] = []
    tops: list[tuple[int, int]] = []
    sizes: list[int] = []
    recent: list[int] = []
    firsts, lasts = cycle[begins].tolist(), cycle[ends - 1].tolist()
    for begin, end, first, last in zip(begins.tolist(), ends.tolist(), firsts, lasts, strict=True):
        chosen = _fitting(first, usual, reach, tops, sizes, recent)
        if chosen is None:
            chosen = len(chains)
            chains.append([])
            tops.append((last, last))
            sizes.append(0)
        else:
            recent.remove(chosen)
        chains[chosen].append((begin, end))
        # A single message may be a stray one: what comes next may go on from before it.
        before = tops[chosen][0]
        top = max(before, last)
        tops[chosen] = top, before if end - begin == 1 else top
        sizes[chosen] += end - begin
        recent = [*recent[1 - _OPEN :], chosen]
    taken = [np.concatenate([np.arange(begin, end) for begin, end in runs]) for runs in chains]
    return [Chain(rows[place], cycle[place]) for place in taken]


def _fitting(
    first: int,
    usual: int,
    reach: int,
    tops: Sequence[tuple[int, int]],
    sizes: Sequence[int],
    recent: Sequence[int],
) -> int | None:
    """Choose the chain that a run that begins with this cycle goes on from; None if it goes on from none.

    A chain of several messages may lack a few before one of a single message is believed to be the one that goes on.
    """
    best, least = None, reach + STEP_BACK
    for index in reversed(recent):
        for top in tops[index]:
            ahead = first - top
            far = abs(ahead - usual) - (SEVERAL - 2 if sizes[index] >= SEVERAL else 0)
            if -STEP_BACK <= ahead <= reach and (first > 0 or ahead >= 0) and far < least:
                best, least = index, far
    return best


def _with_gaps(chains: Sequence[Chain]) -> list[Chain]:
    """Join chains that follow each other with a gap between; a few messages that are far ahead are no such chain."""
    found: list[Chain] = []
    for chain in chains:
        before = found[-1] if found else None
        gap = chain.first - before.last if before is not None else 0
        believed = 0 < gap <= AHEAD or (0 < gap <= LONGEST_GAP and len(chain.rows) >= SEVERAL)
        if before is not None and chain.rows[0] > before.rows[-1] and believed:
            found[-1] = _merged(before, chain)
        else:
            found.append(chain)
    return found


def _inserted(chain: Chain, long: Sequence[Chain]) -> bool:
    """Tell whether another chain goes on behind this one, and stood still meanwhile: these are no ride."""
    begin, end = int(chain.rows[0]), int(chain.rows[-1])
    for other in long:
        if other is not chain and other.rows[0] < begin and other.rows[-1] > end:
            left, right = np.searchsorted(other.rows, (begin, end))
            if left == right:
                return True
    return False


def _repeats(table: Table, chain: Chain, ride: Chain) -> bool:
    """Tell whether a chain holds only messages that the ride has too.

    One from the beginning is a ride of its own, as like as it may be, unless the other one had not ended when it began.
    """
    anew = chain.first <= STEP_BACK and chain.rows[0] > ride.rows[-1]
    if anew or not np.isin(chain.cycle, ride.cycle).all():
        return False
    order = np.argsort(ride.cycle, kind="stable")
    same = ride.rows[order][np.searchsorted(ride.cycle[order], chain.cycle)]
    columns = [column for column in table.columns.values() if isinstance(column, np.ndarray)]
    return all(np.array_equal(column[same], column[chain.rows]) for column in columns)


def _merged(one: Chain, other: Chain) -> Chain:
    return Chain(np.concatenate([one.rows, other.rows]), np.concatenate([one.cycle, other.cycle]))


def _with_late(table: Table, ride: Chain, cycle: Cycles, loose: Rows) -> Rows:
    """Add messages that came much too late to a ride: of cycles that it lacks, stamped between their neighbours."""
    stamped = {"header.stamp.sec", "header.stamp.nanosec"} <= table.columns.keys()
    if not len(loose) or not stamped:
        return ride.rows
    stamp = table["header.stamp.sec"].astype(np.int64) * 10**9 + table["header.stamp.nanosec"].astype(np.int64)
    order = np.argsort(ride.cycle, kind="stable")
    known, rows = ride.cycle[order], ride.rows[order]
    loose = loose[(cycle[loose] >= 0) & (cycle[loose] < known[-1]) & (cycle[loose] >= known[0] - STEP_BACK)]
    at = np.searchsorted(known, cycle[loose])
    after = stamp[rows[at]]
    before = np.where(at > 0, stamp[rows[np.maximum(at - 1, 0)]], np.iinfo(np.int64).min)
    fits = (known[at] != cycle[loose]) & (stamp[loose] > before) & (stamp[loose] < after)
    return np.sort(np.concatenate([ride.rows, loose[fits]]))


def _overlap(one: Table, other: Table) -> tuple[int, int]:
    """Rate how much two rides were recorded at the same time (ns), and else how close they began."""
    begin, end = max(one.log_time[0], other.log_time[0]), min(one.log_time[-1], other.log_time[-1])
    return max(0, int(end) - int(begin)), -abs(int(one.log_time[0]) - int(other.log_time[0]))
