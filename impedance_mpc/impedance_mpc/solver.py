"""The quadratic program of one cycle: created once, updated and warm-started, deterministic."""

from __future__ import annotations

import numpy as np

from impedance_mpc.plant import Array
from impedance_mpc.portable_proxqp import proxqp

SOLVED = 0
"""Solved to the tolerance."""
MAX_ITERATIONS = 1
"""Iterations ran out, the last iterate is feasible to ``ACCEPTED`` and may be used."""
FAILED = 2
"""No usable solution: not solved, not feasible, or not finite."""

ACCEPTED = 1e-2
"""mm, mm/s, N: violation of a constraint up to which an iterate that was cut short is used (clipped to its box)."""


class QuadraticProgram:
    """min 1/2 z' H z + g' z subject to l <= C z <= u and l_box <= z <= u_box, by ProxQP (dense, proximal AL).

    ``hessian`` (nz, nz), ``rows`` C (m, nz), ``tolerance`` absolute on both residuals, ``iterations`` the cap on the
    outer and on the inner iterations. The number of iterations decides when it stops, never a clock. Each call of
    :meth:`solve` starts from the result of the one before; after a failure the solver starts afresh.
    """

    def __init__(self, hessian: Array, rows: Array, tolerance: float, iterations: int) -> None:
        self.hessian, self.rows = hessian, rows
        self.tolerance, self.max_iterations = tolerance, iterations
        self.z: Array = np.zeros(hessian.shape[0])
        self.iterations = 0
        self._fresh = True
        self._create()

    def _create(self) -> None:
        size, constraints = self.hessian.shape[0], self.rows.shape[0]
        qp = proxqp.dense.QP(size, 0, constraints, True)
        settings = qp.settings
        settings.eps_abs, settings.eps_rel = self.tolerance, 0.0
        settings.max_iter = settings.max_iter_in = self.max_iterations
        # The program always has a solution; where many bounds are active at once the test for infeasibility (1e-4 by
        # default) would stop it wrongly.
        settings.eps_primal_inf = settings.eps_dual_inf = 1e-14
        settings.compute_timings = False
        settings.verbose = False
        settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._qp = qp
        self._fresh = True

    def reset(self) -> None:
        """Forget all earlier solutions: the next run repeats the first one to the last bit."""
        self._create()
        self.z[:] = 0.0
        self.iterations = 0

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve for gradient ``g`` and bounds; the solution is in :attr:`z`; give SOLVED, MAX_ITERATIONS or FAILED.

        A FAILED call leaves :attr:`z` as it was.
        """
        qp = self._qp
        if self._fresh:
            qp.init(self.hessian, g, None, None, self.rows, lower, upper, box_lower, box_upper)
            self._fresh = False
        else:
            qp.update(g=g, l=lower, u=upper, l_box=box_lower, u_box=box_upper)
        qp.solve()
        info = qp.results.info
        self.iterations = int(info.iter)
        found = qp.results.x
        # A sum is finite only if every entry is.
        if not np.isfinite(found.sum()):
            return self._fail()
        if info.status == proxqp.PROXQP_SOLVED:
            status = SOLVED
        elif info.status == proxqp.PROXQP_MAX_ITER_REACHED and info.pri_res <= ACCEPTED:
            status = MAX_ITERATIONS
        else:
            return self._fail()
        self.z[:] = found
        return status

    def _fail(self) -> int:
        self._create()
        return FAILED
