"""One cycle of the controller: from what rig and catenary show at t_k to all that the command says. No ROS.

The node and the closed loop of `phil_loop` both ride by this.
"""

from __future__ import annotations

from typing import NamedTuple

from impedance_mpc.controller import EnvironmentReading, RigReading
from impedance_mpc.parameters import Parameters
from impedance_mpc.parts import PARTS, Parts
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import EnvironmentSwitch
from phil_base.enumerations import FOLLOWING, SolverStatus

BOOKS_EVERY = 10
"""Cycles from one message of the conserved quantities to the next."""
MOST_ITERATIONS = 65535
"""What the message's number of iterations goes to."""


class Answer(NamedTuple):
    """Command of one cycle, in the order and the units of the message ImpedanceCommand."""

    u_tr: float  # m
    u_tr_next: float  # m
    f_tr: float  # N
    f_predicted: float  # N
    f_cor: float  # N
    f_cat: float  # N, force on the catenary at t_(k+1)
    f_cor_lower: float  # N
    f_cor_upper: float  # N
    correction: int
    environment: int
    status: int
    iterations: int  # 1
    fallbacks: int  # 1
    w_env: float  # m
    v_env: float  # m/s


class ControllerCycle:
    """The controllers of all environments with their switch and their books, cycle by cycle.

    ``model`` is the catenary's reduced model, the controllers are put together from ``parts``.

    Raises
    ------
    ValueError
        A model does not fit the controller, or is not stable on its own.
    """

    def __init__(self, config: Parameters, model: Impedance, parts: Parts = PARTS) -> None:
        self.switch = EnvironmentSwitch(config, model, parts)
        self.books = self.switch.books

    def reset(self) -> None:
        """Go back to before cycle 0."""
        self.switch.reset()

    def answer(self, rig: RigReading, wire: EnvironmentReading, mode: int) -> Answer:
        """Give the command of cycle k from both states at t_k; ``mode`` is that of the rig (`RigState.mode`)."""
        switch = self.switch
        result = switch.command(rig, wire, mode in FOLLOWING)
        return Answer(
            result.u_tr,
            result.u_tr_next,
            result.f_tr,
            result.f_predicted,
            result.f_cor,
            switch.force_on_catenary,
            result.f_cor_lower,
            result.f_cor_upper,
            result.correction,
            switch.active,
            result.status,
            0 if result.status == SolverStatus.FALLBACK else min(result.iterations, MOST_ITERATIONS),
            result.fallbacks,
            switch.w,
            switch.v,
        )
