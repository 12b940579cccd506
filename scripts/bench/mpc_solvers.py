"""Solvers of quadratic programs, each as its own Python interface is meant to be used in a loop of like problems.

All are given the same data and keep whatever they can keep from one problem to the next: factors, scaling, the solution
or the active set before. Tolerances are set so that the first move is good to about 1 um and 0.05 N in a usual ride,
or as good as the solver gets; active-set methods are exact anyway.
"""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from bench.mpc_problems import Sequence

Array = NDArray[np.float64]
NEVER = 1e20
"""What most solvers take for infinite."""


def crossed(lower: Array, upper: Array) -> bool:
    """Tell whether a lower bound is above its upper one: some solvers go on with the bounds before and say solved."""
    return bool((lower > upper).any())


class Solver(Protocol):
    """One solver at work; made for a sequence of problems, called once for each."""

    z: Array
    """The solution of the problem before."""

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """Solve the next problem, tell whether the solver says it is solved; the contest judges by itself."""


class Controller:
    """One of the controller's own classes, with the parameters of the ride."""

    def __init__(self, sequence: Sequence, name: str) -> None:
        from impedance_mpc.solver import FAILED, solver_of

        self._qp = solver_of(
            name, sequence.hessian, sequence.rows, sequence.tolerance, sequence.iterations, sequence.softness
        )
        self._failed = FAILED
        self.z = self._qp.z

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        return self._qp.solve(g, lower, upper, box_lower, box_upper) != self._failed


class Daqp:
    """DAQP: dense dual active set, recursive LDL' updates; keeps active set and factors."""

    def __init__(self, sequence: Sequence) -> None:
        import daqp

        self._matrices = sequence.hessian, sequence.rows
        self._size = size = sequence.hessian.shape[0]
        self._g = np.zeros(size)
        self._lower, self._upper = np.zeros(size + sequence.rows.shape[0]), np.zeros(size + sequence.rows.shape[0])
        self._model = daqp.Model()
        self._model.settings = {"eps_prox": 0.0, "iter_limit": 500}
        self._fresh = True
        self.z = np.zeros(size)

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        size = self._size
        self._g[:] = g
        self._lower[:size], self._lower[size:] = box_lower, lower
        self._upper[:size], self._upper[size:] = box_upper, upper
        if self._fresh:
            hessian, rows = self._matrices
            flag, _ = self._model.setup(hessian, self._g, rows, self._upper, self._lower)
        else:
            flag = self._model.update(f=self._g, bupper=self._upper, blower=self._lower)
        if flag >= 0:  # what it refuses, it would leave out and call the rest optimal
            self.z, _, flag, _ = self._model.solve()
        self._fresh = flag not in (1, 2)
        return not self._fresh


class ProxQP:
    """ProxQP (ProxSuite): dense proximal augmented Lagrangian; starts from the solution before."""

    TOLERANCE, GAP, ITERATIONS = 1e-8, 1e-4, 100

    def __init__(self, sequence: Sequence, build: str = "") -> None:
        self._proxqp = proxsuite_build(build).proxqp
        self._matrices = sequence.hessian, sequence.rows
        self._begin()
        self.z = np.zeros(sequence.hessian.shape[0])

    def _begin(self) -> None:
        proxqp, (hessian, rows) = self._proxqp, self._matrices
        self._qp = proxqp.dense.QP(hessian.shape[0], 0, rows.shape[0], True)
        settings = self._qp.settings
        settings.eps_abs, settings.eps_rel = self.TOLERANCE, 0.0
        settings.max_iter = settings.max_iter_in = self.ITERATIONS
        # The test for infeasibility would stop programs that have a solution where many bounds are active at once.
        settings.eps_primal_inf = settings.eps_dual_inf = 1e-14
        # Else it may stop with the solution before, after no iteration at all.
        settings.check_duality_gap = True
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = self.GAP, 0.0
        settings.initial_guess = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self._fresh = True

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        qp = self._qp
        lower, box_lower = np.maximum(lower, -NEVER), np.maximum(box_lower, -NEVER)
        upper, box_upper = np.minimum(upper, NEVER), np.minimum(box_upper, NEVER)
        if self._fresh:
            hessian, rows = self._matrices
            qp.init(hessian, g, None, None, rows, lower, upper, box_lower, box_upper)
            self._fresh = False
        else:
            qp.update(g=g, l=lower, u=upper, l_box=box_lower, u_box=box_upper)
        qp.solve()
        self.z = qp.results.x
        solved = bool(qp.results.info.status == self._proxqp.PROXQP_SOLVED)
        if not solved:
            self._begin()
        return solved


class Osqp:
    """OSQP: sparse operator splitting; keeps the factors, starts from the solution before."""

    def __init__(self, sequence: Sequence) -> None:
        import osqp

        self._osqp = osqp
        size = sequence.hessian.shape[0]
        self._cost = sparse.csc_matrix(np.triu(sequence.hessian))
        self._rows = sparse.csc_matrix(np.vstack([sequence.rows, np.eye(size)]))
        self._fresh = True
        self.z = np.zeros(size)

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        low, high = np.concatenate([lower, box_lower]), np.concatenate([upper, box_upper])
        if crossed(low, high):
            return False
        if self._fresh:
            self._solver = self._osqp.OSQP()
            self._solver.setup(
                self._cost,
                g,
                self._rows,
                low,
                high,
                verbose=False,
                eps_abs=2e-5,
                eps_rel=0.0,
                max_iter=20000,
                check_termination=10,
                # Steps by iterations, not by the clock as is usual: else no two runs are equal.
                adaptive_rho_interval=50,
            )
            self._fresh = False
        else:
            self._solver.update(q=g, l=low, u=high)
        result = self._solver.solve(raise_error=False)
        self.z = result.x
        return bool(result.info.status_val == self._osqp.SolverStatus.OSQP_SOLVED)


class Piqp:
    """PIQP: dense proximal interior point; keeps memory and scaling, an interior point has no warm start."""

    def __init__(self, sequence: Sequence) -> None:
        import piqp

        self._matrices = np.asfortranarray(sequence.hessian), np.asfortranarray(sequence.rows)
        self._solved = piqp.PIQP_SOLVED
        self._solver = piqp.DenseSolver()
        settings = self._solver.settings
        settings.eps_abs, settings.eps_rel = 1e-7, 0.0
        settings.eps_duality_gap_abs, settings.eps_duality_gap_rel = 1e-7, 0.0
        settings.preconditioner_reuse_on_update = True
        self._fresh = True
        self.z = np.zeros(sequence.hessian.shape[0])

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        if self._fresh:
            hessian, rows = self._matrices
            self._solver.setup(hessian, g, None, None, rows, lower, upper, box_lower, box_upper)
            self._fresh = False
        else:
            self._solver.update(c=g, h_l=lower, h_u=upper, x_l=box_lower, x_u=box_upper)
        status = self._solver.solve()
        self.z = self._solver.result.x
        return bool(status == self._solved)


class Qpalm:
    """QPALM: sparse proximal augmented Lagrangian with a semismooth Newton method; starts from the solution before."""

    def __init__(self, sequence: Sequence) -> None:
        import qpalm

        size, count = sequence.hessian.shape[0], sequence.rows.shape[0]
        self._data = qpalm.Data(size, size + count)
        self._data.Q = sparse.csc_matrix(sequence.hessian)
        self._data.A = sparse.csc_matrix(np.vstack([sequence.rows, np.eye(size)]))
        self._settings = qpalm.Settings()
        self._settings.eps_abs, self._settings.eps_rel = 1e-5, 0.0
        self._settings.eps_abs_in, self._settings.eps_rel_in = 1e-2, 0.0
        self._settings.verbose = 0
        self._make = qpalm.Solver
        self._solver: Any = None
        self.z, self._y = np.zeros(size), np.zeros(size + count)

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        low = np.maximum(np.concatenate([lower, box_lower]), -NEVER)
        high = np.minimum(np.concatenate([upper, box_upper]), NEVER)
        if crossed(low, high):
            return False
        if self._solver is None:
            self._data.q, self._data.bmin, self._data.bmax = g, low, high
            self._solver = self._make(self._data, self._settings)
        else:
            self._solver.update_q(g)
            self._solver.update_bounds(low, high)
            self._solver.warm_start(self.z, self._y)
        self._solver.solve()
        self.z, self._y = np.array(self._solver.solution.x), np.array(self._solver.solution.y)
        return bool(self._solver.info.status_val == 1)


class OneSided:
    """Rows N z <= b of those bounds that are finite anywhere in a sequence."""

    def __init__(self, sequence: Sequence) -> None:
        normals = np.vstack([sequence.rows, np.eye(sequence.hessian.shape[0])])
        self._high = np.isfinite(np.hstack([sequence.upper, sequence.box_upper])).any(axis=0)
        self._low = np.isfinite(np.hstack([sequence.lower, sequence.box_lower])).any(axis=0)
        self.normals: Array = np.vstack([normals[self._high], -normals[self._low]])

    def bounds(self, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> Array:
        """Give b of one problem."""
        high = np.concatenate([upper, box_upper])[self._high]
        low = np.concatenate([lower, box_lower])[self._low]
        return np.concatenate([high, -low])


class Clarabel:
    """Clarabel: sparse interior point; keeps memory and the symbolic factors."""

    def __init__(self, sequence: Sequence) -> None:
        import clarabel

        self._clarabel = clarabel
        self._one_sided = OneSided(sequence)
        self._matrices = sparse.csc_matrix(np.triu(sequence.hessian)), sparse.csc_matrix(self._one_sided.normals)
        self._settings = clarabel.DefaultSettings()
        self._settings.verbose = self._settings.presolve_enable = False
        self._settings.tol_gap_rel = self._settings.tol_gap_abs = 1e-10
        self._solver: Any = None
        self.z = np.zeros(sequence.hessian.shape[0])

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        b = self._one_sided.bounds(lower, upper, box_lower, box_upper)
        if self._solver is None:
            cones = [self._clarabel.NonnegativeConeT(b.size)]
            cost, normals = self._matrices
            self._solver = self._clarabel.DefaultSolver(cost, g, normals, b, cones, self._settings)
        else:
            self._solver.update(q=g, b=b)
        solution = self._solver.solve()
        self.z = np.array(solution.x)
        return bool(solution.status == self._clarabel.SolverStatus.Solved)


class Quadprog:
    """quadprog: dense dual active set of Goldfarb and Idnani; is handed the inverse Cholesky factor, starts cold."""

    ROOM = 1e-9
    """mm, N: it takes a box without any width for contradictory."""

    def __init__(self, sequence: Sequence) -> None:
        import quadprog

        self._solve_qp = quadprog.solve_qp
        self._one_sided = OneSided(sequence)
        self._normals = np.ascontiguousarray(-self._one_sided.normals.T)
        self._factor = np.linalg.inv(np.linalg.cholesky(sequence.hessian).T)
        self.z = np.zeros(sequence.hessian.shape[0])

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> bool:
        """See :class:`Solver`."""
        b = -self._one_sided.bounds(lower, upper, box_lower, box_upper) - self.ROOM
        try:
            self.z = self._solve_qp(self._factor, -g, self._normals, b, 0, True)[0]
        except ValueError:
            return False
        return True


def proxsuite_build(build: str) -> Any:
    """Load one of ProxSuite's builds: '' for 16-byte vectors, '_avx2', '_avx512'; one a process.

    Where the package is loaded already, by the controller, its own choice is given: a second build would end it all.

    Raises
    ------
    ImportError
        ProxSuite is not there, or not in this build.
    """
    if "proxsuite" in sys.modules:
        return sys.modules["proxsuite"]
    name = f"proxsuite_pywrap{build}"
    package = find_spec("proxsuite")
    for folder in (package.submodule_search_locations or []) if package else []:
        for suffix in EXTENSION_SUFFIXES:
            path = Path(folder) / f"{name}{suffix}"
            if path.is_file():
                return sys.modules.get(name) or _loaded(name, path)
    raise ImportError(f"proxsuite is not installed, or has no build '{name}'")


def _loaded(name: str, path: Path) -> Any:
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} cannot be loaded")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.modules[name] = module
    return module


@dataclass(frozen=True)
class Known:
    """A solver that can take part."""

    package: str
    """Name on the package index."""
    make: Callable[[Sequence], Solver]
    kind: str
    """Method, and what it keeps from one problem to the next."""
    soft_rows: bool = False
    """Knows soft rows; others are given the same problem with variables of their own for them."""


CONTROLLER, PROXIMAL = "the controller's", "the controller's, ProxQP"
SOLVERS: dict[str, Known] = {
    CONTROLLER: Known(
        "daqp",
        lambda sequence: Controller(sequence, "daqp"),
        "DAQP as the controller calls it, soft rows",
        soft_rows=True,
    ),
    PROXIMAL: Known(
        "proxsuite",
        lambda sequence: Controller(sequence, "proxqp"),
        "ProxQP as the controller calls it: soft rows, active bounds made exact",
        soft_rows=True,
    ),
    "DAQP": Known("daqp", Daqp, "dual active set; active set, factors"),
    "ProxQP": Known("proxsuite", ProxQP, "augmented Lagrangian; solution, scaling"),
    "ProxQP, AVX2": Known("proxsuite", lambda sequence: ProxQP(sequence, "_avx2"), "the same, its build for AVX2"),
    "quadprog": Known("quadprog", Quadprog, "dual active set; factor of H"),
    "PIQP": Known("piqp", Piqp, "interior point; scaling, memory"),
    "QPALM": Known("qpalm", Qpalm, "augmented Lagrangian; solution, factors"),
    "Clarabel": Known("clarabel", Clarabel, "interior point; symbolic factors"),
    "OSQP": Known("osqp", Osqp, "operator splitting; solution, factors"),
}
"""All solvers, the controller's own first."""


def version(name: str) -> str | None:
    """Give the version of a solver's package, None if it is not installed."""
    try:
        return importlib.metadata.version(SOLVERS[name].package)
    except importlib.metadata.PackageNotFoundError:
        return None
