"""From a ride's bag to figures: turnaround of each node, late commands, how many were bridged on end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Table
from phil_base.enumerations import Mode

NODES = ("test_rig_sim", "impedance_mpc", "catenary_model", "energy_monitor")
RIG = NODES[0]
BRIDGED = (Mode.BRIDGING, Mode.HOLDING)

Times = NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """Figures of the cycles of a ride that were looked at."""

    first: int
    """Number of the first of these cycles."""
    cycles: int
    """As far as commands were wanted: a retract ends them."""
    late: int
    bridged: int
    """Most successive cycles without a command that could be followed."""
    retracted: bool
    late_at: NDArray[np.int64]
    """Cycle numbers of the late commands."""
    late_times: NDArray[np.int64]
    """When the states that count them were logged, in ns."""
    turnaround: Mapping[str, Times]
    """s, one entry a cycle, by node."""
    begin: int
    end: int
    """Log times in ns of the first and the last of these cycles."""
    skipped: int = 0
    """Cycles that were left out because the rig itself did not run in time: nobody waited for a command in them."""

    @property
    def share(self) -> float:
        """Give the share of commands that were late."""
        return self.late / self.cycles


def longest_run(marks: NDArray[np.bool_]) -> int:
    """Give the largest number of successive true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], marks.astype(np.int8), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def in_window(table: Table, begin: int, end: int) -> NDArray[np.bool_]:
    """Mark the messages that were logged between two times in ns."""
    return np.asarray((table.log_time >= begin) & (table.log_time <= end))


def turnarounds(timing: Table, first: int, last: int) -> Times:
    """Give a node's turnaround in s in the cycles ``first`` to ``last``; a batch ends with the cycle it names."""
    batches = [np.asarray(entries, np.float64) for entries in timing.entries("turnaround")]
    if not batches:
        return np.zeros(0)
    ends = timing["cycle"].astype(np.int64).tolist()
    cycles = np.concatenate([np.arange(end + 1 - len(one), end + 1) for end, one in zip(ends, batches, strict=True)])
    return np.asarray(np.concatenate(batches)[(first <= cycles) & (cycles <= last)], np.float64)


def stamps_of(table: Table) -> NDArray[np.int64]:
    """Give the stamps of a table's messages in ns."""
    seconds, rest = (table[f"header.stamp.{part}"].astype(np.int64) for part in ("sec", "nanosec"))
    return np.asarray(seconds * 1_000_000_000 + rest)


def ticks_skipped(cycle: NDArray[np.int64], stamp: NDArray[np.int64]) -> int:
    """Count the cycles that a rig left out: its stamps (ns) jump by them, its numbers do not."""
    if stamp.size < 2:
        return 0
    period = float(np.median(np.diff(stamp)))
    left_out = np.diff(stamp) / period - np.diff(cycle)
    return int(np.rint(left_out[left_out > 0.5]).sum())


def measured(tables: Mapping[str, Table], begin: int, end: int) -> Measured:
    """Look at what was logged between two times in ns.

    Raises
    ------
    ValueError
        There is no cycle in that time.
    """
    state = tables.get(f"/{RIG}/state")
    if state is None or not (rows := in_window(state, begin, end)).any():
        raise ValueError("no cycle was recorded in the time to be measured")
    cycle, mode = state["cycle"][rows].astype(np.int64), state["mode"][rows].astype(np.int64)
    counted, logged = state["late_commands"].astype(np.int64), state.log_time[rows]
    start = int(np.flatnonzero(rows)[0])
    late = np.diff(counted[rows], prepend=counted[start - 1] if start else 0)
    gone = np.flatnonzero(mode == Mode.RETRACTING)
    # A state shows what became of the command before it: the first one that retracts is the last one that counts.
    stop = int(gone[0]) + 1 if gone.size else cycle.size
    if gone.size and not gone[0]:
        raise ValueError("the rig had retracted before the time to be measured began")
    found = {
        node: turnarounds(tables[f"/{node}/timing"], int(cycle[0]), int(cycle[stop - 1]))
        for node in NODES
        if f"/{node}/timing" in tables
    }
    return Measured(
        first=int(cycle[0]),
        cycles=stop,
        late=int(late[:stop].sum()),
        bridged=longest_run(np.isin(mode[:stop], BRIDGED) | (late[:stop] > 0)),
        retracted=bool(gone.size),
        late_at=cycle[:stop][late[:stop] > 0],
        late_times=np.repeat(logged[:stop], np.maximum(late[:stop], 0)),
        turnaround=found,
        begin=int(logged[0]),
        end=int(logged[stop - 1]),
        skipped=ticks_skipped(cycle[:stop], stamps_of(state)[rows][:stop]),
    )
