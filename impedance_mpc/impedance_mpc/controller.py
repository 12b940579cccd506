"""The real-time step of the impedance controller: measurement in, command out, no ROS, no allocation that matters."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from impedance_mpc import correction
from impedance_mpc.books import Books
from impedance_mpc.condense import MILLIMETRE, Weights, predict, program
from impedance_mpc.correction import CorrectionRule
from impedance_mpc.parameters import Parameters
from impedance_mpc.plant import Array, Impedance, design_plant, pt2_rig
from impedance_mpc.solver import FAILED, QuadraticProgram

FALLBACK = 2
"""Status of a command that was taken from the plan of the cycle before."""


@dataclass
class Command:
    """Command of one cycle: references in m, forces in N; ``correction`` is a case of :mod:`.correction`.

    ``status`` is SOLVED (0), MAX_ITERATIONS (1) or FALLBACK (2), ``fallbacks`` counts the latter since the reset.
    """

    u_tr: float = 0.0
    u_tr_next: float = 0.0
    f_tr: float = 0.0
    f_cor: float = 0.0
    f_cat: float = 0.0
    f_cor_lower: float = 0.0
    f_cor_upper: float = 0.0
    correction: int = correction.OFF
    status: int = 0
    iterations: int = 0
    fallbacks: int = 0


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def _gradient(gradient_t: Array, p: Array, g: Array) -> None:
    """Compute g = G p, column by column of G, so that the inner loop runs over contiguous memory."""
    for i in range(g.size):
        g[i] = 0.0
    for j in range(p.size):
        factor = p[j]
        for i in range(g.size):
            g[i] += gradient_t[j, i] * factor


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def _drive_bounds(
    row_rig: Array,
    row_step: Array,
    limit_lower: Array,
    limit_upper: Array,
    w_tr: float,
    v_tr: float,
    stop: float,
    lower: Array,
    upper: Array,
) -> None:
    """Set the bounds on the moves' part of the drive's positions and velocities.

    A drive that is already too fast, or too near to its end to stay inside, must not make the program infeasible. The
    plan "the reference stays at ``stop`` (mm) from now on" is always allowed by the box, so each bound is opened as
    far as this plan needs it, and not further: the limits are hard whenever stopping keeps them, and otherwise the
    drive may do nothing worse than to stop.
    """
    for i in range(lower.size):
        free = row_rig[i, 0] * w_tr + row_rig[i, 1] * v_tr
        held = row_step[i] * stop
        lower[i] = min(limit_lower[i] - free, held)
        upper[i] = max(limit_upper[i] - free, held)


class ImpedanceController:
    """Impedance controller of thesis 3.2.3 for a rig with PT2 position loop and a linear environment.

    ``config`` gives horizons, weights, limits and correction; ``model`` is the reduced environment (3.1.9) with
    step Ts. Construction designs everything; :meth:`command` is one cycle.

    Raises
    ------
    ValueError
        The step of ``model`` is not ``cycle_time``, or the design is impossible.
    """

    def __init__(self, config: Parameters, model: Impedance) -> None:
        ts = config.cycle_time
        if abs(model.ts - ts) > 1e-9:
            raise ValueError(f"'cycle_time' = {ts} s is not the impedance model's step of {model.ts} s")
        self.config, self.model = config, model
        self.rule = CorrectionRule(
            alpha=config.correction_alpha,
            cap=config.correction_cap,
            dead_zone=config.correction_dead_zone,
            rate=config.correction_rate_limit * ts,
            instantaneous_term=config.correction_instantaneous_term,
        )
        self.correcting = config.correction
        n_c = config.control_horizon
        plant = design_plant(pt2_rig(config.rig_natural_frequency_hz, config.rig_damping_ratio, ts), model)
        weights = Weights(**config.weights.model_dump())
        prediction = predict(plant, config.prediction_horizon, n_c)
        omega = 2.0 * math.pi * config.rig_natural_frequency_hz
        self._lead = 2.0 * config.rig_damping_ratio / omega  # s
        self.program = program(plant, prediction, weights, n_c, config.constraint_stride, self._lead)
        self.qp = QuadraticProgram(
            self.program.hessian, self.program.rows, config.qp_tolerance, config.qp_max_iterations
        )
        self.books = Books(ts)
        self.result = Command()
        self._ts, self._n_c, self._n = ts, n_c, model.n
        self._minimum, self._maximum = config.position_minimum / MILLIMETRE, config.position_maximum / MILLIMETRE
        speed, lead = config.velocity_limit / MILLIMETRE, config.acceleration_limit / omega**2 / MILLIMETRE
        self._limit_lower: Array = np.array([self._minimum, -speed, -lead])[self.program.kind]
        self._limit_upper: Array = np.array([self._maximum, speed, lead])[self.program.kind]
        self._p = np.zeros(self.program.layout.size)
        self._g = np.zeros(2 * n_c)
        self._lower, self._upper = self._limit_lower.copy(), self._limit_upper.copy()
        self._box_lower = np.full(2 * n_c, self._minimum)
        self._box_upper = np.full(2 * n_c, self._maximum)
        self._plan = np.zeros(2 * n_c)  # mm, N
        self.reset()

    def reset(self) -> None:
        """Bring books, plan and solver to the state before cycle 0; runs after it repeat to the last bit."""
        self.books.clear()
        self.qp.reset()
        self._p[:] = 0.0
        self._plan[:] = 0.0
        self._cycle = 0
        self._gap = 0.0
        self._f_cor = 0.0
        self.result.fallbacks = 0

    def _approach(self) -> tuple[float, float]:
        """Give the target's offset from the wire (m) and its rate (m/s).

        At the start drive and wire need not be at the same height: the gap of cycle 0 is closed along half a cosine,
        instead of by a jump at the current limit.
        """
        t, end = self._cycle * self._ts, self.config.approach_time
        if t >= end:
            return 0.0, 0.0
        phase = math.pi * t / end
        return 0.5 * self._gap * (1.0 + math.cos(phase)), -0.5 * self._gap * math.pi / end * math.sin(phase)

    @property
    def plan(self) -> tuple[Array, Array]:
        """The plan behind the last command: u_tr in m (Nc,) and F_cor in N (Nc,)."""
        n_c = self._n_c
        return self._plan[:n_c] * MILLIMETRE, self._plan[n_c:].copy()

    def command(
        self,
        w_tr: float,
        v_tr: float,
        f_tr: float,
        displacement: Array,
        velocity: Array,
        acceleration: Array,
        held: Array,
        w_cat: float,
        v_cat: float,
        reference: float = math.nan,
    ) -> Command:
        """Compute the command of cycle k from both states at t_k and enter the cycle into the books.

        Parameters are the drive's position (m), velocity (m/s) and contact force (N), the segment's q, q', q'' and
        f_held (each (n,)), the wire's displacement (m) and velocity (m/s) at the contact point, and the inner loop's
        reference at t_k (m; NaN: the one that the command before predicted). All have to be finite otherwise.
        The object returned is the same one each time.
        """
        n_c, p, result = self._n_c, self._p, self.result
        layout, model = self.program.layout, self.model
        if self._cycle == 0:
            self._plan[:n_c] = min(max(w_tr / MILLIMETRE, self._minimum), self._maximum)
            self._gap = w_tr - w_cat
        if math.isnan(reference):
            reference = self._plan[1] * MILLIMETRE
        offset, drift = self._approach()
        self._cycle += 1

        n = self._n
        p[0], p[1] = w_tr, v_tr
        p[2 : 2 + n] = displacement
        p[2 + n : 2 + 2 * n] = velocity
        p[2 + 2 * n : 2 + 3 * n] = acceleration
        p[layout.momentum] = self.books.delta_p
        p[3 + 3 * n : 3 + 4 * n] = held
        at = layout.force
        p[at] = f_tr
        p[at + 1] = w_cat - model.output.dot(displacement) + offset
        p[at + 2] = v_cat - model.output.dot(velocity)
        p[at + 3] = drift
        p[at + 4] = reference
        p[at + 5] = self._f_cor
        _gradient(self.program.gradient_t, p, self._g)

        # A reference that leads by 2 zeta v / omega lets the PT2 start to stop without any acceleration.
        stop = min(max((w_tr + self._lead * v_tr) / MILLIMETRE, self._minimum), self._maximum)
        _drive_bounds(
            self.program.row_rig,
            self.program.row_step,
            self._limit_lower,
            self._limit_upper,
            w_tr,
            v_tr,
            stop,
            self._lower,
            self._upper,
        )
        if self.correcting:
            low, high, case = correction.bounds(self.rule, self.books.delta_e, v_cat, v_tr, f_tr, self._f_cor, self._ts)
        else:
            low, high, case = 0.0, 0.0, correction.OFF
        self._box_lower[n_c:] = low
        self._box_upper[n_c:] = high

        status = self.qp.solve(self._g, self._lower, self._upper, self._box_lower, self._box_upper)
        plan = self._plan
        if status == FAILED:
            # The plan of the cycle before, one cycle on; its last entry is held.
            plan[: n_c - 1] = plan[1:n_c].copy()
            plan[n_c : 2 * n_c - 1] = plan[n_c + 1 :].copy()
            result.status = FALLBACK
            result.fallbacks += 1
        else:
            plan[:] = self.qp.z
            result.status = status
        # A solution keeps its bounds to the tolerance only, and an old plan knows nothing of the new ones.
        np.clip(plan, self._box_lower, self._box_upper, out=plan)

        f_cor = float(plan[n_c])
        self.books.add(f_tr, v_tr, f_cor, v_cat)
        self._f_cor = f_cor
        result.u_tr, result.u_tr_next = float(plan[0]) * MILLIMETRE, float(plan[1]) * MILLIMETRE
        result.f_tr, result.f_cor, result.f_cat = f_tr, f_cor, f_tr + f_cor
        result.f_cor_lower, result.f_cor_upper, result.correction = low, high, case
        result.iterations = self.qp.iterations
        return result
