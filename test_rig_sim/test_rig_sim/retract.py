"""The motion to the safe position: brake first, then away from the pantograph, with limited speed and acceleration."""

from typing import NamedTuple

from test_rig_sim.motion import Pace, at_rest, creep, towards

NEAR, SLOW = 5e-3, 0.05
"""m and m/s, within which a drive counts as resting at the safe position."""
SETTLING = 1.0
"""s, that it may take for it once its reference is there."""


class Retract(NamedTuple):
    """Where the retract motion ends and how fast it may go."""

    position: float  # m
    speed: float  # m/s
    acceleration: float  # m/s^2
    braking: float  # m/s^2, deceleration from whatever speed the drive had


def brake_step(limits: Retract, reference: float, speed: float, period: float) -> tuple[float, float]:
    """Return the next reference (m) and its speed (m/s) on the way to a standstill."""
    speed = creep(0.0, limits.braking, speed, period)
    return reference + speed * period, speed


def retract_step(limits: Retract, reference: float, speed: float, period: float) -> tuple[float, float]:
    """Return the next reference (m) and its speed (m/s) on the way to the safe position; brakes in time to stop."""
    return towards(limits.position, Pace(limits.speed, limits.acceleration), reference, speed, period)


def arrived(limits: Retract, reference: float, speed: float) -> bool:
    """Tell whether the reference rests at the safe position."""
    return at_rest(limits.position, reference, speed)


def obeys(limits: Retract, w: float, v: float) -> bool:
    """Tell whether the drive (m, m/s) is at the safe position and rests; one whose state is not finite does not."""
    return abs(w - limits.position) < NEAR and abs(v) < SLOW
