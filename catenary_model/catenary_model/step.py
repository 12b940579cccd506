"""One Newmark step of the moving catenary, compiled (thesis 3.1.3), with the slack state iterated to consistency.

What is integrated is the deviation q from the static equilibrium (see `model`). Per step, with everything at the new
instant t_(k+1), droppers and masts included:

    K_DM q'' = F - D [q' + Ts (1 - gamma) q''] - K [q + Ts q' + Ts^2 (1/2 - beta) q'']      (3.21) to (3.23)
    K_DM = M + gamma Ts D + beta Ts^2 K                                                      (3.22)

A spring (dropper, mast, steady arm) that sits inside an element has the elongation g . q, g from the shape functions,
so it adds k g g^T to K, within the band. A dropper that is slack for the assumed state drops out of K and leaves
-F_s, its lost static force. After the solve each dropper is asked whether it is taut; if one disagrees, the matrix is
factored again from the first station concerned on (row-wise elimination: the rows before it stay as they are).

No allocation, no LAPACK: the LU needs no pivoting, because K_DM is dominated by the mass matrix.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from catenary_model.elements import shape_functions

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

PAD = 4
"""Zeros before and after every nodal vector, so that end rows need no special case."""

# entries of Constants.real
TS, BETA, GAMMA, SPEED, START, HALF, H, FADING, SPAN, K_DROPPER, K_MAST, K_ARM = range(12)
# entries of Constants.whole
STATIONS, MAX_ITERATIONS, SEGMENT_FIRST, SEGMENT_STATIONS = range(4)
# entries of State.counter
CYCLE, FIRST_DROPPER, DROPPERS, SLACK, ITERATIONS, UNSETTLED, NEXT_DROPPER, SPRINGS = range(8)
# entries of State.point
W_CAT, V_CAT, A_CAT, F_CAT, ZETA = range(5)
# columns of State.spring
POSITION, FADE, STIFFNESS, LOAD = range(4)


class Constants(NamedTuple):
    """What does not change during a ride."""

    real: Array
    """Numbers, see TS, BETA, ..."""
    whole: Ints
    """Whole numbers, see STATIONS, ..."""
    damping: Array
    """Compact D of the wires, (n, 6)."""
    stiffness: Array
    """Compact K of the wires, (n, 6)."""
    newmark: Array
    """Compact K_DM of the wires, (n, 6)."""
    dropper: Array
    """Per dropper of a span: position (m), static elongation (m), static force (N); (droppers, 3)."""
    static: Array
    """Static shape of the contact wire on a node, (samples + 1, 6), see `lattice.static_table`."""
    segment: Array
    """M, D, K of the reduced model as 2-station blocks, (3, 2 segment stations, 6), see `reduced`."""


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    q: Array
    """Deviation, velocity, acceleration of all nodes with PAD zeros on either side, (3, n + 2 PAD)."""
    taut: Ints
    """1 if the dropper is taut; ring over the droppers' running number."""
    counter: Ints
    """Whole numbers, see CYCLE, ..."""
    point: Array
    """Motion of the contact point, see W_CAT, ..."""
    segment: Array
    """q, q', q'' and f_held of the reduced model, (4, 2 segment stations)."""
    external: Array
    """Further nodal forces at the new instant, N and N m, (n,); zero unless the caller sets them."""
    predicted: Array
    """Work: predicted q and q' with padding, (2, n + 2 PAD)."""
    lu: Array
    """Work: factors of K_DM, (n, 16); column 7 is the diagonal, column 15 stays zero."""
    rhs: Array
    """Work: right side before droppers and masts; (2, n): as given, as eliminated."""
    spring: Array
    """Springs in the domain, droppers first: position (m), fade, stiffness (N/m), constant force (N)."""
    spring_g: Array
    """Their elongation per degree of freedom of their element's two stations, (springs, 8)."""
    spring_at: Ints
    """Element that they sit in and, for droppers, slot in `taut` and number within the span, (springs, 3)."""


@njit(cache=True, fastmath=False)
def _place(c: Constants, s: State, i: int, x: float) -> None:
    """Put spring i at x (m, relative to the pantograph): element, shape functions (left in g[0:4]), fade."""
    h = c.real[H]
    last = c.whole[STATIONS] - 2
    at = (x + c.real[HALF]) / h
    e = min(max(int(at), 0), last)
    shape_functions(at - e, h, s.spring_g[i])
    s.spring_at[i, 0] = e
    s.spring[i, POSITION] = x
    s.spring[i, FADE] = min(1.0, (c.real[HALF] - abs(x)) / c.real[FADING]) if c.real[FADING] > 0.0 else 1.0


@njit(cache=True, fastmath=False)
def _spread(s: State, i: int, carrier: float, contact: float) -> None:
    """Turn the four shape functions in g[0:4] into the elongation of a spring between the wires, g[0:8]."""
    g = s.spring_g[i]
    n0, n1, n2, n3 = g[0], g[1], g[2], g[3]
    g[0], g[1], g[2], g[3] = carrier * n0, carrier * n1, contact * n0, contact * n1
    g[4], g[5], g[6], g[7] = carrier * n2, carrier * n3, contact * n2, contact * n3


@njit(cache=True, fastmath=False)
def _collect_springs(c: Constants, s: State, zeta: float) -> None:
    """List droppers, masts and steady arms of the domain around track position zeta (m)."""
    real, counter = c.real, s.counter
    n_d = c.dropper.shape[0]
    left, right = zeta - real[HALF], zeta + real[HALF]
    i = 0
    if n_d > 0:
        first = counter[FIRST_DROPPER]
        while (first // n_d) * real[SPAN] + c.dropper[first % n_d, 0] <= left:
            first += 1
        counter[FIRST_DROPPER] = first
        j = first
        while True:
            at = (j // n_d) * real[SPAN] + c.dropper[j % n_d, 0]
            if at >= right:
                break
            slot = j % s.taut.size
            if j >= counter[NEXT_DROPPER]:
                s.taut[slot] = 1 if c.dropper[j % n_d, 1] > 0.0 else 0
                counter[NEXT_DROPPER] = j + 1
            _place(c, s, i, at - zeta)
            _spread(s, i, 1.0, -1.0)
            s.spring_at[i, 1] = slot
            s.spring_at[i, 2] = j % n_d
            i += 1
            j += 1
    counter[DROPPERS] = i
    mast = int(np.floor(left / real[SPAN])) + 1
    while mast * real[SPAN] < right:
        x = mast * real[SPAN] - zeta
        _place(c, s, i, x)
        _spread(s, i, 1.0, 0.0)
        s.spring[i, STIFFNESS] = real[K_MAST] * s.spring[i, FADE]
        s.spring[i, LOAD] = 0.0
        i += 1
        if real[K_ARM] > 0.0:
            _place(c, s, i, x)
            _spread(s, i, 0.0, 1.0)
            s.spring[i, STIFFNESS] = real[K_ARM] * s.spring[i, FADE]
            s.spring[i, LOAD] = 0.0
            i += 1
        mast += 1
    counter[SPRINGS] = i


@njit(cache=True, fastmath=False)
def _predict(c: Constants, s: State) -> None:
    """Newmark's predictors (3.19, 3.20) and the wires' part of the right side (3.23)."""
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    n = s.rhs.shape[1]
    q, v, a = s.q[0], s.q[1], s.q[2]
    qp, vp = s.predicted[0], s.predicted[1]
    half, rest = ts * ts * (0.5 - beta), ts * (1.0 - gamma)
    for i in range(PAD, n + PAD):
        qp[i] = q[i] + ts * v[i] + half * a[i]
        vp[i] = v[i] + rest * a[i]
    for i in range(n):
        o = i - (i & 1)  # with the padding: the own wire's w one station back
        K, D = c.stiffness[i], c.damping[i]
        s.rhs[0, i] = (
            s.external[i]
            - (
                K[0] * qp[o]
                + K[1] * qp[o + 1]
                + K[2] * qp[o + 4]
                + K[3] * qp[o + 5]
                + K[4] * qp[o + 8]
                + K[5] * qp[o + 9]
            )
            - (
                D[0] * vp[o]
                + D[1] * vp[o + 1]
                + D[2] * vp[o + 4]
                + D[3] * vp[o + 5]
                + D[4] * vp[o + 8]
                + D[5] * vp[o + 9]
            )
        )


@njit(cache=True, fastmath=False)
def _assemble(c: Constants, s: State, first: int) -> None:
    """Write K_DM and the right side for the present slack state, rows `first` (start of a station) and on."""
    n = s.rhs.shape[1]
    lu, y = s.lu, s.rhs[1]
    for i in range(first, n):
        for j in range(16):
            lu[i, j] = 0.0
        o = 3 - (i & 1)
        for j in range(3):
            lu[i, o + 4 * j] = c.newmark[i, 2 * j]
            lu[i, o + 4 * j + 1] = c.newmark[i, 2 * j + 1]
        y[i] = s.rhs[0, i]
    scale = c.real[BETA] * c.real[TS] * c.real[TS]
    qp = s.predicted[0]
    for i in range(s.counter[SPRINGS]):
        row = 4 * s.spring_at[i, 0]
        if row + 8 <= first:
            continue
        g = s.spring_g[i]
        k, force = s.spring[i, STIFFNESS], s.spring[i, LOAD]
        for j in range(8):
            force += k * g[j] * qp[PAD + row + j]
        k *= scale
        for j in range(8):
            if row + j < first:
                continue
            y[row + j] -= force * g[j]
            if k != 0.0:
                for m in range(8):
                    lu[row + j, 7 + m - j] += k * g[j] * g[m]


@njit(cache=True, fastmath=False)
def _solve(s: State, first: int, a: Array) -> None:
    """Eliminate rows `first` and on of K_DM a = y, then substitute back over all rows; a has the padding."""
    lu, y = s.lu, s.rhs[1]
    n = y.size
    for i in range(first, n):
        row = lu[i]
        sum_y = y[i]
        for k in range(max(0, i - 7), i):
            o = k - i + 7
            if row[o] != 0.0:
                pivot = lu[k]
                factor = row[o] * pivot[7]
                row[o] = factor
                for m in range(1, 9):
                    row[o + m] -= factor * pivot[7 + m]
                sum_y -= factor * y[k]
        row[7] = 1.0 / row[7]
        y[i] = sum_y
    for i in range(n - 1, -1, -1):
        row = lu[i]
        value = y[i]
        for m in range(1, min(8, n - i)):
            value -= row[7 + m] * a[PAD + i + m]
        a[PAD + i] = value * row[7]


@njit(cache=True, fastmath=False)
def _dropper_state(c: Constants, s: State, i: int) -> None:
    """Set stiffness and constant force of dropper i from its slack state; static force is what it deviates from."""
    d = s.spring_at[i, 2]
    fade = s.spring[i, FADE]
    if s.taut[s.spring_at[i, 1]] == 1:
        s.spring[i, STIFFNESS] = fade * c.real[K_DROPPER]
        s.spring[i, LOAD] = fade * (c.real[K_DROPPER] * c.dropper[d, 1] - c.dropper[d, 2])
    else:
        s.spring[i, STIFFNESS] = 0.0
        s.spring[i, LOAD] = -fade * c.dropper[d, 2]


@njit(cache=True, fastmath=False)
def elongation(s: State, i: int, q: Array) -> float:
    """Elongation g . q of spring i against rest, m; q has the padding."""
    total = 0.0
    base = PAD + 4 * s.spring_at[i, 0]
    for j in range(8):
        total += s.spring_g[i, j] * q[base + j]
    return total


@njit(cache=True, fastmath=False)
def _recheck(c: Constants, s: State) -> int:
    """Flip the droppers whose state contradicts the solution; return the first row concerned, or -1."""
    scale = c.real[BETA] * c.real[TS] * c.real[TS]
    a, qp = s.q[2], s.predicted[0]
    first = -1
    slack = 0
    for i in range(s.counter[DROPPERS]):
        slot = s.spring_at[i, 1]
        stretch = c.dropper[s.spring_at[i, 2], 1] + elongation(s, i, qp) + scale * elongation(s, i, a)
        taut = 1 if stretch > 0.0 else 0
        if taut != s.taut[slot]:
            s.taut[slot] = taut
            _dropper_state(c, s, i)
            if first < 0:
                first = 4 * s.spring_at[i, 0]
        slack += 1 - taut
    s.counter[SLACK] = slack
    return first


@njit(cache=True, fastmath=False)
def static_at(c: Constants, zeta: float, out: Array) -> None:
    """Write w, w', w'', phi, phi', phi'' of the static contact wire at track position zeta (m) into out, (6,)."""
    span = c.real[SPAN]
    at = (zeta - span * np.floor(zeta / span)) / span * (c.static.shape[0] - 1)
    i = min(int(at), c.static.shape[0] - 2)
    r = at - i
    for j in range(6):
        out[j] = c.static[i, j] + r * (c.static[i + 1, j] - c.static[i, j])


@njit(cache=True, fastmath=False)
def observe(c: Constants, s: State, f_cat: float) -> None:
    """Fill `point` and `segment` for the present state: static shape plus deviation, and f_held (3.41)."""
    zeta = c.real[START] + c.real[SPEED] * (c.real[TS] * s.counter[CYCLE])
    v, h = c.real[SPEED], c.real[H]
    first, stations = c.whole[SEGMENT_FIRST], c.whole[SEGMENT_STATIONS]
    middle = stations // 2
    seg = s.segment
    work = s.spring_g[-1]  # the last row of the list is never a spring
    for j in range(stations):
        static_at(c, zeta + (j - middle) * h, work)
        rate = 1.0
        for d in range(3):
            base = PAD + 4 * (first + j) + 2
            seg[d, 2 * j] = rate * work[d] + s.q[d, base]
            seg[d, 2 * j + 1] = rate * work[3 + d] + s.q[d, base + 1]
            rate *= v
    for i in range(2 * stations):
        total = 0.0
        o = i - (i & 1) - 2
        for j in range(6):
            if 0 <= o + j < 2 * stations:
                total += (
                    c.segment[0, i, j] * seg[2, o + j]
                    + c.segment[1, i, j] * seg[1, o + j]
                    + c.segment[2, i, j] * seg[0, o + j]
                )
        seg[3, i] = total
    seg[3, 2 * middle] -= f_cat
    s.point[W_CAT] = seg[0, 2 * middle]
    s.point[V_CAT] = seg[1, 2 * middle]
    s.point[A_CAT] = seg[2, 2 * middle]
    s.point[F_CAT] = f_cat
    s.point[ZETA] = zeta


@njit(cache=True, fastmath=False)
def place_springs(c: Constants, s: State) -> None:
    """List the springs for the present instant without a step, as a start does."""
    _collect_springs(c, s, c.real[START] + c.real[SPEED] * (c.real[TS] * s.counter[CYCLE]))
    for i in range(s.counter[DROPPERS]):
        _dropper_state(c, s, i)


@njit(cache=True, fastmath=False)
def advance(c: Constants, s: State, f_cat: float) -> None:
    """Step from t_k to t_(k+1) with the contact force f_cat (N) as the force of the new instant."""
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    s.counter[CYCLE] += 1
    place_springs(c, s)
    _predict(c, s)
    s.rhs[0, 2 * (c.whole[STATIONS] - 1) + 2] += f_cat  # displacement of the contact wire at the middle station
    a = s.q[2]
    first = 0
    iterations = 0
    while True:
        _assemble(c, s, first)
        _solve(s, first, a)
        iterations += 1
        first = _recheck(c, s)
        if first < 0:
            break
        if iterations >= c.whole[MAX_ITERATIONS]:
            s.counter[UNSETTLED] += 1
            break
    s.counter[ITERATIONS] = iterations
    n = s.rhs.shape[1]
    for i in range(PAD, n + PAD):
        s.q[0, i] = s.predicted[0, i] + beta * ts * ts * a[i]
        s.q[1, i] = s.predicted[1, i] + gamma * ts * a[i]
    observe(c, s, f_cat)
