"""One step of the catenary-fixed line, compiled: free wires, links, contact, all at the new instant.

    wires     A q* = M (...)                               the step without links and contact (`wires`)
    links     (C + 1/K) lambda = g . q* - ref + d F        lambda = -F_s for slack droppers (`links`)
    contact   w(k+1) = w_free + C_w F,  d_j = g_j . h_p    h_p: column of the contact point, from one table
    result    q = q* - sum_j h_j lambda_j + h_p F

The slack state belongs to the step: after the solve every dropper is asked whether it is taut; where one disagrees the
small band matrix is factored again from its row on, until all agree. The contact force is settled within that loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.elements import shape_functions
from catenary_model.reference import wires
from catenary_model.reference.links import Links
from catenary_model.reference.wires import BETA, GAMMA, TS, Wires
from phil_base.kernels import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# entries of State.counter
STEP, SLACK, ITERATIONS, UNSETTLED, ELEMENT, FIRST_NEAR, LAST_NEAR = range(7)
# entries of State.point
ZETA, W_STATIC, V_STATIC, W_FREE, COMPLIANCE, FORCE, HEIGHT, VELOCITY = range(8)


class State(NamedTuple):
    """All that a step changes; every array is allocated once."""

    q: Array
    """Deviation from the equilibrium, velocity, acceleration, (3, 4, nodes)."""
    acting: Ints
    """1 for a link that acts, 0 for a slack dropper, (links,)."""
    counter: Ints
    """Whole numbers, see STEP, ..."""
    point: Array
    """The contact point, see ZETA, ..."""
    z: Array
    """Work, (4, nodes)."""
    y: Array
    """Work: displacements of the new instant, (4, nodes)."""
    free: Array
    """Elongations g . q* of the links without forces, and their ref, m, (2, links)."""
    near: Array
    """d_j, m/N, (links,): zero but for links around the contact point."""
    force: Array
    """lambda = force[0] + force[1] F, N and 1; lambda itself in force[2]; (3, links)."""
    lower: Array
    """Factors L D L^T of C + 1/K, D in the last column, (links, band + 1)."""
    psi: Array
    """Shape functions at the contact point, their slopes, column h_p of a station; (3, 4)."""


def state(nodes: int, links: Links) -> State:
    """Allocate the state of rest."""
    n, band = links.coupling.shape[0], links.coupling.shape[1]
    acting = np.where((links.one_sided == 1) & (links.rest[:, 0] <= 0.0), 0, 1).astype(np.int64)
    return State(
        q=np.zeros((3, 4, nodes)),
        acting=acting,
        counter=np.zeros(8, dtype=np.int64),
        point=np.zeros(8),
        z=np.zeros((4, nodes)),
        y=np.zeros((4, nodes)),
        free=np.zeros((2, n)),
        near=np.zeros(n),
        force=np.zeros((3, n)),
        lower=np.zeros((n, band)),
        psi=np.zeros((3, 4)),
    )


@njit(cache=True, fastmath=False)
def elongation(c: Links, j: int, q: Array) -> float:
    """Return g_j . q, m; q is (4, nodes)."""
    e = c.element[j]
    total = 0.0
    for f in range(c.fields[j, 0], c.fields[j, 1]):
        total += c.g[j, f, 0] * q[f, e] + c.g[j, f, 1] * q[f, e + 1]
    return total


@njit(cache=True, fastmath=False)
def free_step(w: Wires, c: Links, s: State) -> None:
    """Step the free wires into y, read the links' elongations and what they remember."""
    ts, beta, gamma = w.real[TS], w.real[BETA], w.real[GAMMA]
    wires.inertia(w, s.q, s.z, s.y)
    wires.solve(w, s.y)
    for j in range(c.element.size):
        s.free[0, j] = elongation(c, j, s.y)
        ref = c.rest[j, 2]
        if c.has_memory[j] == 1:
            v, a = elongation(c, j, s.q[1]), elongation(c, j, s.q[2])
            e = elongation(c, j, s.q[0]) + ts * v + ts * ts * (0.5 - beta) * a
            ref += c.memory[j, 0] * e + c.memory[j, 1] * (v + ts * (1.0 - gamma) * a)
        s.free[1, j] = ref


@njit(cache=True, fastmath=False)
def factor(c: Links, s: State, first: int) -> None:
    """Factor C + 1/K of the acting links from row `first` on; a slack dropper's row is that of the identity."""
    n, band = c.coupling.shape[0], c.coupling.shape[1] - 1
    L = s.lower
    for i in range(first, n):
        for k in range(max(0, i - band), i + 1):
            value = c.coupling[i, band - i + k] if s.acting[i] == 1 and s.acting[k] == 1 else 0.0
            if k == i:
                value += c.flexibility[i] if s.acting[i] == 1 else 1.0
            for m in range(max(0, i - band), k):
                value -= L[i, band - i + m] * L[k, band - k + m] * L[m, band]
            L[i, band - i + k] = value / L[k, band] if k < i else value


@njit(cache=True, fastmath=False)
def _solve_links(s: State, x: Array, first: int) -> None:
    """Solve with the factors in place; x is zero before `first`."""
    n, band = s.lower.shape[0], s.lower.shape[1] - 1
    L = s.lower
    for i in range(first, n):
        value = x[i]
        for k in range(max(first, i - band), i):
            value -= L[i, band - i + k] * x[k]
        x[i] = value
    for i in range(first, n):
        x[i] /= L[i, band]
    for i in range(n - 1, -1, -1):
        value = x[i]
        for k in range(i + 1, min(n, i + band + 1)):
            value -= L[k, band - k + i] * x[k]
        x[i] = value


@njit(cache=True, fastmath=False)
def _near(c: Links, s: State, zeta: float, start: float, h: float) -> None:
    """Place the contact point at track position zeta (m): shape functions, and d_j of the links around it."""
    e = int((zeta - start) / h)
    psi = s.psi[0]
    xi = (zeta - start) / h - e
    shape_functions(xi, h, psi)
    s.psi[1, 0] = 6.0 * (xi * xi - xi) / h
    s.psi[1, 1] = 1.0 - 4.0 * xi + 3.0 * xi * xi
    s.psi[1, 2] = -s.psi[1, 0]
    s.psi[1, 3] = 3.0 * xi * xi - 2.0 * xi
    for j in range(s.counter[FIRST_NEAR], s.counter[LAST_NEAR]):
        s.near[j] = 0.0
    reach = c.influence.shape[2] // 2
    n = c.element.size
    first = s.counter[FIRST_NEAR] if e >= s.counter[ELEMENT] else 0
    while first < n and c.element[first] < e - reach:
        first += 1
    last = first
    while last < n and c.element[last] <= e + reach:
        if c.fields[last, 1] == 4:
            s.near[last] = _answer(c, s, e, c.element[last], c.g[last, 2], c.g[last, 3])
        last += 1
    s.counter[ELEMENT], s.counter[FIRST_NEAR], s.counter[LAST_NEAR] = e, first, last


@njit(cache=True, fastmath=False)
def _answer(c: Links, s: State, e: int, at: int, gw: Array, gp: Array) -> float:
    """Return g . h_p for g on the contact wire's two stations of element `at`, the contact point in element e; m/N."""
    reach = c.influence.shape[2] // 2
    total = 0.0
    for station in range(2):
        for source in range(2):
            o = at + station - (e + source) + reach
            if 0 <= o <= 2 * reach:
                for moment in range(2):
                    share = s.psi[0, 2 * source + moment]
                    total += share * (gw[station] * c.influence[moment, 0, o] + gp[station] * c.influence[moment, 1, o])
    return total


@njit(cache=True, fastmath=False)
def place(w: Wires, c: Links, s: State, static: Array, zeta: float, speed: float, start: float, h: float) -> None:
    """Put the contact point at zeta (m) and read the static wire there; static is (2, nodes), w and phi."""
    _near(c, s, zeta, start, h)
    e, psi, slope = s.counter[ELEMENT], s.psi[0], s.psi[1]
    height, rate = 0.0, 0.0
    for r in range(2):
        for j in range(2):
            height += psi[2 * j + r] * static[r, e + j]
            rate += slope[2 * j + r] * static[r, e + j]
    s.point[ZETA], s.point[W_STATIC], s.point[V_STATIC] = zeta, height, speed * rate


@njit(cache=True, fastmath=False)
def respond(c: Links, s: State) -> None:
    """Find the links' forces and w_free, C_w of the contact point for the present slack state, affine in F."""
    n = c.element.size
    band = c.coupling.shape[1] - 1
    lam, unit = s.force[0], s.force[1]
    for j in range(n):
        lam[j] = s.free[0, j] - s.free[1, j] if s.acting[j] == 1 else -c.rest[j, 1]
        unit[j] = s.near[j] if s.acting[j] == 1 else 0.0
    for i in range(n):
        if s.acting[i] == 0 and lam[i] != 0.0:
            for k in range(max(0, i - band), min(n, i + band + 1)):
                if s.acting[k] == 1:
                    lam[k] -= lam[i] * (c.coupling[i, band - i + k] if k < i else c.coupling[k, band - k + i])
    _solve_links(s, lam, 0)
    _solve_links(s, unit, s.counter[FIRST_NEAR])
    e, psi = s.counter[ELEMENT], s.psi[0]
    height = s.point[W_STATIC]
    for j in range(2):
        height += psi[2 * j] * s.y[2, e + j] + psi[2 * j + 1] * s.y[3, e + j]
    s.psi[2, 0], s.psi[2, 1], s.psi[2, 2], s.psi[2, 3] = psi[0], psi[2], psi[1], psi[3]
    compliance = _answer(c, s, e, e, s.psi[2, 0:2], s.psi[2, 2:4])
    for j in range(s.counter[FIRST_NEAR], s.counter[LAST_NEAR]):
        height -= s.near[j] * lam[j]
        compliance -= s.near[j] * unit[j]
    s.point[W_FREE], s.point[COMPLIANCE] = height, compliance


@njit(cache=True, fastmath=False)
def recheck(c: Links, s: State, contact: float) -> int:
    """Flip the droppers that contradict the contact force (N); return the first row concerned, or -1."""
    n, band = c.coupling.shape[0], c.coupling.shape[1] - 1
    total = s.force[2]
    for j in range(n):
        total[j] = s.force[0, j] + s.force[1, j] * contact
    first = -1
    slack = 0
    for j in range(n):
        if c.one_sided[j] == 0:
            continue
        if s.acting[j] == 1:
            taut = 1 if total[j] + c.rest[j, 1] > 0.0 else 0
        else:
            stretch = c.rest[j, 0] + s.free[0, j] + s.near[j] * contact
            for k in range(max(0, j - band), min(n, j + band + 1)):
                stretch -= total[k] * (c.coupling[j, band - j + k] if k <= j else c.coupling[k, band - k + j])
            taut = 1 if stretch > 0.0 else 0
        if taut != s.acting[j]:
            s.acting[j] = taut
            if first < 0:
                first = j
        slack += 1 - taut
    s.counter[SLACK] = slack
    return first


@njit(cache=True, fastmath=False)
def take(w: Wires, c: Links, s: State, contact: float, speed: float) -> None:
    """Add what links and contact force (N) do to the free wires' step, make it the state, read the contact point."""
    width = c.column.shape[2]
    for j in range(c.element.size):
        force = s.force[2, j]
        if force != 0.0:
            first = c.first[j]
            for f in range(c.fields[j, 0], c.fields[j, 1]):
                y, column = s.y[f, first : first + width], c.column[j, f]
                for i in range(width):
                    y[i] -= force * column[i]
    e = s.counter[ELEMENT]
    if contact != 0.0:
        reach = c.influence.shape[2] // 2
        for j in range(4):
            share = contact * s.psi[0, j]
            first = e + j // 2 - reach
            for f in range(2):
                y, column = s.y[2 + f, first : first + 2 * reach + 1], c.influence[j % 2, f]
                for i in range(2 * reach + 1):
                    y[i] += share * column[i]
    wires.take(w, s.q, s.y)
    height, velocity = s.point[W_STATIC], s.point[V_STATIC]
    for j in range(2):
        for r in range(2):
            height += s.psi[0, 2 * j + r] * s.q[0, 2 + r, e + j]
            velocity += s.psi[0, 2 * j + r] * s.q[1, 2 + r, e + j] + speed * s.psi[1, 2 * j + r] * s.q[0, 2 + r, e + j]
    s.point[HEIGHT], s.point[VELOCITY], s.point[FORCE] = height, velocity, contact
