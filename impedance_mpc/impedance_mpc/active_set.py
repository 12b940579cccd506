"""The exact solution of a quadratic program whose active bounds are known: one linear system, by Schur's complement.

Solvers that come near a solution (augmented Lagrangians, interior points) tell which bounds are active long before the
last digits are right. This gives the digits; :func:`.optimality.optimal` says whether the bounds were the right ones.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from impedance_mpc.optimality import ROUNDING, SLOPE, optimal
from impedance_mpc.plant import Array

Integers = NDArray[np.int64]
EXACTLY, NEARLY = 2, 1
DEPENDENT = 1e-12
"""1: what is left of a row's own length where it counts as depending on the rows before it."""


class Room(NamedTuple):
    """What :func:`exact` works in, and what it keeps: the factor of H where no bound of z is active."""

    factor: Array
    """(nz, nz), lower triangle L of the free part of H."""
    held: Integers
    """(nz,), which variables were at a bound when L was made, 1 or 0."""
    kept: Integers
    """(1,), 1 if L is good."""
    free: Integers
    moves: Array
    """(m, nz), L^-1 c of each active row."""
    complement: Array
    """(m, m), factor of the Schur complement of the active rows."""
    push: Array
    active: Integers


def room(size: int, count: int) -> Room:
    """Give room for ``size`` variables and ``count`` rows, with nothing kept."""
    return Room(
        np.zeros((size, size)),
        np.full(size, -1, np.int64),
        np.zeros(1, np.int64),
        np.zeros(size, np.int64),
        np.zeros((count, size)),
        np.zeros((count, count)),
        np.zeros(count),
        np.zeros(count, np.int64),
    )


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def sides(rows: Array, lower: Array, upper: Array, z: Array, side: Integers) -> None:
    """Tell into ``side`` (nz + m,) which bounds ``z`` is at or beyond: 1 the upper one, -1 the lower one, 0 none."""
    size = z.size
    for i in range(side.size):
        if i < size:
            value = z[i]
        else:
            value = 0.0
            for j in range(size):
                value += rows[i - size, j] * z[j]
        side[i] = 1 if value >= upper[i] else -1 if value <= lower[i] else 0


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def exact(
    hessian: Array,
    rows: Array,
    compliance: Array,
    g: Array,
    lower: Array,
    upper: Array,
    side: Integers,
    work: Room,
    z: Array,
    multipliers: Array,
) -> bool:
    """Solve min 1/2 z' H z + g' z with the bounds at ``side`` active, into ``z`` and ``multipliers`` (nz + m,).

    With L L' the free part of H, and S = C H^-1 C' + compliance over the active rows, S y = C H^-1 (-g) - bound. A soft
    row gives way by multiplier times ``compliance`` (m,), so that S is definite however many are active; of hard ones
    that depend on one another the later ones are left out. False if H is not positive definite. O(nz^3 / 3) where other
    variables are at a bound than before, O(nz^2 (1 + active rows)) else.
    """
    size = z.size
    factor, free, moves, complement = work.factor, work.free, work.moves, work.complement
    push, active = work.push, work.active
    count, same = 0, work.kept[0] == 1
    for j in range(size):
        at = 1 if side[j] != 0 else 0
        if at == 1:
            z[j] = upper[j] if side[j] > 0 else lower[j]
        else:
            free[count] = j
            count += 1
        if work.held[j] != at:
            same = False
            work.held[j] = at
    if not same:
        work.kept[0] = 0
        for a in range(count):
            for c in range(a + 1):
                value = hessian[free[a], free[c]]
                for k in range(c):
                    value -= factor[a, k] * factor[c, k]
                if c < a:
                    factor[a, c] = value / factor[c, c]
                elif value > 0.0:
                    factor[a, a] = np.sqrt(value)
                else:
                    return False
        work.kept[0] = 1
    # b = L^-1 (-g - H of what is held), in the place of the multipliers of the variables.
    b = multipliers
    for a in range(count):
        value = -g[free[a]]
        for k in range(size):
            if side[k] != 0:
                value -= hessian[free[a], k] * z[k]
        for k in range(a):
            value -= factor[a, k] * b[k]
        b[a] = value / factor[a, a]
    used = 0
    for i in range(rows.shape[0]):
        if side[size + i] != 0:
            active[used] = i
            bound = upper[size + i] if side[size + i] > 0 else lower[size + i]
            for k in range(size):
                if side[k] != 0:
                    bound -= rows[i, k] * z[k]
            push[used] = -bound
            for a in range(count):
                value = rows[i, free[a]]
                for k in range(a):
                    value -= factor[a, k] * moves[used, k]
                moves[used, a] = value / factor[a, a]
                push[used] += moves[used, a] * b[a]
            independent = True
            for q in range(used + 1):
                value = compliance[i] if q == used else 0.0
                for a in range(count):
                    value += moves[used, a] * moves[q, a]
                whole = value
                for k in range(q):
                    value -= complement[used, k] * complement[q, k]
                if q < used:
                    complement[used, q] = value / complement[q, q]
                else:
                    independent = value > DEPENDENT * whole
                    if independent:
                        complement[q, q] = np.sqrt(value)
            if independent:
                used += 1
    for p in range(used):
        for k in range(p):
            push[p] -= complement[p, k] * push[k]
        push[p] /= complement[p, p]
    for p in range(used - 1, -1, -1):
        for k in range(p + 1, used):
            push[p] -= complement[k, p] * push[k]
        push[p] /= complement[p, p]
    for p in range(used):
        for a in range(count):
            b[a] -= moves[p, a] * push[p]
    for a in range(count - 1, -1, -1):
        for k in range(a + 1, count):
            b[a] -= factor[k, a] * b[k]
        b[a] /= factor[a, a]
        z[free[a]] = b[a]
    multipliers[:] = 0.0
    for p in range(used):
        multipliers[size + active[p]] = push[p]
    for j in range(size):
        if side[j] != 0:
            value = -g[j]
            for k in range(size):
                value -= hessian[j, k] * z[k]
            for p in range(used):
                value -= rows[active[p], j] * push[p]
            multipliers[j] = value
    return True


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def exchange(rows: Array, lower: Array, upper: Array, z: Array, multipliers: Array, side: Integers) -> int:
    """Change ``side`` (nz + m,) where the solution of :func:`exact` says so, and give the number of changes.

    Active bounds whose multiplier pulls are let go, bounds that are broken become active: a step of the primal-dual
    active set method (Hintermueller, Ito, Kunisch: SIAM J. Optim. 13, 2002), which ends at the solution from nearby.
    """
    size, changes, largest = z.size, 0, 0.0
    for i in range(side.size):
        largest = max(largest, abs(multipliers[i]))
    for i in range(side.size):
        if side[i] != 0:
            if multipliers[i] * side[i] < -SLOPE * largest:
                side[i] = 0
                changes += 1
            continue
        value = 0.0
        if i < size:
            value = z[i]
        else:
            for j in range(size):
                value += rows[i - size, j] * z[j]
        if value > upper[i] + ROUNDING:
            side[i] = 1
            changes += 1
        elif value < lower[i] - ROUNDING:
            side[i] = -1
            changes += 1
    return changes


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def settle(
    hessian: Array,
    rows: Array,
    compliance: Array,
    g: Array,
    lower: Array,
    upper: Array,
    side: Integers,
    work: Room,
    z: Array,
    multipliers: Array,
    tolerance: float,
    tries: int,
) -> int:
    """Solve as :func:`exact`, with bounds exchanged up to ``tries`` - 1 times.

    Gives EXACTLY if ``z`` is the solution to rounding, NEARLY if it fulfils the conditions of optimality to
    ``tolerance``, else 0. ``rows`` have the unit of z.
    """
    good = False
    for _ in range(tries):
        if not exact(hessian, rows, compliance, g, lower, upper, side, work, z, multipliers):
            return 0
        good = optimal(hessian, rows, compliance, g, lower, upper, z, multipliers, tolerance)
        if exchange(rows, lower, upper, z, multipliers, side) == 0:
            return EXACTLY if good else 0
    return NEARLY if good else 0
