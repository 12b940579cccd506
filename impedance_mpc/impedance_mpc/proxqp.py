"""The quadratic program of one cycle by ProxQP (ProxSuite): augmented Lagrangian, started from the plan before."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from impedance_mpc.active_set import EXACTLY, NEARLY, room, settle, sides
from impedance_mpc.optimality import distances
from impedance_mpc.plant import Array
from phil_base.enumerations import SolverStatus

NEAR = 1e-6
"""Units of z: how near ProxQP has to come before its active bounds are believed; it stops at a residual of 1."""
STIFF = 1e6
"""1: how much stiffer than the cost the penalty of a hard bound is."""
TRIES = 3
"""Times that ProxQP goes on from where it was, before it begins anew."""
CARRIED = 3
"""Times that the active bounds of the cycle before are tried, exchanged in between, before ProxQP is asked."""
EXCHANGES = 10
"""Times that bounds are exchanged where ProxQP came near two of them, and took the wrong one for active."""
TOUCH = 1e-8
"""Units of a weighted row: what tells ProxQP that a bound was active before, without moving it."""
NEVER = 1e20
"""What ProxQP takes for infinite."""
FINE, NO_NUMBER, NO_ROOM = 0, 1, 2


class ProximalProgram:
    """The program of :class:`.solver.QuadraticProgram`, with the same arguments and answers, by ProxQP.

    ProxQP minimises 1/2 z' H z + g' z + 1/(2 mu) |max(C z - u + mu y, 0)|^2 over z, then improves y, again and again.
    With y = 0 and rows scaled to one softness 1/mu, the first of these problems *is* the one with soft rows: no slack
    variables, and one outer iteration. Hard bounds are rows of their own whose penalty is :data:`STIFF` times the cost;
    what they give way by tells which of them are active. The last digits come from the linear system of these bounds
    (:func:`.active_set.exact`), and the answer is held against the conditions of optimality; so it has the same bits
    wherever ProxQP's memory lies, and differs from DAQP's by rounding. What was active in the cycle before is tried
    first, with a few exchanges, as an active-set method does; where that does not lead to the answer ProxQP is asked,
    and begins from there.

    Bambade, El-Kazdadi, Taylor, Carpentier: ProxQP, Robotics: Science and Systems 2022.

    Raises
    ------
    ValueError
        The Hessian is not positive definite, or a number is not finite.
    ImportError
        ProxSuite is not installed.
    """

    def __init__(
        self, hessian: Array, rows: Array, tolerance: float, iterations: int, softness: Array | None = None
    ) -> None:
        from proxsuite import proxqp

        self._proxqp = proxqp
        self.hessian, self.rows = np.ascontiguousarray(hessian), np.ascontiguousarray(rows)
        self.tolerance, self.max_iterations, self.softness = tolerance, iterations, softness
        size, count = hessian.shape[0], rows.shape[0]
        self._size = size
        self.z: Array = np.zeros(size)
        self.iterations = 0
        self.asked = 0
        """Problems that ProxQP was asked for; the active bounds of the others were near those of the one before."""
        compliance = np.zeros(count)
        if softness is not None:
            soft = softness > 0.0
            compliance[soft] = 1.0 / softness[soft]
        self._unit = distances(self.hessian, self.rows, compliance)
        self._scaled = np.ascontiguousarray(self.rows * self._unit[:, None])
        self._compliance = compliance * self._unit**2
        curvature = np.linalg.eigvalsh(self.hessian)
        self._cost = 1.0 / (float(curvature[0]) * NEAR)
        stiffness = np.full(size + count, STIFF * float(curvature[-1]))
        given = self._compliance > 0.0
        stiffness[size:][given] = 1.0 / self._compliance[given]
        self._weight = np.sqrt(self._cost * stiffness)
        self._rows_weighted = np.ascontiguousarray(np.vstack([np.eye(size), self._scaled]) * self._weight[:, None])
        self._hessian_weighted = np.ascontiguousarray(self._cost * self.hessian)
        self._g, self._g_weighted = np.zeros(size), np.zeros(size)
        self._lower, self._upper = np.zeros(size + count), np.zeros(size + count)
        self._lower_weighted, self._upper_weighted = np.zeros(size + count), np.zeros(size + count)
        self._push = np.zeros(size + count)
        self._side = np.zeros(size + count, np.int64)
        self._multipliers = np.zeros(size + count)
        self._near, self._found = np.zeros(size), np.zeros(size)
        self._room = room(size, count)
        self._written = (
            self._unit, tolerance, self._cost, self._weight, self._g, self._lower, self._upper, self._g_weighted,
            self._lower_weighted, self._upper_weighted,
        )  # fmt: skip
        self._program = (
            self.hessian, self._scaled, self._compliance, self._g, self._lower, self._upper, self._side, self._room,
            self._found, self._multipliers, tolerance,
        )  # fmt: skip
        self._begin()

    def reset(self) -> None:
        """Forget all earlier solutions: the next run repeats the first one to the last bit."""
        self.z[:] = 0.0
        self.iterations = 0
        self._begin()

    def _begin(self) -> None:
        """Make ProxQP's own object anew, with nothing kept."""
        proxqp = self._proxqp
        kind, backend = proxqp.dense.HessianType.Dense, proxqp.dense.DenseBackend.PrimalDualLDLT
        self._qp: Any = proxqp.dense.QP(self._size, 0, self._lower.size, False, kind, backend)
        settings = self._qp.settings
        settings.compute_preconditioner = False  # the weights have a meaning
        settings.default_mu_in = settings.mu_min_in = 1.0
        settings.max_iter, settings.max_iter_in = 1, self.max_iterations
        settings.eps_abs, settings.eps_rel = 1e-9, 0.0
        settings.initial_guess = proxqp.InitialGuess.WARM_START
        self._fresh = True
        self._known = False
        self._near[:] = self._push[:] = 0.0
        self._room.kept[0] = 0

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve for gradient ``g`` and bounds; the solution is in :attr:`z`; give SOLVED or FAILED.

        As :meth:`.solver.QuadraticProgram.solve`.
        """
        self.iterations = 0
        wrong = _write(self._size, g, lower, upper, box_lower, box_upper, *self._written)
        if wrong:
            if wrong == NO_NUMBER:
                self._begin()
            return SolverStatus.FALLBACK
        self._push[:] = 0.0
        if self._known:
            if self._solves(CARRIED, EXACTLY):
                self._near[:] = self.z
                return SolverStatus.SOLVED
            if np.isfinite(self._found).all():
                self._near[:] = self._found
                np.multiply(self._side, TOUCH, out=self._push)
        self.asked += 1
        if not self._fresh and self._run():
            return SolverStatus.SOLVED
        self._begin()
        if self._run():
            return SolverStatus.SOLVED
        self._begin()
        return SolverStatus.FALLBACK

    def _run(self) -> bool:
        """Solve from the plan before; tell whether :attr:`z` is the solution."""
        qp, results = self._qp, self._qp.results
        for number in range(TRIES):
            if self._fresh:
                qp.init(
                    self._hessian_weighted,
                    self._g_weighted,
                    None,
                    None,
                    self._rows_weighted,
                    self._lower_weighted,
                    self._upper_weighted,
                    compute_preconditioner=False,
                    mu_in=1.0,
                )
                self._fresh = False
            elif number == 0:
                qp.update(g=self._g_weighted, l=self._lower_weighted, u=self._upper_weighted)
            qp.solve(self._near, None, self._push)
            self.iterations += results.info.iter
            self._near[:] = results.x
            if self.iterations > self.max_iterations or not np.isfinite(self._near).all():
                return False
            sides(self._scaled, self._lower, self._upper, self._near, self._side)
            if self._solves(EXCHANGES, NEARLY):
                self._known = True
                return True
        return False

    def _solves(self, tries: int, wanted: int) -> bool:
        """Solve with the bounds that count as active, or those next to them; tell whether :attr:`z` is the solution."""
        if settle(*self._program, tries) >= wanted:
            self.z[:] = self._found
            return True
        return False


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def _write(
    size: int, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array, unit: Array, tolerance: float,
    cost: float, weight: Array, to_g: Array, to_lower: Array, to_upper: Array, g_weighted: Array, lower_weighted: Array,
    upper_weighted: Array,
) -> int:  # fmt: skip
    """Write a problem into the arrays of :class:`ProximalProgram`; give what is wrong with it."""
    for j in range(size):
        if not np.isfinite(g[j]):
            return NO_NUMBER
        to_g[j], g_weighted[j] = g[j], cost * g[j]
    for i in range(weight.size):
        low = box_lower[i] if i < size else lower[i - size] * unit[i - size]
        high = box_upper[i] if i < size else upper[i - size] * unit[i - size]
        if not low <= high + tolerance:  # NaN neither
            return NO_NUMBER
        if low == np.inf or high == -np.inf:
            return NO_ROOM
        to_lower[i], to_upper[i] = low, high
        lower_weighted[i], upper_weighted[i] = max(weight[i] * low, -NEVER), min(weight[i] * high, NEVER)
    return FINE
