"""The wall clock of a recording: how long the ride took by it, and whether it was set meanwhile.

Log times are wall time. A clock that is set back or forth during the ride (NTP after boot) shows in the steps of the
log time from cycle to cycle: one that goes back; one that is long while nobody at all was heard, though the nodes speak
every second; log times that stand still, which is how our recorder keeps them in order after the clock was set back;
or, in real time, stamps of the states, which run on steadily, from which the log times drift away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, Table

BACK = 0.1
"""Time in s by which log times may go back without a clock that was set: messages that overtook one another."""
SILENCE = 5.0
"""Time in s without any message that is no pause of the ride."""
STILL = 25
"""Successive states of one log time that are no chance."""
DRIFT = 0.5
"""Time in s by which log times and stamps may drift apart in a ride in real time."""
WALL = 1_000_000_000
"""Stamps in s from which on they are wall time (September 2001)."""


@dataclass(frozen=True)
class WallTime:
    """Wall time of the ride in s, without the jumps of the clock, and what to say about these (empty: none)."""

    seconds: float
    note: str

    @property
    def jumped(self) -> bool:
        """Tell whether the clock was set during the ride."""
        return bool(self.note)


def stamps(table: Table) -> NDArray[np.int64]:
    """Give the header stamps of a table in ns."""
    seconds, rest = table["header.stamp.sec"].astype(np.int64), table["header.stamp.nanosec"].astype(np.int64)
    return np.asarray(seconds * 1_000_000_000 + rest, np.int64)


def wall_time(bag: Bag, rig: Table) -> WallTime:
    """Measure the ride by the log times of its states, one a cycle in their order, and look for jumps of the clock."""
    log, cycle = rig.log_time, rig["cycle"].astype(np.int64)
    if len(log) < 2:
        return WallTime(0.0, "")
    step = np.diff(log) * 1e-9
    still = _standing_still(step)
    jumps = (step < -BACK) | ((step > SILENCE) & _silent(bag, log))
    good = ~(jumps | still)
    usual = float(np.median(step[good])) if good.any() else float("nan")
    if not good.any() and still.any():
        note = "Log times do not tell how long the ride took: they stand still"
        return WallTime(float("nan"), f"{note}. Wall time is left out.")
    seconds = float(step[good].sum()) + (usual * int((~good).sum()) if not good.all() else 0.0)
    found = [_said(float(step[i]) - usual, int(cycle[i + 1])) for i in np.flatnonzero(jumps)[:3]]
    if still.any():
        at = np.flatnonzero(still)
        found.append(f"set back (log times stand still from cycle {cycle[at[0]]} to {cycle[at[-1] + 1]})")
    if not found and abs(drift := _drift(rig)) > DRIFT:
        seconds = float(stamps(rig)[-1] - stamps(rig)[0]) * 1e-9
        found.append(_said(drift))
    if not found:
        return WallTime(seconds, "")
    note = f"The wall clock was {', then '.join(found)} during the recording: wall time is given without that, "
    return WallTime(seconds, note + "its ratio to simulated time is left out.")


def leap_of_stamps(rig: Table) -> str:
    """Say where the states' stamps leap though their log times do not: the rig's stamps are wrong there; empty if none.

    Nothing but times by stamp depends on them.
    """
    found = np.flatnonzero(_leaps(rig))
    if not found.size:
        return ""
    at, cycle = stamps(rig), rig["cycle"]
    jump, first = float(at[found[0] + 1] - at[found[0]]) * 1e-9, cycle[found[0] + 1]
    more = f", and in {found.size - 1} cycles after it" if found.size > 1 else ""
    way = "back" if jump < 0.0 else "forth"
    return f"The stamps of the rig's states leap {way} by {abs(jump):.4g} s at cycle {first}{more}: log times do not."


def _leaps(rig: Table) -> NDArray[np.bool_]:
    step, log = np.diff(stamps(rig)) * 1e-9, np.diff(rig.log_time) * 1e-9
    return np.asarray((np.abs(step) > DRIFT) & (np.abs(step - log) > 0.5 * np.abs(step)))


def _said(jump: float, cycle: int | None = None) -> str:
    where = "" if cycle is None else f" at cycle {cycle}"
    return f"set {'back' if jump < 0.0 else 'forth'} by {abs(jump):.4g} s{where}"


def _standing_still(step: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the steps of zero that belong to at least `STILL` of them in a row."""
    zero = np.concatenate([[False], step == 0.0, [False]])
    edges = np.flatnonzero(np.diff(zero.astype(np.int8)))
    found = np.zeros(len(step), np.bool_)
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        if end - begin >= STILL:
            found[begin:end] = True
    return found


def _silent(bag: Bag, log: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell for each step of the log time whether no message at all was recorded within it."""
    others = [table.log_time for table in bag.tables.values()]
    others.append(np.array([entry.log_time for entry in bag.diagnostics], np.int64))
    heard = np.sort(np.concatenate(others))
    edge = 500_000_000  # ns, messages that belong to the cycles at either end
    between = np.searchsorted(heard, log[1:] - edge) - np.searchsorted(heard, log[:-1] + edge)
    return np.asarray(between <= 0)


def _drift(rig: Table) -> float:
    """Give the drift in s of log times against stamps of the wall clock, from the first to the last quarter.

    A recorder that was held up logs late, never early: the earliest of each quarter counts.
    """
    at = stamps(rig)
    late = (rig.log_time - at) * 1e-9
    quarter = len(late) // 4
    if quarter < 1 or at.min() < WALL * 1_000_000_000 or _leaps(rig).any():
        return 0.0
    return float(late[-quarter:].min() - late[:quarter].min())
