"""The drive's own motions: references whose speed changes by no more than an acceleration allows."""

import math
from typing import NamedTuple


class Pace(NamedTuple):
    """How fast a motion of the drive's own may be."""

    speed: float  # m/s
    acceleration: float  # m/s^2


class Response(NamedTuple):
    """The closed position loop as a PT2: w'' = stiffness (reference - w - lead w')."""

    lead: float  # s, 2 zeta / omega
    stiffness: float  # 1/s^2, omega^2


def creep(wanted: float, acceleration: float, speed: float, period: float) -> float:
    """Return the next speed (m/s) on the way from one to the other with limited acceleration (m/s^2)."""
    change = acceleration * period
    return speed + min(max(wanted - speed, -change), change)


def towards(goal: float, pace: Pace, reference: float, speed: float, period: float) -> tuple[float, float]:
    """Return the next reference (m) and its speed (m/s) one period (s) on: goes to the goal (m) and stops there.

    The speed wanted is the one from which half of the allowed acceleration still stops at the goal (the other half
    is the reserve against sampling), at most the pace's, and none that would overshoot within the period. The last
    step ends at the goal itself: it is slower than what one period of braking takes away.
    """
    distance = goal - reference
    wanted = min(pace.speed, math.sqrt(pace.acceleration * abs(distance)), abs(distance) / period)
    speed = creep(math.copysign(wanted, distance), pace.acceleration, speed, period)
    return reference + speed * period, speed


def at_rest(goal: float, reference: float, speed: float) -> bool:
    """Tell whether a motion has come to its goal: within a nanometre, and slower than 1 um/s."""
    return abs(reference - goal) < 1e-9 and abs(speed) < 1e-6


def gentle(response: Response, w: float, v: float, acceleration: float) -> tuple[float, float]:
    """Return the lowest and highest reference (m) with which a drive at w (m), v (m/s) keeps an acceleration (m/s^2).

    The drive's acceleration is stiffness (reference - w - lead v).
    """
    coasting, reach = w + response.lead * v, acceleration / response.stiffness
    return coasting - reach, coasting + reach


def clip(value: float, low: float, high: float) -> float:
    """Return the value, or the end of the range that it is beyond."""
    return min(max(value, low), high)
