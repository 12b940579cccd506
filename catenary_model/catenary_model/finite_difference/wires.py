"""Both wires without anything on them: the interior stencil and the boundary stencils of one step."""

from __future__ import annotations

from catenary_model.layout import Array
from phil_base.kernels import njit

PADDING = 8
"""Zeros after the nodes of a wire, so that sums of seven terms may run over the end."""
TAPS = 7
"""Terms of the interior stencil that are summed in one pass."""


@njit(cache=True, fastmath={"contract"})
def _sum(out: Array, a: Array, t: Array, count: int) -> None:
    """Add seven terms of the interior stencil to `count` nodes."""
    t0, t1, t2, t3, t4, t5, t6 = t[0], t[1], t[2], t[3], t[4], t[5], t[6]
    for j in range(count):
        out[j] += (
            t0 * a[j] + t1 * a[j + 1] + t2 * a[j + 2] + t3 * a[j + 3] + t4 * a[j + 4] + t5 * a[j + 5] + t6 * a[j + 6]
        )


@njit(cache=True, fastmath={"contract"})
def propagate(inner: Array, reach: int, nodes: int, w: Array, now: int, wire: int) -> None:
    """Apply the interior stencil of one wire to all nodes that it can update; the others are set to zero."""
    slots = w.shape[0]
    new = w[(now + 1) % slots, wire]
    new[:] = 0.0
    count = nodes - 2 * reach
    out = new[reach : reach + count]
    for level in range(inner.shape[1]):
        old = w[(now - level) % slots, wire]
        for first in range(0, 2 * reach + 1, TAPS):
            _sum(out, old[first:], inner[wire, level, first : first + TAPS], count)


@njit(cache=True, fastmath={"contract"})
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
