"""Conditions of optimality of a quadratic program: they give its rows their scale, and a solution is held against them.

The program is min 1/2 z' H z + g' z with bounds on z and on rows C z, some of them soft; its conditions (Karush, Kuhn,
Tucker) are necessary and sufficient, so that whoever checks them needs to believe no solver.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from impedance_mpc.plant import Array

SLOPE = 1e-9
"""1, what may be left of the Lagrangian's slope, as a share of the terms that cancel in it; also of a multiplier."""
ROUNDING = 1e-10
"""1, rounding of a row's value, as a share of its terms."""


def distances(hessian: Array, rows: Array, compliance: Array) -> Array:
    """Give how far z moves where a row (m,) that is broken by one of its own units begins to push back.

    |H^-1 c| / (compliance + c' H^-1 c), in the units of z over those of the row; ``compliance`` (m,) is 1 / softness, 0
    for a hard row. At least 1 / sqrt(c' H^-1 c), the same as a length in the metric of H. A row of zeros gives 1.

    Raises
    ------
    ValueError
        The Hessian is not positive definite, or something is not finite.
    """
    if not (np.isfinite(hessian).all() and np.isfinite(rows).all()):
        raise ValueError("the quadratic program has a number that is not finite")
    try:
        factor = np.linalg.cholesky(hessian)
    except np.linalg.LinAlgError:
        raise ValueError("the Hessian of the quadratic program is not positive definite") from None
    whitened = np.linalg.solve(factor, rows.T)
    moved = np.linalg.norm(np.linalg.solve(factor.T, whitened), axis=0)
    length = np.linalg.norm(whitened, axis=0)
    some = length > 0.0
    found = np.ones(len(rows))
    found[some] = np.maximum(moved[some] / (compliance[some] + length[some] ** 2), 1.0 / length[some])
    return found


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def optimal(
    hessian: Array,
    rows: Array,
    compliance: Array,
    g: Array,
    lower: Array,
    upper: Array,
    z: Array,
    multipliers: Array,
    tolerance: float,
) -> bool:
    """Tell whether ``z`` with its multipliers fulfils all conditions of optimality; NaN anywhere does not.

    ``lower``, ``upper`` and ``multipliers`` (nz + m,) are those of z, then those of the rows; a multiplier is positive
    at its upper bound. A soft row gives way by multiplier times ``compliance``: what is left has to keep the bounds,
    and to be at the one that pushes, to ``tolerance`` and rounding. H z + g + multipliers + C' multipliers has to be
    zero to rounding.
    """
    size = z.size
    largest = 0.0
    for j in range(size):
        largest = max(largest, abs(g[j]))
    for i in range(lower.size):
        largest = max(largest, abs(multipliers[i]))
    nothing = SLOPE * largest
    for i in range(lower.size):
        if i < size:
            value, terms = z[i], abs(z[i])
        else:
            value, terms = 0.0, 0.0
            for j in range(size):
                term = rows[i - size, j] * z[j]
                value += term
                terms += abs(term)
            value -= multipliers[i] * compliance[i - size]
        room = 2.0 * tolerance + ROUNDING * terms
        if not (lower[i] - room <= value <= upper[i] + room):
            return False
        push = multipliers[i]
        if (push > nothing and value < upper[i] - room) or (push < -nothing and value > lower[i] + room):
            return False
    for j in range(size):
        slope, terms = g[j] + multipliers[j], abs(g[j]) + abs(multipliers[j])
        for k in range(size):
            term = hessian[j, k] * z[k]
            slope += term
            terms += abs(term)
        for i in range(rows.shape[0]):
            push = multipliers[size + i]
            if push != 0.0:
                slope += rows[i, j] * push
                terms += abs(rows[i, j] * push)
        if not abs(slope) <= SLOPE * terms:
            return False
    return True
