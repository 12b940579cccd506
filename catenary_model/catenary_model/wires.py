"""Both wires without droppers and masts: Newmark's predictors, right side and constant factors (thesis 3.1.3).

Droppers and masts taken away, carrier and contact wire do not know of each other and their step matrix

    K_DM = M + gamma Ts D + beta Ts^2 K                                                                  (3.22)

does not change in time. It is block tridiagonal, with blocks A_s, B_s, C_s of 2 x 2 (w, phi of one node) towards the
node behind, the node itself and the node ahead. It is eliminated from both ends towards the middle,

    behind:  z_s = G_s b_s - G_s A_s z_(s-1),  x_s = z_s - G_s C_s x_(s+1),  G_s = (B_s - A_s G_(s-1) C_(s-1))^-1
    ahead:   z_s = G_s b_s - G_s C_s z_(s+1),  x_s = z_s - G_s A_s x_(s-1),  G_s = (B_s - C_s G_(s+1) A_(s+1))^-1

with both couplings at the middle. G_s is multiplied into everything that makes up b beforehand, so a solve is eight
multiplications a node and wire; a sweep waits for its own last result, so two wires and two directions run side by
side in one loop. On a uniform mesh the rows become equal a dozen nodes from the ends: only those that differ are kept.

Arrays that run along the wire have the node as their last index: (.., wire, w or phi, node), wire 0 the carrier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.moving_frame import MovingFrame
from phil_base import newmark
from phil_base.kernels import njit

Array = NDArray[np.float64]

PAD = 1
"""Zeros before and after every nodal array, so that the end nodes need no special case."""
_SAME = 1e-14
"""Rows that differ by less than this share of the largest entry are taken as equal."""


@dataclass(frozen=True)
class Factors:
    """K_DM ready for `solve` and `load`, rows counted from either end inwards, side 0 behind and 1 ahead."""

    sweep: Array
    """G A and G C of the first rows and of all further ones, (side, rows, wire, 8)."""
    middle: Array
    """The same of the middle station, (wire, 8)."""
    inner: Array
    """G [K D] of all further rows behind and ahead, and of the middle station, (3, wire, row kind, 12)."""
    outer: Array
    """The same of the first rows, by rising station, (side, wire, row kind, 12, first rows)."""
    pivot: Array
    """G of every station, (wire, 4, stations)."""


def step_matrix(frame: MovingFrame, ts: float, beta: float, gamma: float) -> Array:
    """K_DM (3.22) of both wires in compact form, (4 stations, 6); ts in s."""
    return newmark.step_matrix(frame.mass, frame.damping, frame.stiffness, ts, beta, gamma)


def factor(frame: MovingFrame, ts: float, beta: float, gamma: float) -> Factors:
    """Eliminate K_DM from both ends. Raises ValueError for an even number of stations."""
    n = frame.mesh.stations
    m = n // 2
    block = step_matrix(frame, ts, beta, gamma).reshape(n, 2, 2, 3, 2).transpose(0, 1, 3, 2, 4)
    A, B, C = block[:, :, 0], block[:, :, 1], block[:, :, 2]  # station, wire, 2, 2
    G = np.zeros((n, 2, 2, 2))
    for s in range(m):
        G[s] = np.linalg.inv(B[s] - (A[s] @ G[s - 1] @ C[s - 1] if s else 0.0))
        r = n - 1 - s
        if r > m:
            G[r] = np.linalg.inv(B[r] - (C[r] @ G[r + 1] @ A[r + 1] if s else 0.0))
    G[m] = np.linalg.inv(B[m] - A[m] @ G[m - 1] @ C[m - 1] - C[m] @ G[m + 1] @ A[m + 1])
    sweep = np.concatenate([(G @ A).reshape(n, 2, 4), (G @ C).reshape(n, 2, 4)], axis=2)
    given = np.concatenate([part.reshape(n, 2, 2, 6) for part in (frame.stiffness, frame.damping)], axis=3)
    matrix = G @ given
    last = n - m - 1  # stations ahead of the middle; behind it there are m
    if last != m:
        raise ValueError(f"{n} stations: an odd number is needed")
    every = np.concatenate([sweep.reshape(n, -1), matrix.reshape(n, -1)], axis=1)
    rows = 1
    for side in (every[:m], every[:m:-1]):
        differs = (np.abs(side - side[-1]) > _SAME * np.abs(side).max()).any(axis=1)
        rows = max(rows, int(np.flatnonzero(differs).max(initial=-1)) + 2)
    rows = min(rows, m)
    ahead = np.arange(n - 1, n - 1 - rows, -1)
    first = rows - 1
    outer = np.stack([matrix[:first], matrix[n - first :]])
    return Factors(
        sweep=np.stack([sweep[:rows], sweep[ahead]]),
        middle=sweep[m],
        inner=np.stack([matrix[first], matrix[n - 1 - first], matrix[m]]),
        outer=np.ascontiguousarray(outer.transpose(0, 2, 3, 4, 1)),
        pivot=np.ascontiguousarray(G.reshape(n, 2, 4).transpose(1, 2, 0)),
    )


Chain = tuple[float, float, float, float, float, float, float, float]
"""Last results of the four sweeps that run side by side: behind then ahead, carrier then contact, (w, phi)."""


@njit(cache=True, fastmath=False, inline="always")
def _forth(a: Array, c: Array, b: Array, x: Array, state: Chain, first: int, end: int) -> Chain:
    """Sweep rows first .. end - 1 from either end to the middle: equal rows, their coefficients kept in registers."""
    n = b.shape[2]
    a0, a1, a2, a3, a4, a5, a6, a7 = a[0, 0], a[0, 1], a[0, 2], a[0, 3], a[1, 0], a[1, 1], a[1, 2], a[1, 3]
    c0, c1, c2, c3, c4, c5, c6, c7 = c[0, 4], c[0, 5], c[0, 6], c[0, 7], c[1, 4], c[1, 5], c[1, 6], c[1, 7]
    p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p = state
    for i in range(first, end):
        r = n - 1 - i
        t0 = (b[0, 0, i] - a1 * p0p) - a0 * p0w
        t1 = (b[0, 1, i] - a3 * p0p) - a2 * p0w
        t2 = (b[1, 0, i] - a5 * p1p) - a4 * p1w
        t3 = (b[1, 1, i] - a7 * p1p) - a6 * p1w
        u0 = (b[0, 0, r] - c1 * q0p) - c0 * q0w
        u1 = (b[0, 1, r] - c3 * q0p) - c2 * q0w
        u2 = (b[1, 0, r] - c5 * q1p) - c4 * q1w
        u3 = (b[1, 1, r] - c7 * q1p) - c6 * q1w
        x[0, 0, i + PAD], x[0, 1, i + PAD], x[1, 0, i + PAD], x[1, 1, i + PAD] = t0, t1, t2, t3
        x[0, 0, r + PAD], x[0, 1, r + PAD], x[1, 0, r + PAD], x[1, 1, r + PAD] = u0, u1, u2, u3
        p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p = t0, t1, t2, t3, u0, u1, u2, u3
    return p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p


@njit(cache=True, fastmath=False, inline="always")
def _back(a: Array, c: Array, x: Array, state: Chain, first: int, end: int) -> Chain:
    """Substitute rows first .. end + 1 from the middle towards either end, in place."""
    n = x.shape[2] - 2 * PAD
    a0, a1, a2, a3, a4, a5, a6, a7 = a[0, 4], a[0, 5], a[0, 6], a[0, 7], a[1, 4], a[1, 5], a[1, 6], a[1, 7]
    c0, c1, c2, c3, c4, c5, c6, c7 = c[0, 0], c[0, 1], c[0, 2], c[0, 3], c[1, 0], c[1, 1], c[1, 2], c[1, 3]
    p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p = state
    for i in range(first, end, -1):
        r = n - 1 - i
        t0 = (x[0, 0, i + PAD] - a1 * p0p) - a0 * p0w
        t1 = (x[0, 1, i + PAD] - a3 * p0p) - a2 * p0w
        t2 = (x[1, 0, i + PAD] - a5 * p1p) - a4 * p1w
        t3 = (x[1, 1, i + PAD] - a7 * p1p) - a6 * p1w
        u0 = (x[0, 0, r + PAD] - c1 * q0p) - c0 * q0w
        u1 = (x[0, 1, r + PAD] - c3 * q0p) - c2 * q0w
        u2 = (x[1, 0, r + PAD] - c5 * q1p) - c4 * q1w
        u3 = (x[1, 1, r + PAD] - c7 * q1p) - c6 * q1w
        x[0, 0, i + PAD], x[0, 1, i + PAD], x[1, 0, i + PAD], x[1, 1, i + PAD] = t0, t1, t2, t3
        x[0, 0, r + PAD], x[0, 1, r + PAD], x[1, 0, r + PAD], x[1, 1, r + PAD] = u0, u1, u2, u3
        p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p = t0, t1, t2, t3, u0, u1, u2, u3
    return p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p


@njit(cache=True, fastmath=False)
def solve(sweep: Array, middle: Array, b: Array, x: Array) -> None:
    """Solve K_DM x = b' (3.21) for both wires, G b' = b (2, 2, stations); x (2, 2, stations + 2 PAD)."""
    n = b.shape[2]
    m, inner = n // 2, sweep.shape[1] - 1
    behind, ahead = sweep[0], sweep[1]
    state = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for i in range(inner):  # rows of their own
        state = _forth(behind[i], ahead[i], b, x, state, i, i + 1)
    state = _forth(behind[inner], ahead[inner], b, x, state, inner, m)
    p0w, p0p, p1w, p1p, q0w, q0p, q1w, q1p = state
    f, g = middle[0], middle[1]
    t0 = b[0, 0, m] - (f[0] * p0w + f[1] * p0p) - (f[4] * q0w + f[5] * q0p)
    t1 = b[0, 1, m] - (f[2] * p0w + f[3] * p0p) - (f[6] * q0w + f[7] * q0p)
    t2 = b[1, 0, m] - (g[0] * p1w + g[1] * p1p) - (g[4] * q1w + g[5] * q1p)
    t3 = b[1, 1, m] - (g[2] * p1w + g[3] * p1p) - (g[6] * q1w + g[7] * q1p)
    x[0, 0, m + PAD], x[0, 1, m + PAD], x[1, 0, m + PAD], x[1, 1, m + PAD] = t0, t1, t2, t3
    state = _back(behind[inner], ahead[inner], x, (t0, t1, t2, t3, t0, t1, t2, t3), m - 1, inner - 1)
    for i in range(inner - 1, -1, -1):
        state = _back(behind[i], ahead[i], x, state, i, i - 1)


@njit(cache=True, fastmath=False)
def predict(q: Array, ts: float, beta: float, gamma: float) -> None:
    """Newmark's predictors (3.19, 3.20) in place of q and q'; q (3, 2, 2, stations + 2 PAD)."""
    half, rest = ts * ts * (0.5 - beta), ts * (1.0 - gamma)
    for wire in range(2):
        for kind in range(2):
            w, v, a = q[0, wire, kind], q[1, wire, kind], q[2, wire, kind]
            for i in range(w.size):
                w[i] += ts * v[i] + half * a[i]
                v[i] += rest * a[i]


@njit(cache=True, fastmath=False)
def _equal_rows(m: Array, w: Array, p: Array, wd: Array, pd: Array, out: Array) -> None:
    """Stations that all have the row m = (K, D): out = -K q - D q'."""
    k0, k1, k2, k3, k4, k5 = m[0], m[1], m[2], m[3], m[4], m[5]
    d0, d1, d2, d3, d4, d5 = m[6], m[7], m[8], m[9], m[10], m[11]
    for s in range(out.size):
        out[s] = -(
            (k0 * w[s] + k1 * p[s] + k2 * w[s + 1])
            + (k3 * p[s + 1] + k4 * w[s + 2] + k5 * p[s + 2])
            + (d0 * wd[s] + d1 * pd[s] + d2 * wd[s + 1])
            + (d3 * pd[s + 1] + d4 * wd[s + 2] + d5 * pd[s + 2])
        )


@njit(cache=True, fastmath=False)
def _own_rows(m: Array, w: Array, p: Array, wd: Array, pd: Array, out: Array) -> None:
    """Stations with a row each, m (12, stations): out = -K q - D q'."""
    for s in range(out.size):
        out[s] = -(
            (m[0, s] * w[s] + m[1, s] * p[s] + m[2, s] * w[s + 1])
            + (m[3, s] * p[s + 1] + m[4, s] * w[s + 2] + m[5, s] * p[s + 2])
            + (m[6, s] * wd[s] + m[7, s] * pd[s] + m[8, s] * wd[s + 1])
            + (m[9, s] * pd[s + 1] + m[10, s] * wd[s + 2] + m[11, s] * pd[s + 2])
        )


@njit(cache=True, fastmath=False)
def load(inner: Array, outer: Array, q: Array, rhs: Array) -> None:
    """Right side of (3.23) without any forces: -G (K q + D q'), (2, 2, stations).

    q (3, 2, 2, stations + 2 PAD) holds the predictors.
    """
    n = rhs.shape[2]
    m, e = n // 2, outer.shape[4]
    for wire in range(2):
        for region in range(5):
            a = 0 if region == 0 else e if region == 1 else m if region == 2 else m + 1 if region == 3 else n - e
            z = e if region == 0 else m if region == 1 else m + 1 if region == 2 else n - e if region == 3 else n
            end = z + 2 * PAD
            w, p, wd, pd = q[0, wire, 0, a:end], q[0, wire, 1, a:end], q[1, wire, 0, a:end], q[1, wire, 1, a:end]
            for kind in range(2):
                out = rhs[wire, kind, a:z]
                if region == 0 or region == 4:
                    _own_rows(outer[region // 4, wire, kind], w, p, wd, pd, out)
                else:
                    row = 2 if region == 2 else region // 2
                    _equal_rows(inner[row, wire, kind], w, p, wd, pd, out)


@njit(cache=True, fastmath=False)
def push(pivot: Array, force: Array, rhs: Array) -> None:
    """Add nodal forces (2, 2, stations) to the right side."""
    for wire in range(2):
        for kind in range(2):
            by_f, by_t, out = pivot[wire, 2 * kind], pivot[wire, 2 * kind + 1], rhs[wire, kind]
            f, t = force[wire, 0], force[wire, 1]
            for s in range(out.size):
                out[s] += by_f[s] * f[s] + by_t[s] * t[s]


@njit(cache=True, fastmath=False)
def correct(q: Array, ts: float, beta: float, gamma: float) -> None:
    """Newmark's correctors (3.19, 3.20): from the predictors to q and q' with the new q''."""
    b, g = beta * ts * ts, gamma * ts
    for wire in range(2):
        for kind in range(2):
            w, v, a = q[0, wire, kind], q[1, wire, kind], q[2, wire, kind]
            for i in range(w.size):
                w[i] += b * a[i]
                v[i] += g * a[i]


def green(factors: Factors, tolerance: float) -> tuple[Array, int, int]:
    """Columns of K_DM^-1 near the diagonal, (rows, wire, column kind, row kind, R + distance).

    They decay by a factor of about three a node, so R nodes on either side hold all that exceeds `tolerance` of the
    largest entry. Rows: one a station at the end behind, one for all stations from `first` to `last` - 1, one a
    station at the end ahead. Returns the columns, first and last.
    """
    pivot = factors.pivot
    stations = pivot.shape[2]
    b, x = np.zeros((2, 2, stations)), np.zeros((2, 2, stations + 2 * PAD))

    def column(station: int, kind: int) -> Array:
        b.fill(0.0)
        b[:, 0, station], b[:, 1, station] = pivot[:, kind, station], pivot[:, 2 + kind, station]
        solve(factors.sweep, factors.middle, b, x)
        return x[:, :, PAD:-PAD]

    middle, reach = stations // 2, 1
    for kind in range(2):
        size = np.abs(column(middle, kind))
        far = np.flatnonzero((size > tolerance * size.max(axis=2, keepdims=True)).any(axis=(0, 1)))
        reach = max(reach, int(np.abs(far - middle).max()))
    first = min(factors.sweep.shape[1] + reach, middle)
    last = max(stations - first, middle + 1)
    which = [*range(first), middle, *range(last, stations)]
    out = np.zeros((len(which), 2, 2, 2, 2 * reach + 1))
    for row, s in enumerate(which):
        low, high = max(0, s - reach), min(stations, s + reach + 1)
        for kind in range(2):
            out[row, :, kind, :, low - s + reach : high - s + reach] = column(s, kind)[:, :, low:high]
    return out, first, last
