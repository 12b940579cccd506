"""One step of the catenary-fixed line, compiled: free wires, links, contact, all at the new instant.

    wires     A q* = M (...)                               the step without links and contact (`wires`)
    links     (C + 1/K) lambda = g . q* - ref + d F        lambda = -F_s for slack droppers (`links`)
    contacts  w_p(k+1) = w_free,p + sum_q C_pq F_q,  d_jp = g_j . h_p    h_p: column of a contact point, from one table
    result    q = q* - sum_j h_j lambda_j + sum_p h_p F_p

The slack state belongs to the step: after the solve every dropper is asked whether it is taut; where one disagrees the
small band matrix is factored again from its row on, until all agree. The contact forces are settled within that loop,
see `train`.
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
STEP, SLACK, ITERATIONS, UNSETTLED = range(4)
# entries of State.where
ELEMENT, FIRST_NEAR, LAST_NEAR = range(3)
# entries of State.point
ZETA, W_STATIC, V_STATIC, W_FREE, COMPLIANCE, FORCE, HEIGHT, VELOCITY = range(8)


class State(NamedTuple):
    """All that a step changes; every array is allocated once. Contact points are counted from the front."""

    q: Array
    """Deviation from the equilibrium, velocity, acceleration, (3, 4, nodes)."""
    acting: Ints
    """1 for a link that acts, 0 for a slack dropper, (links,)."""
    counter: Ints
    """Whole numbers, see STEP, ..."""
    where: Ints
    """Elements and links around each contact point, see ELEMENT, ...; (contacts, 3)."""
    point: Array
    """The contact points, see ZETA, ...; (contacts, 8)."""
    between: Array
    """C_pq, m/N, (contacts, contacts)."""
    z: Array
    """Work, (4, nodes)."""
    y: Array
    """Work: displacements of the new instant, (4, nodes)."""
    free: Array
    """Elongations g . q* of the links without forces, and their ref, m, (2, links)."""
    near: Array
    """d_j, m/N, (contacts, links): zero but for links around the contact point."""
    force: Array
    """lambda without contact forces, and lambda itself, N, (2, links)."""
    unit: Array
    """What a unit of each contact force adds to lambda, 1, (contacts, links)."""
    lower: Array
    """Factors L D L^T of C + 1/K, D in the last column, (links, band + 1)."""
    psi: Array
    """Shape functions at each contact point, their slopes, column h_p of a station; (contacts, 3, 4)."""


def state(nodes: int, links: Links, contacts: int = 1) -> State:
    """Allocate the state of rest."""
    n, band = links.coupling.shape[0], links.coupling.shape[1]
    acting = np.where((links.one_sided == 1) & (links.rest[:, 0] <= 0.0), 0, 1).astype(np.int64)
    return State(
        q=np.zeros((3, 4, nodes)),
        acting=acting,
        counter=np.zeros(4, dtype=np.int64),
        where=np.zeros((contacts, 3), dtype=np.int64),
        point=np.zeros((contacts, 8)),
        between=np.zeros((contacts, contacts)),
        z=np.zeros((4, nodes)),
        y=np.zeros((4, nodes)),
        free=np.zeros((2, n)),
        near=np.zeros((contacts, n)),
        force=np.zeros((2, n)),
        unit=np.zeros((contacts, n)),
        lower=np.zeros((n, band)),
        psi=np.zeros((contacts, 3, 4)),
    )


def of_contacts(s: State, contacts: int) -> State:
    """Return the same state of the wires with room for so many contact points."""
    if s.point.shape[0] == contacts:
        return s
    n = s.unit.shape[1]
    return s._replace(
        where=np.zeros((contacts, 3), dtype=np.int64),
        point=np.zeros((contacts, 8)),
        between=np.zeros((contacts, contacts)),
        near=np.zeros((contacts, n)),
        unit=np.zeros((contacts, n)),
        psi=np.zeros((contacts, 3, 4)),
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
    wires.shift_back(w, s.q, s.y)
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
def _near(c: Links, s: State, p: int, zeta: float, start: float, h: float) -> None:
    """Place contact point p at track position zeta (m): shape functions, and d_j of the links around it."""
    e = int((zeta - start) / h)
    psi, slope, where, near = s.psi[p, 0], s.psi[p, 1], s.where[p], s.near[p]
    xi = (zeta - start) / h - e
    shape_functions(xi, h, psi)
    slope[0] = 6.0 * (xi * xi - xi) / h
    slope[1] = 1.0 - 4.0 * xi + 3.0 * xi * xi
    slope[2] = -slope[0]
    slope[3] = 3.0 * xi * xi - 2.0 * xi
    for j in range(where[FIRST_NEAR], where[LAST_NEAR]):
        near[j] = 0.0
    reach = c.influence.shape[2] // 2
    n = c.element.size
    first = where[FIRST_NEAR] if e >= where[ELEMENT] else 0
    while first < n and c.element[first] < e - reach:
        first += 1
    last = first
    while last < n and c.element[last] <= e + reach:
        if c.fields[last, 1] == 4:
            near[last] = _answer(c, psi, e, c.element[last], c.g[last, 2], c.g[last, 3])
        last += 1
    where[ELEMENT], where[FIRST_NEAR], where[LAST_NEAR] = e, first, last


@njit(cache=True, fastmath=False)
def _answer(c: Links, psi: Array, e: int, at: int, gw: Array, gp: Array) -> float:
    """Return g . h_p for g on the contact wire's two stations of element `at`, the contact point in element e; m/N."""
    reach = c.influence.shape[2] // 2
    total = 0.0
    for station in range(2):
        for source in range(2):
            o = at + station - (e + source) + reach
            if 0 <= o <= 2 * reach:
                for moment in range(2):
                    share = psi[2 * source + moment]
                    total += share * (gw[station] * c.influence[moment, 0, o] + gp[station] * c.influence[moment, 1, o])
    return total


@njit(cache=True, fastmath=False)
def place(c: Links, s: State, p: int, static: Array, zeta: float, speed: float, start: float, h: float) -> None:
    """Put contact point p at zeta (m) and read the static wire there; static is (2, nodes), w and phi."""
    _near(c, s, p, zeta, start, h)
    e, psi, slope, point = s.where[p, ELEMENT], s.psi[p, 0], s.psi[p, 1], s.point[p]
    height, rate = 0.0, 0.0
    for r in range(2):
        for j in range(2):
            height += psi[2 * j + r] * static[r, e + j]
            rate += slope[2 * j + r] * static[r, e + j]
    point[ZETA], point[W_STATIC], point[V_STATIC] = zeta, height, speed * rate


@njit(cache=True, fastmath=False)
def respond(c: Links, s: State) -> None:
    """Find the links' forces and w_free, C_pq of the contact points for the present slack state, affine in all F_p."""
    n = c.element.size
    band = c.coupling.shape[1] - 1
    lam = s.force[0]
    for j in range(n):
        lam[j] = s.free[0, j] - s.free[1, j] if s.acting[j] == 1 else -c.rest[j, 1]
    for i in range(n):
        if s.acting[i] == 0 and lam[i] != 0.0:
            for k in range(max(0, i - band), min(n, i + band + 1)):
                if s.acting[k] == 1:
                    lam[k] -= lam[i] * (c.coupling[i, band - i + k] if k < i else c.coupling[k, band - k + i])
    _solve_links(s, lam, 0)
    for p in range(s.point.shape[0]):
        unit, near = s.unit[p], s.near[p]
        for j in range(n):
            unit[j] = near[j] if s.acting[j] == 1 else 0.0
        _solve_links(s, unit, s.where[p, FIRST_NEAR])
        e, psi, column = s.where[p, ELEMENT], s.psi[p, 0], s.psi[p, 2]
        height = s.point[p, W_STATIC]
        for j in range(2):
            height += psi[2 * j] * s.y[2, e + j] + psi[2 * j + 1] * s.y[3, e + j]
        for j in range(s.where[p, FIRST_NEAR], s.where[p, LAST_NEAR]):
            height -= near[j] * lam[j]
        s.point[p, W_FREE] = height
        column[0], column[1], column[2], column[3] = psi[0], psi[2], psi[1], psi[3]
        for q in range(p + 1):
            # of q by a unit force on p; the one in front has its column at hand already
            at, other = s.where[q, ELEMENT], s.psi[q, 2]
            compliance = _answer(c, psi, e, at, other[0:2], other[2:4])
            for j in range(s.where[q, FIRST_NEAR], s.where[q, LAST_NEAR]):
                compliance -= s.near[q, j] * unit[j]
            s.between[p, q] = s.between[q, p] = compliance
        s.point[p, COMPLIANCE] = s.between[p, p]


@njit(cache=True, fastmath=False)
def recheck(c: Links, s: State, contact: Array) -> int:
    """Flip the droppers that contradict the contact forces (N); return the first row concerned, or -1."""
    n, band = c.coupling.shape[0], c.coupling.shape[1] - 1
    total = s.force[1]
    for j in range(n):
        total[j] = s.force[0, j]
        for p in range(contact.size):
            total[j] += s.unit[p, j] * contact[p]
    first = -1
    slack = 0
    for j in range(n):
        if c.one_sided[j] == 0:
            continue
        if s.acting[j] == 1:
            taut = 1 if total[j] + c.rest[j, 1] > 0.0 else 0
        else:
            stretch = c.rest[j, 0] + s.free[0, j]
            for p in range(contact.size):
                stretch += s.near[p, j] * contact[p]
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
def take(w: Wires, c: Links, s: State, contact: Array, speed: float) -> None:
    """Add what links and contact forces (N) do to the free wires' step, make it the state, read the contact points."""
    width = c.column.shape[2]
    for j in range(c.element.size):
        force = s.force[1, j]
        if force != 0.0:
            first = c.first[j]
            for f in range(c.fields[j, 0], c.fields[j, 1]):
                y, column = s.y[f, first : first + width], c.column[j, f]
                for i in range(width):
                    y[i] -= force * column[i]
    reach = c.influence.shape[2] // 2
    for p in range(contact.size):
        if contact[p] == 0.0:
            continue
        for j in range(4):
            share = contact[p] * s.psi[p, 0, j]
            first = s.where[p, ELEMENT] + j // 2 - reach
            for f in range(2):
                y, column = s.y[2 + f, first : first + 2 * reach + 1], c.influence[j % 2, f]
                for i in range(2 * reach + 1):
                    y[i] += share * column[i]
    wires.take(w, s.q, s.y)
    for p in range(contact.size):
        e, psi, slope, point = s.where[p, ELEMENT], s.psi[p, 0], s.psi[p, 1], s.point[p]
        height, velocity = point[W_STATIC], point[V_STATIC]
        for j in range(2):
            for r in range(2):
                height += psi[2 * j + r] * s.q[0, 2 + r, e + j]
                velocity += psi[2 * j + r] * s.q[1, 2 + r, e + j] + speed * slope[2 * j + r] * s.q[0, 2 + r, e + j]
        point[HEIGHT], point[VELOCITY], point[FORCE] = height, velocity, contact[p]
