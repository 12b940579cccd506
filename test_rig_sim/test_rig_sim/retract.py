"""The motion to the safe position: a reference of limited speed and acceleration."""

import math
from typing import NamedTuple


class Retract(NamedTuple):
    """Where the retract motion ends and how fast it may go."""

    position: float  # m
    speed: float  # m/s
    acceleration: float  # m/s^2


def retract_step(limits: Retract, reference: float, speed: float, period: float) -> tuple[float, float]:
    """Return the next reference (m) and its speed (m/s) one period (s) on: brakes in time to stop at the goal.

    The speed wanted is the one from which half of the allowed acceleration still stops at the goal (the other half
    is the reserve against sampling), at most the allowed speed, and none that would overshoot within the period.
    """
    distance = limits.position - reference
    wanted = min(limits.speed, math.sqrt(limits.acceleration * abs(distance)), abs(distance) / period)
    wanted = math.copysign(wanted, distance)
    change = limits.acceleration * period
    speed += min(max(wanted - speed, -change), change)
    return reference + speed * period, speed


def arrived(limits: Retract, reference: float, speed: float) -> bool:
    """Tell whether the reference rests at the safe position, within 0.1 mm and 1 mm/s."""
    return abs(reference - limits.position) < 1e-4 and abs(speed) < 1e-3
