"""Both wires without anything on them: the interior scheme and the boundary stencils of one step.

The interior scheme is a product (`absorbing.moving_beam`), w(n+1) = I [d C w(n) - d^2 I w(n-1)], and is applied as one:
three sums of 2 R + 1 terms in place of two of 4 R + 1.
"""

from __future__ import annotations

import numpy as np

from catenary_model.absorbing.moving_beam import leap, shift
from catenary_model.layout import Array
from catenary_model.line import Wire
from phil_base.kernels import njit

PADDING = 12
"""Zeros after the nodes of a wire, so that sums of up to eleven terms may run over the end."""
LEAP, BACK, CARRY = 0, 1, 2
"""Rows of `factors`."""


def factors(wire: Wire, speed: float, dx: float, dt: float, reach: int) -> Array:
    """Weights d C of w(n), -d^2 I of w(n-1) and I of both together, one wire, (3, taps), padded with zeros."""
    decay = float(np.exp(-0.5 * wire.damping / wire.mass_per_length * dt))
    taps = next(taps for taps in (7, 9, 11) if taps > 2 * reach)
    carry = shift(speed * dt / dx, reach)
    out = np.zeros((3, taps))
    out[CARRY, : carry.size] = carry
    out[LEAP, : carry.size] = decay * leap(
        wire.mass_per_length, wire.damping, wire.bending_stiffness, wire.tension, dx, dt, reach
    )
    out[BACK, : carry.size] = -(decay**2) * carry
    return out


@njit(cache=True, fastmath=False)
def _add_7(out: Array, a: Array, t: Array, count: int) -> None:
    """Add seven terms to `count` nodes."""
    t0, t1, t2, t3, t4, t5, t6 = t[0], t[1], t[2], t[3], t[4], t[5], t[6]
    for j in range(count):
        out[j] += (
            t0 * a[j] + t1 * a[j + 1] + t2 * a[j + 2] + t3 * a[j + 3] + t4 * a[j + 4] + t5 * a[j + 5] + t6 * a[j + 6]
        )


@njit(cache=True, fastmath=False)
def _add_9(out: Array, a: Array, t: Array, count: int) -> None:
    """Add nine terms to `count` nodes."""
    t0, t1, t2, t3, t4, t5, t6, t7, t8 = t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8]
    for j in range(count):
        out[j] += (
            t0 * a[j]
            + t1 * a[j + 1]
            + t2 * a[j + 2]
            + t3 * a[j + 3]
            + t4 * a[j + 4]
            + t5 * a[j + 5]
            + t6 * a[j + 6]
            + t7 * a[j + 7]
            + t8 * a[j + 8]
        )


@njit(cache=True, fastmath=False)
def _add_11(out: Array, a: Array, t: Array, count: int) -> None:
    """Add eleven terms to `count` nodes."""
    t0, t1, t2, t3, t4, t5, t6, t7, t8, t9, t10 = t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8], t[9], t[10]
    for j in range(count):
        out[j] += (
            t0 * a[j]
            + t1 * a[j + 1]
            + t2 * a[j + 2]
            + t3 * a[j + 3]
            + t4 * a[j + 4]
            + t5 * a[j + 5]
            + t6 * a[j + 6]
            + t7 * a[j + 7]
            + t8 * a[j + 8]
            + t9 * a[j + 9]
            + t10 * a[j + 10]
        )


@njit(cache=True, fastmath=False)
def _add(out: Array, a: Array, t: Array, count: int) -> None:
    """Add the sum of t[m] a[j + m] to `count` nodes j."""
    if t.size == 7:
        _add_7(out, a, t, count)
    elif t.size == 9:
        _add_9(out, a, t, count)
    else:
        _add_11(out, a, t, count)


@njit(cache=True, fastmath=False)
def propagate(inner: Array, half: int, reach: int, nodes: int, w: Array, now: int, wire: int, between: Array) -> None:
    """Apply the interior scheme of one wire, `factors`, to all nodes that it can update; the others are set to zero.

    `half` is R, `reach` that of the whole scheme: 2 R, or R at rest, where I is 1. `between` is work, (level's size,).
    """
    slots = w.shape[0]
    new = w[(now + 1) % slots, wire]
    new[:] = 0.0
    between[:] = 0.0
    _add(between[half:], w[now, wire], inner[wire, LEAP], nodes - 2 * half)
    _add(between[half:], w[(now - 1) % slots, wire], inner[wire, BACK], nodes - 2 * half)
    _add(new[reach:], between[reach - half :], inner[wire, CARRY], nodes - 2 * reach)


@njit(cache=True, fastmath=False)
def close(edge: Array, reach: int, nodes: int, w: Array, now: int, wire: int, ends: Array) -> None:
    """Complete the new level of one wire at both ends by the boundary stencils, all of old values."""
    slots, levels, width = w.shape[0], edge.shape[2], edge.shape[3]
    behind, ahead = ends[0], ends[1]
    behind[:] = 0.0
    ahead[:] = 0.0
    for level in range(levels):
        row = w[(now - level) % slots, wire]
        for k in range(width):
            x, y = row[k], row[nodes - 1 - k]
            c, d = edge[wire, 0, level, k], edge[wire, 1, level, k]
            for p in range(behind.size):
                behind[p] += c[p] * x
                ahead[p] += d[p] * y
    new = w[(now + 1) % slots, wire]
    for p in range(reach):
        new[p] = behind[p]
        new[nodes - 1 - p] = ahead[p]
