"""The quadratic program of one cycle: set up once, warm-started from the active set before, deterministic."""

from __future__ import annotations

from typing import Protocol

import daqp
import numpy as np

from impedance_mpc.optimality import distances, optimal
from impedance_mpc.plant import Array
from phil_base.enumerations import SolverStatus

SOLVED = SolverStatus.SOLVED
"""Solved."""
FAILED = SolverStatus.FALLBACK
"""No usable solution: contradictory bounds, out of iterations, not finite, or not what was asked for."""

_OPTIMAL = (1, 2)
"""DAQP's flags of a solution: without, and with a soft row violated."""
_SOFT = 8
"""DAQP's mark of a constraint that may be violated at a cost."""


DAQP, PROXQP = "daqp", "proxqp"


class Solver(Protocol):
    """What solves the programs of a ride, one a cycle; see :class:`QuadraticProgram` for what is asked of it."""

    hessian: Array
    rows: Array
    softness: Array | None
    tolerance: float
    max_iterations: int
    z: Array
    """The newest solution."""
    iterations: int
    """Those of the newest call, of whatever kind the solver counts."""

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve for gradient and bounds; give SOLVED or FAILED."""

    def reset(self) -> None:
        """Forget all earlier solutions."""


class SolverMaker(Protocol):
    """What makes a solver from its name, Hessian, rows, tolerance, iterations and softness: :func:`solver_of`."""

    def __call__(
        self,
        name: str,
        hessian: Array,
        rows: Array,
        tolerance: float,
        iterations: int,
        softness: Array | None = None,
        /,
    ) -> Solver:
        """Give the solver."""


def solver_of(
    name: str, hessian: Array, rows: Array, tolerance: float, iterations: int, softness: Array | None = None
) -> Solver:
    """Give the solver of that name, DAQP or PROXQP, for programs with this Hessian and these rows.

    Raises
    ------
    ValueError
        There is no such solver, ProxSuite is not installed, the Hessian is not positive definite, or a number is not
        finite.
    """
    if name == DAQP:
        return QuadraticProgram(hessian, rows, tolerance, iterations, softness)
    if name != PROXQP:
        raise ValueError(f"'solver' = {name} is none: daqp or proxqp")
    # Only for who wants it: it takes a third of a second.
    from impedance_mpc.proxqp import ProximalProgram

    try:
        return ProximalProgram(hessian, rows, tolerance, iterations, softness)
    except ImportError as error:
        raise ValueError(f"'solver' = proxqp needs the package proxsuite: {error}") from None


class QuadraticProgram:
    """min 1/2 z' H z + g' z subject to l <= C z <= u and l_box <= z <= u_box, by DAQP (dense, dual active set): (3.56).

    ``hessian`` (nz, nz), ``rows`` C (m, nz), ``iterations`` the cap on changes of the active set; their number decides
    when it stops, never a clock. Each call of :meth:`solve` starts from the active set of the one before and keeps its
    factors; where that leads nowhere, and after a failure, it starts afresh.

    ``tolerance`` is what a constraint may be broken by before the solver sees it, in the units of z: rows are scaled so
    that it is the way that z would go to mend it (:func:`.optimality.distances`), whatever a row's own unit. Solutions
    from different starts differ by about as much where a bound is that near, by rounding elsewhere.

    ``softness`` (m,) makes a row soft where it is positive: it may be violated by s at the cost of 1/2 softness s^2
    (per side, in the units of the row). Needs no slack variables: in the dual it adds 1 / softness to the diagonal.

    Arnstrom, Bemporad, Axehill: A dual active-set solver for embedded quadratic programming using recursive LDL'
    updates, IEEE Trans. Automatic Control 67 (2022) 4362-4369.

    Raises
    ------
    ValueError
        The Hessian is not positive definite, or a number is not finite.
    """

    def __init__(
        self, hessian: Array, rows: Array, tolerance: float, iterations: int, softness: Array | None = None
    ) -> None:
        self.hessian, self.rows = np.ascontiguousarray(hessian), np.ascontiguousarray(rows)
        self.tolerance, self.max_iterations, self.softness = tolerance, iterations, softness
        self._size = size = hessian.shape[0]
        self.z: Array = np.zeros(size)
        self.iterations = 0
        count = rows.shape[0]
        self._soft = np.zeros(count, np.bool_) if softness is None else softness > 0.0
        compliance = np.zeros(count)
        if softness is not None:
            compliance[self._soft] = 1.0 / softness[self._soft]
        self._scale = distances(self.hessian, self.rows, compliance)
        self._scaled = np.ascontiguousarray(self.rows * self._scale[:, None])
        self._compliance = compliance * self._scale**2
        # The solver keeps pointers to these: filled in place, never replaced. The box comes first, as it wants it.
        self._g: Array = np.zeros(size)
        self._lower: Array = np.zeros(size + count)
        self._upper: Array = np.zeros(size + count)
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
        sense[self._size :][self._soft] = _SOFT
        flag, _ = model.setup(self.hessian, self._g, self._scaled, self._upper, self._lower, sense)
        if flag < 0:
            return False
        if self._soft.any():
            reciprocal = np.concatenate([np.zeros(self._size), self._compliance])
            model.soft_weights(rho_l=reciprocal, rho_u=reciprocal)
        self._model = model
        self._fresh = False
        return True

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve for gradient ``g`` and bounds; the solution is in :attr:`z`; give SOLVED or FAILED.

        A FAILED call leaves :attr:`z` as it was. It fails on a gradient that is not finite, on a bound that is NaN, and
        on a lower one above its upper one by more than the tolerance; infinite is no bound. SOLVED is said of what
        fulfils the conditions of optimality, whatever the solver says of it.
        """
        self._g[:] = g
        self._box_lower[:], self._box_upper[:] = box_lower, box_upper
        np.multiply(lower, self._scale, out=self._row_lower)
        np.multiply(upper, self._scale, out=self._row_upper)
        self.iterations = 0
        if not self._fresh:
            # What update refuses, the model would silently solve without from now on.
            if self._model.update(f=self._g, bupper=self._upper, blower=self._lower) < 0:
                return self._fail()
            if self._run():
                return SOLVED
        # The first time; or the active set before is no start: one of its bounds has become infinite, or it cycles.
        return SOLVED if self._create() and self._run() else self._fail()

    def _run(self) -> bool:
        """Solve the model as it is now; tell whether :attr:`z` is the solution."""
        found, _, flag, info = self._model.solve()
        self.iterations += info["iterations"]
        good = flag in _OPTIMAL and optimal(
            self.hessian,
            self._scaled,
            self._compliance,
            self._g,
            self._lower,
            self._upper,
            found,
            info["lam"],
            self.tolerance,
        )
        if good:
            self.z[:] = found
        return bool(good)

    def _fail(self) -> int:
        self._fresh = True
        return FAILED
