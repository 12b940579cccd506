"""What the steps of finite elements and of finite differences have in common; compiled for the bundles of either.

Their constants and states are different named tuples; `real`, `whole`, `counter`, `point`, `contact` and `static` are
fields of both. What a scheme does in its own way, compiled, is handed to `cycles`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from catenary_model import arena
from catenary_model.layout import GIVEN, IMPULSE, ITERATIONS, LAST_FORCE, STEPS, W_CAT, WORK, Array, Ints
from phil_base.kernels import njit


@njit(cache=True, fastmath=False)
def track_position(c: Any, s: Any) -> float:
    """Track position zeta_0 + v t of the pantograph at the present instant, m; (3.4) with its sign corrected."""
    return float(c.real.start + c.real.speed * (c.real.ts * s.counter[STEPS]))


@njit(cache=True, fastmath=False)
def height_of(c: Any, s: Any, deviation: float, force: float) -> float:
    """Displacement of the contact point for the wire's deviation there (m) and a contact force (N), now, m."""
    samples = c.static.shape[0] - 1
    at = track_position(c, s) / c.real.period
    at = (at - np.floor(at)) * samples
    i = min(int(at), samples - 1)
    static = c.static[i, 0] + (at - i) * (c.static[i + 1, 0] - c.static[i, 0])
    return float(static + deviation + c.real.compliance * force)


@njit(cache=True, fastmath=False)
def book(c: Any, s: Any, before: float, force: float, w: float, now: float) -> float:
    """Add one integration step to work and impulse, as trapezoids; return the new height of the contact point, m.

    The force (N) went from `before` to `force`, the contact point from `w` (m) to `now`.
    """
    s.point[WORK] += 0.5 * (before + force) * (now - w)
    s.point[IMPULSE] += 0.5 * c.real.ts * (before + force)
    return now


def cycles(
    constants: type[Any], state: type[Any], arrive: Any, height: Any, leave: Any, observe: Any
) -> tuple[Any, Any]:
    """Make the compiled cycle of a scheme, from t_k to t_(k+1): `advance(c, s, f_cat)`, `cycle(*arena, f_cat)`.

    `constants` and `state` are the classes of its bundles c and s; `cycle` takes them packed (`arena.pack`). The
    contact force goes in a straight line to f_cat (N), the one of the new instant. A step of the scheme is
    `arrive(c, s)` at a new instant, whose force is in `contact[GIVEN]`, `height(c, s, force)` of the contact point
    there, and `leave(c, s, force)` for the next one; after the last one comes `observe(c, s, f_cat)`.
    """
    unpack = arena.unpacker(constants, state)

    @njit(cache=True, fastmath=False)
    def advance(c: Any, s: Any, f_cat: float) -> None:
        n = c.whole.substeps
        before = s.contact[LAST_FORCE]
        s.counter[ITERATIONS] = 0
        force, w = before, s.point[W_CAT]
        for j in range(n):
            old, force = force, before + (f_cat - before) * ((j + 1) / n)
            s.contact[GIVEN] = force
            arrive(c, s)
            w = book(c, s, old, force, w, height(c, s, force))
            leave(c, s, force)
        s.contact[LAST_FORCE] = f_cat
        observe(c, s, f_cat)

    @njit(cache=True, fastmath=False)
    def cycle(floats: Array, whole: Ints, table: Ints, f_cat: float) -> None:
        c, s = unpack(floats, whole, table)
        advance(c, s, f_cat)

    return advance, cycle


@njit(cache=True, fastmath=False)
def soft_start_share(t: float, soft_start: float) -> float:
    """Share of the uplift force at the time t (s): (1 - cos)/2 within the first soft_start s, then 1."""
    return float(0.5 - 0.5 * np.cos(np.pi * t / soft_start)) if t < soft_start else 1.0
