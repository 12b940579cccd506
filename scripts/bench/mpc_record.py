"""Records the quadratic programs of the impedance controller as they come up in a closed-loop ride."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.closed_loop import ClosedLoop
from bench.mpc_problems import Problem, Sequence
from impedance_mpc.controller import ImpedanceController

Array = NDArray[np.float64]


def watch(controller: ImpedanceController) -> list[Problem]:
    """Let the controller note each problem that it solves from now on, in a list that grows."""
    noted: list[Problem] = []
    solve = controller.qp.solve

    def noting(g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        noted.append((g.copy(), lower.copy(), upper.copy(), box_lower.copy(), box_upper.copy()))
        return solve(g, lower, upper, box_lower, box_upper)

    controller.qp.solve = noting  # type: ignore[method-assign]
    return noted


def record(loop: ClosedLoop, cycles: int) -> Sequence:
    """Ride these cycles and keep their problems."""
    noted = watch(loop.controller)
    for _ in loop.cycles(cycles):
        pass
    gradient, lower, upper, box_lower, box_upper = (np.array(column) for column in zip(*noted, strict=True))
    qp = loop.controller.qp
    return Sequence(
        hessian=qp.hessian,
        rows=qp.rows,
        gradient=gradient,
        lower=lower,
        upper=upper,
        box_lower=box_lower,
        box_upper=box_upper,
        correction=loop.controller.config.control_horizon,
        softness=qp.softness,
        tolerance=qp.tolerance,
        iterations=qp.max_iterations,
    )
