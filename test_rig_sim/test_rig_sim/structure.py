"""The supporting structure: lightly damped modes that carry the stator and feel its reaction.

The stator moves by s = sum q_j, each mode of unit shape at the stator:

    m_j (q_j'' + 2 zeta_j omega_j q_j' + omega_j^2 q_j) = -(F_stator - F_rest)

with F_stator the stator's force on the slider. F_rest is its value at the ride's start, so that q counts from where the
structure stands then. The encoder measures the slider against the stator, w_abs - s; the contact feels w_abs.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from phil_base.kernels import njit

MAX_MODES = 2

Pair = tuple[float, float]


class Structure(NamedTuple):
    """Modes of the structure, none for a rigid one; only the first `modes` entries count."""

    modes: int  # 1, at most MAX_MODES
    mass: Pair  # kg, modal masses
    stiffness: Pair  # 1/s^2, omega^2
    damping: Pair  # 1/s, 2 zeta omega
    rest_force: float  # N, force of the stator on the slider at which no mode is deflected


def structure(
    frequencies_hz: Sequence[float], damping_ratios: Sequence[float], masses: Sequence[float], rest_force: float
) -> Structure:
    """Return the structure of those modes: Hz, 1, kg, equally long; rest_force in N.

    Raises ValueError for lists of different lengths, or more than two modes.
    """
    modes = len(masses)
    if not len(frequencies_hz) == len(damping_ratios) == modes or modes > MAX_MODES:
        raise ValueError(f"structure: up to {MAX_MODES} modes, each with frequency, damping ratio and mass")
    omega = [2.0 * math.pi * frequency for frequency in frequencies_hz]
    damping = [2.0 * ratio * w for ratio, w in zip(damping_ratios, omega, strict=True)]
    return Structure(modes, _pair(masses), _pair([w * w for w in omega]), _pair(damping), rest_force)


def _pair(entries: Sequence[float]) -> Pair:
    first, second, *_ = (*entries, 1.0, 1.0)
    return first, second


@njit(cache=True, fastmath=False, forceinline=True)
def mode_acceleration(body: Structure, j: int, q: float, rate: float, stator: float) -> float:
    """Return q_j'' in m/s^2 for q_j (m), q_j' (m/s) and the stator's force on the slider (N)."""
    return (body.rest_force - stator) / body.mass[j] - body.stiffness[j] * q - body.damping[j] * rate
