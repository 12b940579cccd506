"""The quadratic program of one cycle: set up once, warm-started from the active set before, deterministic."""

from __future__ import annotations

import daqp
import numpy as np

from impedance_mpc.plant import Array

SOLVED = 0
"""Solved."""
FAILED = 2
"""No usable solution: infeasible, out of iterations, or not finite."""

_SOFT = 8
"""DAQP's mark of a constraint that may be violated at a cost."""


class QuadraticProgram:
    """min 1/2 z' H z + g' z subject to l <= C z <= u and l_box <= z <= u_box, by DAQP (dense, dual active set).

    ``hessian`` (nz, nz), ``rows`` C (m, nz), ``tolerance`` is the largest violation of a constraint, ``iterations``
    the cap on changes of the active set; their number decides when it stops, never a clock. Each call of
    :meth:`solve` starts from the active set of the one before and keeps its factors; after a failure it starts afresh.
    The solution is exact up to rounding whatever the start.

    ``softness`` (m,) makes a row soft where it is positive: it may be violated by s at the cost of 1/2 softness s^2
    (per side, in the units of the row). Needs no slack variables: in the dual it adds 1 / softness to the diagonal.

    Arnstrom, Bemporad, Axehill: A dual active-set solver for embedded quadratic programming using recursive LDL'
    updates, IEEE Trans. Automatic Control 67 (2022) 4362-4369.
    """

    def __init__(
        self, hessian: Array, rows: Array, tolerance: float, iterations: int, softness: Array | None = None
    ) -> None:
        self.hessian, self.rows = np.ascontiguousarray(hessian), np.ascontiguousarray(rows)
        self.tolerance, self.max_iterations, self.softness = tolerance, iterations, softness
        self._size = size = hessian.shape[0]
        self.z: Array = np.zeros(size)
        self.iterations = 0
        # The solver keeps pointers to these: filled in place, never replaced. The box comes first, as it wants it.
        self._g: Array = np.zeros(size)
        self._lower: Array = np.zeros(size + rows.shape[0])
        self._upper: Array = np.zeros(size + rows.shape[0])
        self._box_lower, self._row_lower = self._lower[:size], self._lower[size:]
        self._box_upper, self._row_upper = self._upper[:size], self._upper[size:]
        self._fresh = True

    def reset(self) -> None:
        """Forget all earlier solutions: the next run repeats the first one to the last bit."""
        self._fresh = True
        self.z[:] = 0.0
        self.iterations = 0

    def _create(self) -> bool:
        model = daqp.Model()
        # The Hessian is positive definite (weights of the moves): no proximal iterations.
        model.settings = {"primal_tol": self.tolerance, "iter_limit": self.max_iterations, "eps_prox": 0.0}
        sense = np.zeros(self._lower.size, dtype=np.intc)
        soft = None if self.softness is None else self.softness > 0.0
        if soft is not None:
            sense[self._size :][soft] = _SOFT
        flag, _ = model.setup(self.hessian, self._g, self.rows, self._upper, self._lower, sense)
        if soft is not None and self.softness is not None:
            reciprocal = np.zeros(self._lower.size)
            reciprocal[self._size :][soft] = 1.0 / self.softness[soft]
            model.soft_weights(rho_l=reciprocal, rho_u=reciprocal)
        self._model = model
        self._fresh = False
        return flag >= 0

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve for gradient ``g`` and bounds; the solution is in :attr:`z`; give SOLVED or FAILED.

        A FAILED call leaves :attr:`z` as it was. Bounds must not be NaN (a NaN gradient fails, a NaN bound is
        taken for none).
        """
        self._g[:] = g
        self._box_lower[:], self._row_lower[:] = box_lower, lower
        self._box_upper[:], self._row_upper[:] = box_upper, upper
        if self._fresh:
            if not self._create():
                return self._fail()
        else:
            self._model.update(f=self._g, bupper=self._upper, blower=self._lower)
        found, _, flag, info = self._model.solve()
        self.iterations = info["iterations"]
        # A sum is finite only if every entry is. 1: optimal, 2: optimal with a soft row violated.
        if flag < 1 or not np.isfinite(found.sum()):
            return self._fail()
        self.z[:] = found
        return SOLVED

    def _fail(self) -> int:
        self._fresh = True
        return FAILED
