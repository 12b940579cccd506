"""What the steps of finite elements and of finite differences have in common; compiled for the bundles of either.

Their constants and states are different named tuples; `real`, `counter`, `point` and `static` are fields of both.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from catenary_model.layout import COMPLIANCE, IMPULSE, PERIOD, SPEED, START, STEPS, TS, WORK
from phil_base.kernels import njit


@njit(cache=True, fastmath={"contract"})
def track_position(c: Any, s: Any) -> float:
    """Track position zeta_0 + v t of the pantograph at the present instant, m; (3.4) with its sign corrected."""
    return float(c.real[START] + c.real[SPEED] * (c.real[TS] * s.counter[STEPS]))


@njit(cache=True, fastmath={"contract"})
def height_of(c: Any, s: Any, deviation: float, force: float) -> float:
    """Displacement of the contact point for the wire's deviation there (m) and a contact force (N), now, m."""
    samples = c.static.shape[0] - 1
    at = track_position(c, s) / c.real[PERIOD]
    at = (at - np.floor(at)) * samples
    i = min(int(at), samples - 1)
    static = c.static[i, 0] + (at - i) * (c.static[i + 1, 0] - c.static[i, 0])
    return float(static + deviation + c.real[COMPLIANCE] * force)


@njit(cache=True, fastmath={"contract"})
def book(c: Any, s: Any, before: float, force: float, w: float, now: float) -> float:
    """Add one integration step to work and impulse, as trapezoids; return the new height of the contact point, m.

    The force (N) went from `before` to `force`, the contact point from `w` (m) to `now`.
    """
    s.point[WORK] += 0.5 * (before + force) * (now - w)
    s.point[IMPULSE] += 0.5 * c.real[TS] * (before + force)
    return now


@njit(cache=True, fastmath=False)
def soft_start_share(t: float, soft_start: float) -> float:
    """Share of the uplift force at the time t (s): (1 - cos)/2 within the first soft_start s, then 1."""
    return float(0.5 - 0.5 * np.cos(np.pi * t / soft_start)) if t < soft_start else 1.0
