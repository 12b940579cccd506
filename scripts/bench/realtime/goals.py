"""What a ride in real time is to keep; it is told, not tested."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bench.realtime.figures import RIG, Measured


class Goal(NamedTuple):
    """One figure and what it is to stay below."""

    what: str
    value: float
    goal: float

    def row(self) -> dict[str, object]:
        """Give it for table and JSON."""
        return {
            "what": self.what,
            "value": float(self.value),
            "goal": float(self.goal),
            "holds": self.value <= self.goal,
        }


LATE = {(500, False): 1e-5, (1000, False): 2e-4, (500, True): 1e-3, (1000, True): 5e-3}
"""Largest share of late commands by rate in Hz, alone and disturbed."""
BRIDGED = 2
"""Most cycles bridged on end under disturbance."""
P99_MS = 1.0
"""ms, state out to command in, at 500 Hz under disturbance."""
HALF = 0.5
"""Of the median and the p99 of another build."""


def goals(rides: Sequence[Measured], rate: float, disturbed: bool) -> list[Goal]:
    """Hold rides of one kind against their goals; none for other rates than 500 and 1000 Hz."""
    allowed = LATE.get((round(rate), disturbed))
    if allowed is None:
        return []
    late, cycles = sum(one.late for one in rides), sum(one.cycles for one in rides)
    found = [Goal("late commands, share", late / cycles, allowed)]
    if disturbed:
        found.append(Goal("bridged on end, cycles", max(one.bridged for one in rides), BRIDGED))
        times = np.concatenate([np.zeros(0), *(one.turnaround[RIG] for one in rides if RIG in one.turnaround)])
        if round(rate) == 500 and times.size:
            found.append(Goal("state out to command in, p99, ms", float(np.percentile(times, 99.0)) * 1e3, P99_MS))
    return [*found, Goal("rides that ended in a retract", sum(one.retracted for one in rides), 0)]
