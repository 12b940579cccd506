"""Records the quadratic programs of the impedance controller as they come up in a closed-loop ride."""

from __future__ import annotations

import numpy as np

from bench.mpc_problems import Problem, Sequence
from impedance_mpc.controller import ImpedanceController
from phil_loop import ClosedLoop, Moment


def controller_of(loop: ClosedLoop) -> ImpedanceController:
    """Give the controller at work; raises ValueError if the loop has another one than ours."""
    if loop.control is None:
        raise ValueError("the loop's controller is not impedance_mpc")
    return loop.control.switch.controller


class Programs:
    """An observer that keeps the problem of each cycle."""

    def __init__(self) -> None:
        self.noted: list[Problem] = []

    def __call__(self, moment: Moment) -> None:
        """Copy the problem behind the command."""
        g, lower, upper, box_lower, box_upper = controller_of(moment.loop).problem
        self.noted.append((g.copy(), lower.copy(), upper.copy(), box_lower.copy(), box_upper.copy()))


def record(loop: ClosedLoop, cycles: int) -> Sequence:
    """Ride these cycles from the first one on and keep their problems."""
    programs = Programs()
    loop.observers.append(programs)
    try:
        loop.begin(0.0).run(cycles)
    finally:
        loop.observers.remove(programs)
    gradient, lower, upper, box_lower, box_upper = (np.array(column) for column in zip(*programs.noted, strict=True))
    controller = controller_of(loop)
    qp = controller.qp
    return Sequence(
        hessian=qp.hessian,
        rows=qp.rows,
        gradient=gradient,
        lower=lower,
        upper=upper,
        box_lower=box_lower,
        box_upper=box_upper,
        correction=controller.config.control_horizon,
        softness=qp.softness,
        tolerance=qp.tolerance,
        iterations=qp.max_iterations,
    )
