"""Sequences of quadratic programs as they come up in a ride, and what makes one of their solutions the right one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from impedance_mpc.optimality import distances

Array = NDArray[np.float64]
Problem = tuple[Array, Array, Array, Array, Array]
"""g (nz,), lower and upper bound of the rows (m,), lower and upper bound of the variables (nz,)."""


@dataclass(frozen=True)
class Sequence:
    """Problems min 1/2 z' H z + g' z, l <= C z <= u, l_box <= z <= u_box with the same H and C, one after the other.

    ``hessian`` (nz, nz), ``rows`` C (m, nz); of N problems ``gradient``, ``box_lower``, ``box_upper`` (N, nz), and
    ``lower``, ``upper`` (N, m), contiguous. Entry 0 of z is u_tr(k) in mm, entry ``correction`` is F_cor(k) in N.
    ``softness`` (m,): where positive, the row may be violated by s at the cost 1/2 softness s^2; None: all are hard.
    ``tolerance`` and ``iterations`` are those that the controller's own solver was given.
    """

    hessian: Array
    rows: Array
    gradient: Array
    lower: Array
    upper: Array
    box_lower: Array
    box_upper: Array
    correction: int
    softness: Array | None
    tolerance: float
    iterations: int

    @property
    def count(self) -> int:
        """Number of problems."""
        return int(self.gradient.shape[0])

    def problem(self, k: int) -> Problem:
        """Give the data of problem ``k``, as views."""
        return self.gradient[k], self.lower[k], self.upper[k], self.box_lower[k], self.box_upper[k]

    def part(self, chosen: slice) -> Sequence:
        """Give some of the problems only."""
        return self._with(lambda array: array[chosen])

    def shifted(self) -> Sequence:
        """Give the same numbers in memory that is aligned to 8 bytes but not to 16."""
        moved = self._with(_shifted)
        return replace(moved, hessian=_shifted(self.hessian), rows=_shifted(self.rows))

    def _with(self, change: Callable[[Array], Array]) -> Sequence:
        """Give the same matrices with changed vectors."""
        return replace(
            self,
            gradient=change(self.gradient),
            lower=change(self.lower),
            upper=change(self.upper),
            box_lower=change(self.box_lower),
            box_upper=change(self.box_upper),
        )

    def hardened(self) -> Sequence:
        """Write soft rows with variables of their own, for solvers that know only hard ones.

        l <= C z + e / sqrt(softness) <= u with e free at the cost 1/2 e^2: the same z. One variable a soft row is
        enough, since only one side of a row can be violated; so scaled it costs as much as the others do.
        """
        if self.softness is None or not (self.softness > 0.0).any():
            return replace(self, softness=None)
        soft = np.flatnonzero(self.softness > 0.0)
        size, extra = self.hessian.shape[0], soft.size
        hessian = np.eye(size + extra)
        hessian[:size, :size] = self.hessian
        rows = np.hstack([self.rows, np.zeros((self.rows.shape[0], extra))])
        rows[soft, size + np.arange(extra)] = 1.0 / np.sqrt(self.softness[soft])
        free = np.full((self.count, extra), np.inf)
        return Sequence(
            hessian=hessian,
            rows=rows,
            gradient=np.hstack([self.gradient, np.zeros((self.count, extra))]),
            lower=self.lower,
            upper=self.upper,
            box_lower=np.hstack([self.box_lower, -free]),
            box_upper=np.hstack([self.box_upper, free]),
            correction=self.correction,
            softness=None,
            tolerance=self.tolerance,
            iterations=self.iterations,
        )


def _shifted(array: Array) -> Array:
    room = np.empty(array.size + 2)
    start = 1 if room.ctypes.data % 16 == 0 else 0
    room[start : start + array.size] = array.ravel()
    return room[start : start + array.size].reshape(array.shape)


ACTIVE = 1e-7
"""mm, N: a bound that is nearer than this is taken as active when multipliers are fitted."""


GOOD = 1e-3
"""mm, N: a residual up to this is a solution; far below what encoder and load cell resolve."""


def residuals(sequence: Sequence, solutions: Array) -> Array:
    """Give how far solutions (N, nz) are from the conditions of optimality (N,), in mm and N, whoever found them.

    The larger of two: by how much a hard bound is broken, and what the best multipliers leave. These are non-negative
    and only on bounds that are nearer than GOOD; left are the slope of the Lagrangian, in the metric of the inverse
    Hessian, and of each soft row how far its excess is from its multiplier over its softness, as a way of z. Infinite
    for what is not finite, and for bounds that contradict each other: there is no solution.
    """
    hard = np.ones(sequence.rows.shape[0], dtype=np.bool_)
    compliance = np.zeros(hard.size)
    if sequence.softness is not None:
        hard = ~(sequence.softness > 0.0)
        compliance[~hard] = 1.0 / sequence.softness[~hard]
    size = sequence.hessian.shape[0]
    scale = np.concatenate([distances(sequence.hessian, sequence.rows, compliance), np.ones(size)])
    normals = np.vstack([sequence.rows, np.eye(size)]) * scale[:, None]
    compliance = np.concatenate([compliance, np.zeros(size)]) * scale**2
    factor = np.linalg.cholesky(sequence.hessian)
    whitened = np.linalg.solve(factor, normals.T).T
    found = np.full(sequence.count, np.inf)
    for k, z in enumerate(solutions):
        high = np.concatenate([sequence.upper[k], sequence.box_upper[k]]) * scale
        low = np.concatenate([sequence.lower[k], sequence.box_lower[k]]) * scale
        if not np.isfinite(z).all() or not (low <= high + sequence.tolerance).all():
            continue
        over, under = normals @ z - high, low - normals @ z
        broken = np.maximum(over, under)[compliance == 0.0].max()
        above, below = over >= -GOOD, under >= -GOOD
        sides = np.vstack([whitened[above], -whitened[below]])
        give = np.concatenate([compliance[above], compliance[below]])
        beyond = np.maximum(np.concatenate([over[above], under[below]]), 0.0)
        slope = np.linalg.solve(factor, sequence.hessian @ z + sequence.gradient[k])
        soft = give > 0.0
        matrix = np.vstack([sides.T, np.diag(give)[soft]])
        target = np.concatenate([-slope, beyond[soft]])
        left = nnls(matrix, target)[1] if matrix.shape[1] else float(np.linalg.norm(slope))
        found[k] = max(broken, left)
    return found


def excess(sequence: Sequence, chosen: NDArray[np.bool_], z: Array) -> tuple[Array, Array]:
    """Give by how much solutions z (K, nz) of the ``chosen`` problems (N,) lie outside their bounds, with its sign.

    First of the rows (K, m), then of the box (K, nz); above the upper bound it is positive.
    """
    value = z @ sequence.rows.T
    rows = np.maximum(value - sequence.upper[chosen], 0.0) + np.minimum(value - sequence.lower[chosen], 0.0)
    box = np.maximum(z - sequence.box_upper[chosen], 0.0) + np.minimum(z - sequence.box_lower[chosen], 0.0)
    return rows, box


def objective(sequence: Sequence, chosen: NDArray[np.bool_], z: Array) -> Array:
    """Give the cost (K,) of solutions z (K, nz) of the ``chosen`` problems, what they break of soft rows included."""
    cost = 0.5 * np.einsum("ki,ij,kj->k", z, sequence.hessian, z) + np.einsum("ki,ki->k", sequence.gradient[chosen], z)
    if sequence.softness is not None:
        rows, _ = excess(sequence, chosen, z)
        cost += 0.5 * rows**2 @ np.maximum(sequence.softness, 0.0)
    return np.asarray(cost)


def violation(sequence: Sequence, chosen: NDArray[np.bool_], z: Array) -> float:
    """Give the largest violation of a hard bound, mm, mm/s or N."""
    rows, box = excess(sequence, chosen, z)
    if sequence.softness is not None:
        rows = rows[:, ~(sequence.softness > 0.0)]
    return float(max(np.abs(rows).max(initial=0.0), np.abs(box).max(initial=0.0)))


def distance(sequence: Sequence, k: int, z: Array) -> float:
    """Give how far z is from the solution of problem ``k`` (mm, N) by the conditions of optimality, without a solver.

    A soft row pushes back with its softness times its excess, and of the active hard bounds those multipliers are taken
    that fit best and have the right sign (non-negative least squares). What is left of the Lagrangian's slope is zero
    only at the solution; one Newton step along the active bounds makes a distance of it (the slope itself is rounding
    times the largest softness).
    """
    this = np.arange(sequence.count) == k
    rows, _ = excess(sequence, this, z[None, :])
    curvature, slope = sequence.hessian, sequence.hessian @ z + sequence.gradient[k]
    hard = np.ones(sequence.rows.shape[0], dtype=np.bool_)
    if sequence.softness is not None:
        pushing = np.where(rows[0] != 0.0, np.maximum(sequence.softness, 0.0), 0.0)
        curvature = curvature + sequence.rows.T @ (pushing[:, None] * sequence.rows)
        slope = slope + sequence.rows.T @ (pushing * rows[0])
        hard = ~(sequence.softness > 0.0)
    normals = np.vstack([sequence.rows[hard], np.eye(z.size)])
    high = np.concatenate([sequence.upper[k][hard], sequence.box_upper[k]])
    low = np.concatenate([sequence.lower[k][hard], sequence.box_lower[k]])
    value = normals @ z
    active = np.vstack([normals[value >= high - ACTIVE], -normals[value <= low + ACTIVE]])
    if active.size:
        multipliers, _ = nnls(active.T, -slope)
        slope = slope + active.T @ multipliers
        active = active[multipliers > 0.0]
    # The slope must not be laid on bounds that do not carry it: only those with a positive multiplier are kept.
    held = len(active)
    matrix = np.block([[curvature, active.T], [active, np.zeros((held, held))]])
    step = np.linalg.lstsq(matrix, np.concatenate([-slope, np.zeros(held)]), rcond=None)[0]
    return float(np.abs(step[: z.size]).max())
