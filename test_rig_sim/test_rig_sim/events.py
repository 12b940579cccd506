"""Sudden events of a ride: the actuator's pressure changes, the head is knocked down. Functions of the cycle alone."""

import math
from typing import NamedTuple

from test_rig_sim.pantograph_parameters import EventParameters

LIVE_RAMP = 0.2
"""s, time that an uplift force takes which is changed during operation: a pressure does not jump."""


def smooth_step(share: float) -> float:
    """Return half a cosine from 0 at share <= 0 to 1 at share >= 1."""
    if share <= 0.0:
        return 0.0
    return 1.0 if share >= 1.0 else 0.5 - 0.5 * math.cos(math.pi * share)


def pressure_share(events: EventParameters, t: float) -> float:
    """Return the share of the uplift force that the actuator has at time t (s)."""
    if events.pressure_time == 0.0:
        return 1.0
    lowered = smooth_step((t - events.pressure_time) / events.pressure_ramp)
    if events.pressure_return_time > 0.0:
        lowered -= smooth_step((t - events.pressure_return_time) / events.pressure_ramp)
    return 1.0 + lowered * (events.pressure_share - 1.0)


class Knock(NamedTuple):
    """A push on the head: J / T (1 - cos(2 pi t / T)), in whole cycles.

    Sampled at the cycles and linear between them, its integral is exactly J: the sum of 1 - cos over the T / Ts >= 2
    instants of one period is T / Ts.
    """

    first: int  # cycle at which it begins
    cycles: int  # 1, its duration
    mean: float  # N, impulse over duration

    def force(self, cycle: int) -> float:
        """Return the force on the head at t_k in N, downwards."""
        j = cycle - self.first
        if not 0 < j < self.cycles:
            return 0.0
        return self.mean * (1.0 - math.cos(2.0 * math.pi * j / self.cycles))


def knock(events: EventParameters, cycle_time: float) -> Knock:
    """Return the knock of a ride with that cycle time (s); without one its force is zero."""
    if events.knock_time == 0.0:
        return Knock(0, 0, 0.0)
    cycles = max(2, round(events.knock_duration / cycle_time))
    return Knock(round(events.knock_time / cycle_time), cycles, events.knock_impulse / (cycles * cycle_time))


class Change(NamedTuple):
    """A number that goes from one value to another along half a cosine."""

    start: float
    end: float
    since: float  # s
    duration: float  # s

    def at(self, t: float) -> float:
        """Return the value at time t (s)."""
        if t < self.since:
            return self.start
        if t >= self.since + self.duration:
            return self.end
        return self.start + (self.end - self.start) * smooth_step((t - self.since) / self.duration)


class Uplift:
    """The actuator's force over time: up and down, lowered pressure, and changes during operation."""

    def __init__(self, force: float, events: EventParameters, run_in: float, initial_share: float) -> None:
        self._events = events
        self._run_in, self._initial_share = run_in, initial_share
        self._force = Change(force, force, 0.0, 0.0)
        self.reset()

    @property
    def target(self) -> float:
        """Uplift force that was set last, N."""
        return self._force.end

    def reset(self, lowered: bool = False) -> None:
        """Go back to t = 0, at the force that was set last; begin with the run-in, or lowered until it is raised."""
        self._force = Change(self.target, self.target, 0.0, 0.0)
        self._raised = Change(0.0, 0.0, 0.0, 0.0) if lowered else Change(self._initial_share, 1.0, 0.0, self._run_in)

    def change(self, force: float, t: float) -> None:
        """Go to another uplift force (N) from time t (s) on, within 0.2 s."""
        self._force = Change(self._force.at(t), force, t, LIVE_RAMP)

    def lift(self, t: float) -> None:
        """Raise the pantograph from time t (s) on, within the run-in."""
        self._raised = Change(self._raised.at(t), 1.0, t, self._run_in)

    def lower(self, t: float) -> None:
        """Lower the pantograph from time t (s) on, within the run-in."""
        self._raised = Change(self._raised.at(t), 0.0, t, self._run_in)

    def at(self, t: float, air: float = 0.0) -> float:
        """Return the actuator's force in N at time t (s).

        What is raised and lowered is the whole lift of the frame: the actuator also holds back what the air flow
        contributes (air, N). A lowered pantograph carries no force.
        """
        force = self._force.at(t) * pressure_share(self._events, t)
        share = self._raised.at(t)
        return force if share == 1.0 else share * (force + air) - air
