"""What a real frame does beyond spring and dashpot: dry friction, end stops, air spring, lift by the air flow.

h is the height of the frame's body above its nominal place, relative to the car body; v is its rate of change.
Every law acts on the frame's body (upwards positive), and each one is switched off by a zero in `Frame`.

| law | force on the frame |
|---|---|
| air spring | ((p_0 + F/A) (V/V(h))^kappa - p_0) (A + A' h),   V(h) = V + A h + A' h^2 / 2 |
| dry friction | -(F_C + (F_S - F_C) exp(-(v/v_S)^2)) tanh(v/v_0) |
| end stops | max(0, k d + c d'), d the depth beyond the stop, directed back |
| air flow | constant at constant speed of the train: c v_train^2 |
| inertia | m(h) = m (1 + s h): m(h) q'' + m s (h' q' - q'^2 / 2), Lagrange's equation of m(h) q'^2 / 2 |
"""

import math
from typing import NamedTuple

from phil_base.kernels import njit

AMBIENT = 101325.0
"""Pressure around the bellows, Pa."""


class Frame(NamedTuple):
    """Constants of the laws on the frame's body; SI units; all zero: a linear frame."""

    rest: float = 0.0  # m, place of the frame's body at which h = 0
    air: float = 0.0  # N, lift by the air flow at the train's speed
    friction: float = 0.0  # N, F_C, Coulomb friction
    breakaway: float = 0.0  # N, F_S, friction of slow motion (Stribeck); below F_C counts as F_C
    stribeck_speed: float = 1.0  # m/s, v_S
    friction_speed: float = 1.0  # m/s, v_0, over which the friction builds up
    stop_stiffness: float = 0.0  # N/m, 0: no stops
    stop_damping: float = 0.0  # N s/m
    lower_stop: float = 0.0  # m, h at which the lower stop begins
    upper_stop: float = 0.0  # m, the same of the upper one
    area: float = 0.0  # m^2, A, of the bellows, reduced to the frame's body; 0: force independent of height
    area_slope: float = 0.0  # m, A', change of the leverage with height
    volume: float = 0.0  # m^3, V, of bellows and pipes at h = 0
    exponent: float = 0.0  # 1, kappa, polytropic exponent
    inertia_slope: float = 0.0  # 1/m, s, relative change of the effective mass with height


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def bellows_volume(volume: float, area: float, area_slope: float, h: float) -> float:
    """V(h) in m^3 at height h (m); its derivative is the reduced area, so pressure times area does the gas's work."""
    return volume + (area + 0.5 * area_slope * h) * h


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def air_spring(frame: Frame, h: float, lift: float) -> float:
    """Force of the bellows in N at height h (m), inflated such that it is lift (N) at h = 0, then shut off."""
    if frame.area <= 0.0:
        return lift
    volume = bellows_volume(frame.volume, frame.area, frame.area_slope, h)
    pressure = (AMBIENT + lift / frame.area) * (frame.volume / volume) ** frame.exponent
    return (pressure - AMBIENT) * (frame.area + frame.area_slope * h)


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def friction(frame: Frame, v: float) -> float:
    """Dry friction in N at speed v (m/s) of the joints, always against it; zero at v = 0."""
    if frame.friction <= 0.0:
        return 0.0
    force = frame.friction
    if frame.breakaway > force:
        force += (frame.breakaway - force) * math.exp(-((v / frame.stribeck_speed) ** 2))
    return -force * math.tanh(v / frame.friction_speed)


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def end_stops(frame: Frame, h: float, v: float) -> float:
    """Force of the end stops in N at height h (m) and speed v (m/s); a stop pushes and never holds back."""
    if h > frame.upper_stop:
        return -max(0.0, frame.stop_stiffness * (h - frame.upper_stop) + frame.stop_damping * v)
    if h < frame.lower_stop:
        return max(0.0, frame.stop_stiffness * (frame.lower_stop - h) - frame.stop_damping * v)
    return 0.0


@njit(cache=True, fastmath=False, forceinline=True, error_model="numpy")
def frame_force(frame: Frame, h: float, v: float, lift: float) -> float:
    """All forces on the frame's body in N but those of its linear spring and dashpot."""
    force = air_spring(frame, h, lift) + frame.air + friction(frame, v)
    if frame.stop_stiffness > 0.0:
        force += end_stops(frame, h, v)
    return force
