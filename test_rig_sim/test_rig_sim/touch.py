"""Soft start and soft landing of the contact: how the drive comes to the head, and how it leaves it."""

from typing import NamedTuple

from test_rig_sim.motion import Pace, at_rest, creep, towards


class Touch(NamedTuple):
    """How slowly head and drive meet and part, and how it is noticed."""

    gap: float  # m, distance between drive and head before they meet and after they have parted
    speed: float  # m/s, of the way down
    landing_speed: float  # m/s, of the way up
    acceleration: float  # m/s^2
    force: float  # N, contact force from which on they touch
    cycles: int  # 1, successive cycles for which the force has to say the same
    lowest: float  # m, where the way down ends without contact
    highest: float  # m, where the way up ends in contact


class Feeler:
    """Tells contact from no contact: only what the force says for some successive cycles is believed."""

    def __init__(self, touch: Touch, touching: bool) -> None:
        self._touch = touch
        self._against = 0
        self.touching = touching

    def feel(self, f_tr: float) -> None:
        """Take the contact force (N) of a cycle."""
        self._against = self._against + 1 if (f_tr >= self._touch.force) is not self.touching else 0
        if self._against >= self._touch.cycles:
            self.touching = not self.touching
            self._against = 0


def descend(touch: Touch, reference: float, speed: float, period: float) -> tuple[float, float]:
    """Return the next reference (m) and speed (m/s) of the way down."""
    speed = creep(-touch.speed, touch.acceleration, speed, period)
    return reference + speed * period, speed


class Departure:
    """The way up: on and on while head and drive touch, then a gap further, and no further."""

    def __init__(self, touch: Touch) -> None:
        self._touch = touch
        self._goal: float | None = None
        self.over = False

    def step(self, touching: bool, reference: float, speed: float, period: float) -> tuple[float, float]:
        """Return the next reference (m) and speed (m/s); ``over`` is true once the drive rests clear of the head."""
        touch = self._touch
        if touching:
            self._goal = None
            speed = creep(touch.landing_speed, touch.acceleration, speed, period)
            return reference + speed * period, speed
        if self._goal is None:
            self._goal = reference + touch.gap
        reference, speed = towards(self._goal, Pace(touch.landing_speed, touch.acceleration), reference, speed, period)
        self.over = at_rest(self._goal, reference, speed)
        return reference, speed
