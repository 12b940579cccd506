"""Both wires without anything that touches them: one Newmark step, compiled (see `factor`).

The same step with the acceleration as its unknown, as (3.19) to (3.23) have it: see `catenary_model.wires`.

Fields are rows of (4, nodes) arrays: w_ca, phi_ca, w_co, phi_co. The passes over the nodes either vectorise (no node
needs another one's result) or run both wires side by side, so that neither waits for the other's recursion.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line
from catenary_model.reference.factor import factor, mass_stencil, shift
from catenary_model.reference.mesh import TrackMesh
from phil_base.kernels import njit

Array = NDArray[np.float64]

TS, BETA, GAMMA = range(3)
"""Entries of `Wires.real`."""


class Wires(NamedTuple):
    """Constants of both wires; leading index 0 carrier, 1 contact wire."""

    real: Array
    """Numbers, see TS, ..."""
    combine: Array
    """s q_p - beta Ts^2 d v_p as a combination of q, q', q'', (2, 3)."""
    mass: Array
    """`factor.mass_stencil`, (2, 6)."""
    forward: Array
    """(2, head, 4); the wire whose head is shorter is continued with its constant."""
    inverse: Array
    backward: Array
    last: Array
    """(2, 4)."""
    shift: Array
    """r as a combination of q, q', q'', see `factor`, (2, 3); zero without damping in proportion to stiffness."""


def wires(line: Line, mesh: TrackMesh, ts: float, beta: float, gamma: float) -> Wires:
    """Prepare both wires for steps of ts (s)."""
    pair = (line.carrier, line.contact)
    factors = [factor(wire, mesh.h, mesh.nodes, ts, beta, gamma) for wire in pair]
    head = max(f.forward.shape[0] for f in factors)

    def both(name: str) -> Array:
        arrays = [getattr(f, name) for f in factors]
        return np.array([np.concatenate([a, np.repeat(a[-1:], head - len(a), axis=0)]) for a in arrays])

    combine = np.zeros((2, 3))
    for row, wire in zip(combine, pair, strict=True):
        d = wire.damping / wire.mass_per_length
        s, damped = 1.0 + gamma * ts * d, beta * ts**2 * d
        row[:] = s, s * ts - damped, s * ts**2 * (0.5 - beta) - damped * ts * (1.0 - gamma)
        row += s * shift(wire, ts, beta, gamma)
    return Wires(
        real=np.array([ts, beta, gamma]),
        combine=combine,
        mass=np.array([mass_stencil(wire, mesh.h) for wire in pair]),
        forward=both("forward"),
        inverse=both("inverse"),
        backward=both("backward"),
        last=np.array([f.last for f in factors]),
        shift=np.array([shift(wire, ts, beta, gamma) for wire in pair]),
    )


@njit(cache=True, fastmath=False)
def inertia(c: Wires, q: Array, z: Array, y: Array) -> None:
    """Write M (s q_p - beta Ts^2 d v_p) into y; q is (3, 4, nodes) with derivatives, z work, both (4, nodes)."""
    n = z.shape[1]
    for f in range(4):
        c0, c1, c2 = c.combine[f // 2, 0], c.combine[f // 2, 1], c.combine[f // 2, 2]
        q0, q1, q2, zf = q[0, f], q[1, f], q[2, f], z[f]
        for i in range(n):
            zf[i] = c0 * q0[i] + c1 * q1[i] + c2 * q2[i]
    for wire in range(2):
        w, p, yw, yp = z[2 * wire], z[2 * wire + 1], y[2 * wire], y[2 * wire + 1]
        m = c.mass[wire]
        m0, m1, m2, m3, m4, m5 = m[0], m[1], m[2], m[3], m[4], m[5]
        for i in range(1, n - 1):
            yw[i] = m0 * w[i] + m1 * (w[i - 1] + w[i + 1]) + m2 * (p[i - 1] - p[i + 1])
            yp[i] = m3 * p[i] + m2 * (w[i + 1] - w[i - 1]) - m4 * (p[i - 1] + p[i + 1])
        e = n - 1
        yw[0] = 0.5 * m0 * w[0] + m5 * p[0] + m1 * w[1] - m2 * p[1]
        yp[0] = m5 * w[0] + 0.5 * m3 * p[0] + m2 * w[1] - m4 * p[1]
        yw[e] = 0.5 * m0 * w[e] - m5 * p[e] + m1 * w[e - 1] + m2 * p[e - 1]
        yp[e] = -m5 * w[e] + 0.5 * m3 * p[e] - m2 * w[e - 1] - m4 * p[e - 1]


@njit(cache=True, fastmath=False)
def solve(c: Wires, y: Array) -> None:
    """Solve A x = y for both wires in place, (4, nodes)."""
    n = y.shape[1]
    head = c.forward.shape[1]
    y0, y1, y2, y3 = y[0], y[1], y[2], y[3]
    x0, x1, x2, x3 = y0[0], y1[0], y2[0], y3[0]
    for i in range(1, head):
        a, b = c.forward[0, i - 1], c.forward[1, i - 1]
        t0 = y0[i] - a[0] * x0 - a[1] * x1
        t1 = y1[i] - a[2] * x0 - a[3] * x1
        t2 = y2[i] - b[0] * x2 - b[1] * x3
        t3 = y3[i] - b[2] * x2 - b[3] * x3
        x0, x1, x2, x3 = t0, t1, t2, t3
        y0[i], y1[i], y2[i], y3[i] = x0, x1, x2, x3
    a, b = c.forward[0, head - 1], c.forward[1, head - 1]
    a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
    b0, b1, b2, b3 = b[0], b[1], b[2], b[3]
    for i in range(head, n):
        t0 = y0[i] - a0 * x0 - a1 * x1
        t1 = y1[i] - a2 * x0 - a3 * x1
        t2 = y2[i] - b0 * x2 - b1 * x3
        t3 = y3[i] - b2 * x2 - b3 * x3
        x0, x1, x2, x3 = t0, t1, t2, t3
        y0[i], y1[i], y2[i], y3[i] = x0, x1, x2, x3
    e, f = c.last[0], c.last[1]
    t0, t1 = e[0] * x0 + e[1] * x1, e[2] * x0 + e[3] * x1
    t2, t3 = f[0] * x2 + f[1] * x3, f[2] * x2 + f[3] * x3
    x0, x1, x2, x3 = t0, t1, t2, t3
    y0[n - 1], y1[n - 1], y2[n - 1], y3[n - 1] = x0, x1, x2, x3
    a, b, e, f = c.backward[0, head - 1], c.backward[1, head - 1], c.inverse[0, head - 1], c.inverse[1, head - 1]
    a0, a1, a2, a3 = a[0], a[1], a[2], a[3]
    b0, b1, b2, b3 = b[0], b[1], b[2], b[3]
    e0, e1, e3 = e[0], 0.5 * (e[1] + e[2]), e[3]
    f0, f1, f3 = f[0], 0.5 * (f[1] + f[2]), f[3]
    for i in range(n - 2, head - 2, -1):
        t0 = (e0 * y0[i] + e1 * y1[i]) - a0 * x0 - a1 * x1
        t1 = (e1 * y0[i] + e3 * y1[i]) - a2 * x0 - a3 * x1
        t2 = (f0 * y2[i] + f1 * y3[i]) - b0 * x2 - b1 * x3
        t3 = (f1 * y2[i] + f3 * y3[i]) - b2 * x2 - b3 * x3
        x0, x1, x2, x3 = t0, t1, t2, t3
        y0[i], y1[i], y2[i], y3[i] = x0, x1, x2, x3
    for i in range(head - 2, -1, -1):
        a, b, e, f = c.backward[0, i], c.backward[1, i], c.inverse[0, i], c.inverse[1, i]
        t0 = (e[0] * y0[i] + e[1] * y1[i]) - a[0] * x0 - a[1] * x1
        t1 = (e[2] * y0[i] + e[3] * y1[i]) - a[2] * x0 - a[3] * x1
        t2 = (f[0] * y2[i] + f[1] * y3[i]) - b[0] * x2 - b[1] * x3
        t3 = (f[2] * y2[i] + f[3] * y3[i]) - b[2] * x2 - b[3] * x3
        x0, x1, x2, x3 = t0, t1, t2, t3
        y0[i], y1[i], y2[i], y3[i] = x0, x1, x2, x3


@njit(cache=True, fastmath=False)
def shift_back(c: Wires, q: Array, y: Array) -> None:
    """Take r off y = q + r, (4, nodes)."""
    for f in range(4):
        r = c.shift[f // 2]
        if r[0] != 0.0:
            for i in range(y.shape[1]):
                y[f, i] -= r[0] * q[0, f, i] + r[1] * q[1, f, i] + r[2] * q[2, f, i]


@njit(cache=True, fastmath=False)
def take(c: Wires, q: Array, y: Array) -> None:
    """Make y, the displacements of the new instant (4, nodes), the new state q (3, 4, nodes)."""
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    half, rest, new, per = ts * ts * (0.5 - beta), ts * (1.0 - gamma), ts * gamma, 1.0 / (beta * ts * ts)
    n = y.shape[1]
    for f in range(4):
        q0, q1, q2, yf = q[0, f], q[1, f], q[2, f], y[f]
        for i in range(n):
            a = (yf[i] - (q0[i] + ts * q1[i] + half * q2[i])) * per
            q1[i] += rest * q2[i] + new * a
            q2[i] = a
            q0[i] = yf[i]
