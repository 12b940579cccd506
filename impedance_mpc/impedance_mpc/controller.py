"""The real-time step of the impedance controller: measurement in, command out, no ROS, no allocation that matters."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from impedance_mpc import forecast, prepare
from impedance_mpc.approach import Approach
from impedance_mpc.books import Books
from impedance_mpc.condense import MILLIMETRE, Weights, program
from impedance_mpc.correction import CorrectionRule
from impedance_mpc.forecast import ForecastRule
from impedance_mpc.parameters import CASCADED, CORRECTED, Parameters
from impedance_mpc.parts import PARTS, Parts
from impedance_mpc.plant import Array, Impedance, pt2_rig
from impedance_mpc.predict import predict
from impedance_mpc.solver import FAILED, Solver
from phil_base.enumerations import Correction, SolverStatus
from phil_base.held import hold


class RigReading(NamedTuple):
    """The rig at t_k."""

    w_tr: float  # m
    v_tr: float  # m/s
    f_tr: float  # N
    reference: float  # m, end of the last ramp that the rig accepted; NaN: as it was commanded
    work: float = 0.0  # J, accumulated by the rig
    impulse: float = 0.0  # N s, likewise


class EnvironmentReading(NamedTuple):
    """The environment at t_k: state of the reduced model (3.41), and its contact point."""

    displacement: Array  # q (n,)
    velocity: Array  # q' (n,)
    acceleration: Array  # q'' (n,)
    held: Array  # f_held (n,)
    w: float  # m
    v: float  # m/s
    f: float  # N, force that acts on it at t_k
    work: float = 0.0  # J, accumulated by the environment
    impulse: float = 0.0  # N s, likewise


@dataclass
class Command:
    """Command of one cycle: references in m, forces in N; ``correction`` is a case of :class:`Correction`.

    ``f_cat`` = ``f_predicted`` + ``f_cor`` (3.45) is the force on the environment at t_(k+1). ``status`` is a
    :class:`SolverStatus`, ``fallbacks`` counts its FALLBACK since the reset.
    """

    u_tr: float = 0.0
    u_tr_next: float = 0.0
    f_tr: float = 0.0
    f_predicted: float = 0.0
    f_cor: float = 0.0
    f_cat: float = 0.0
    f_cor_lower: float = 0.0
    f_cor_upper: float = 0.0
    correction: int = Correction.OFF
    status: int = SolverStatus.SOLVED
    iterations: int = 0
    fallbacks: int = 0


class Problem(NamedTuple):
    """Quadratic program of one cycle (3.56), views that the next cycle overwrites; Hessian and rows are `qp`'s."""

    gradient: Array  # (2 Nc,)
    lower: Array  # (rows,)
    upper: Array  # (rows,)
    box_lower: Array  # (2 Nc,)
    box_upper: Array  # (2 Nc,)


class ImpedanceController:
    """Impedance controller of thesis 3.2.3 for a rig with PT2 position loop and a linear environment.

    ``config`` gives horizons, weights, limits, forecast and correction; ``model`` is the reduced environment (3.1.9)
    with step Ts. Construction designs everything; :meth:`command` is one cycle. ``books`` may be shared with another
    controller that takes turns with this one; it is put together from ``parts``.

    Raises
    ------
    ValueError
        The step of ``model`` is not ``cycle_time``, or the design is impossible.
    """

    def __init__(self, config: Parameters, model: Impedance, books: Books | None = None, parts: Parts = PARTS) -> None:
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
            tolerance=config.correction_tolerance,
        )
        self.control = config.control
        self._share = {"sums": 1.0, "both": 0.5, "work": 0.0}[config.correction_book]
        n_c = config.control_horizon
        rig = pt2_rig(config.rig_natural_frequency_hz, config.rig_damping_ratio, ts, config.rig_delay)
        weights = Weights(**config.weights.model_dump())
        self.program = program(
            predict(rig, model, config.prediction_horizon, n_c), weights, n_c, config.constraint_stride
        )
        self.qp: Solver = parts.solver(
            config.solver,
            self.program.hessian,
            self.program.rows,
            config.qp_tolerance,
            config.qp_max_iterations,
            self.program.softness,
        )
        self._forecast = forecast.design(ForecastRule(**config.forecast.model_dump()), ts)
        self.books = parts.books(ts) if books is None else books
        self._force_ahead, self._prepare, self._bounds = parts.force_ahead, parts.prepare, parts.bounds
        self.result = Command()
        self._ts, self._n_c = ts, n_c
        self._minimum, self._maximum = config.position_minimum / MILLIMETRE, config.position_maximum / MILLIMETRE
        speed, lead = config.velocity_limit / MILLIMETRE, config.acceleration_limit / rig.omega**2 / MILLIMETRE
        limits = np.array([[self._minimum, -speed, -lead], [self._maximum, speed, lead]])
        self._constants = prepare.constants(self.program, rig, model.output, model.compliance, ts, limits)
        self._work = prepare.work(self.program)
        self._box_lower, self._box_upper = np.full(2 * n_c, self._minimum), np.full(2 * n_c, self._maximum)
        self._plan = np.zeros(2 * n_c)  # mm, N
        self._held = hold((self._constants, self._forecast), (self._work, self._plan))
        self._approach = Approach(config.approach_time, ts)
        self.reset()

    def reset(self) -> None:
        """Bring books, plan and solver to the state before cycle 0; runs after it repeat to the last bit."""
        self.books.clear()
        self.result.fallbacks = 0
        self.qp.reset()
        for array in self._work:
            array.fill(0.0)
        self._plan[:] = 0.0
        self._fresh = True
        self._follows = True
        self._apart = True
        self._approach.clear()

    def disengage(self) -> None:
        """Say that the rig does not follow in the cycle of the next command.

        That cycle is not entered into the books and has no correction force, and the target is where the drive is and
        goes as fast as it goes: from there the next followed commands close the gap.
        """
        self._follows = False
        self._apart = True

    def rejoin(self) -> None:
        """Close the gap to the environment anew from the next command on; the rig goes on following."""
        self._apart = True

    def take_over(self, other: ImpedanceController) -> None:
        """Go on where another controller, of another environment, stopped: plan, forecast, correction force, counters.

        Both share the rig's model and the horizons. What the books know of the environment begins anew.
        """
        self.qp.reset()
        self._plan[:] = other._plan
        mine, theirs = self._work, other._work
        mine.now[:] = theirs.now
        mine.now[prepare.F_ENV] = math.nan
        mine.ramps[:] = theirs.ramps
        mine.filter[:] = theirs.filter
        self._fresh = other._fresh
        self.control = other.control
        self.result.fallbacks = other.result.fallbacks
        self.books.forget()
        self.rejoin()

    @property
    def problem(self) -> Problem:
        """The quadratic program behind the last command; the cascaded control solves none."""
        work = self._work
        return Problem(work.g, work.lower, work.upper, self._box_lower, self._box_upper)

    @property
    def plan(self) -> tuple[Array, Array]:
        """The plan behind the last command: u_tr in m (Nc,) and F_cor in N (Nc,)."""
        n_c = self._n_c
        return self._plan[:n_c] * MILLIMETRE, self._plan[n_c:].copy()

    def _take(self, rig: RigReading, environment: EnvironmentReading) -> float:
        """Bring all that is remembered to t_k; give the contact force predicted for t_(k+1), N."""
        fresh, reference = self._fresh, rig.reference
        if fresh:
            self._fresh = False
            if math.isnan(reference):
                reference = rig.w_tr
            self._plan[: self._n_c] = min(max(reference / MILLIMETRE, self._minimum), self._maximum)
            self._work.ramps[:] = reference
            forecast.start(self._forecast, self._work.filter, rig.f_tr, rig.v_tr)
            self._work.now[prepare.W_TR] = rig.w_tr
            self._work.now[prepare.F_ENV] = environment.f
        e = environment
        return float(self._force_ahead(self._held, fresh, rig.w_tr, rig.v_tr, rig.f_tr, reference, e.w, e.v, e.f))

    def command(self, rig: RigReading, environment: EnvironmentReading) -> Command:
        """Compute the command of cycle k from both states at t_k and enter the instant into the books.

        All numbers have to be finite (but for the reference). The object returned is the same one each time.
        """
        n_c, work, books = self._n_c, self._work, self.books
        now = work.now
        predicted = self._take(rig, environment)
        follows, self._follows = self._follows, True
        if self._apart:
            self._apart = False
            self._approach.restart(rig.w_tr - environment.w, rig.v_tr - environment.v)
        if follows:
            books.add(rig.f_tr, rig.v_tr, environment.f, environment.v)
        books.accumulate(rig.work, environment.work, rig.impulse, environment.impulse, counted=follows)
        offset, drift = self._approach.advance()
        if self.control == CASCADED:
            return self._cascade(rig, environment, offset, drift)

        now[prepare.OFFSET], now[prepare.DRIFT_NOW], now[prepare.DELTA_P] = offset, drift, books.delta_p
        before = float(now[prepare.F_COR])
        e = environment
        self._prepare(self._held, e.displacement, e.velocity, e.acceleration, e.held)
        if self.control == CORRECTED and follows:
            # F_cor acts at t_(k+1), when the wire moves as fast as its acceleration has made it by then.
            v_next = environment.v + self._ts * float(self.model.output.dot(environment.acceleration))
            error = self._share * books.delta_e + (1.0 - self._share) * books.delta_work
            low, high, case = self._bounds(self.rule, error, v_next, rig.v_tr, rig.f_tr, before, self._ts)
            # A pantograph cannot pull the wire down.
            low = max(low, min(0.0, -predicted))
            high = max(high, low)
        else:
            low, high, case = 0.0, 0.0, Correction.OFF
        self._box_lower[n_c:] = low
        self._box_upper[n_c:] = high

        status = self.qp.solve(work.g, work.lower, work.upper, self._box_lower, self._box_upper)
        plan = self._plan
        if status == FAILED:
            # The plan of the cycle before, one cycle on; its last entry is held.
            plan[: n_c - 1] = plan[1:n_c].copy()
            plan[n_c:-1] = plan[n_c + 1 :].copy()
            status = SolverStatus.FALLBACK
            self.result.fallbacks += 1
        else:
            plan[:] = self.qp.z
        # A solution keeps its bounds to the tolerance only, and an old plan knows nothing of the new ones.
        # Two calls instead of np.clip, whose way through Python takes three times as long.
        np.maximum(plan, self._box_lower, out=plan)
        np.minimum(plan, self._box_upper, out=plan)
        f_cor = float(plan[n_c])
        now[prepare.F_COR] = f_cor
        u_tr, u_next = float(plan[0]) * MILLIMETRE, float(plan[1]) * MILLIMETRE
        self.result.iterations = self.qp.iterations
        return self._answer(u_tr, u_next, rig.f_tr, predicted, f_cor, (low, high, case), status)

    def _cascade(self, rig: RigReading, environment: EnvironmentReading, offset: float, drift: float) -> Command:
        """Classic cascaded impedance control: the environment, simulated from the measured force as it is, leads.

        Its position is the reference of the position loop, and goes on at its speed until the next one comes.
        """
        low, high = self._minimum * MILLIMETRE, self._maximum * MILLIMETRE
        u_tr = min(max(environment.w + offset, low), high)
        u_next = min(max(environment.w + offset + self._ts * (environment.v + drift), low), high)
        self._plan[: self._n_c] = u_next / MILLIMETRE
        self._plan[0] = u_tr / MILLIMETRE
        # Whoever switches to another control later begins without a correction force, not with that of long ago.
        self._plan[self._n_c :] = 0.0
        self._work.now[prepare.F_COR] = 0.0
        self.result.iterations = 0
        return self._answer(u_tr, u_next, rig.f_tr, rig.f_tr, 0.0, (0.0, 0.0, Correction.OFF), SolverStatus.SOLVED)

    def _answer(
        self,
        u_tr: float,
        u_next: float,
        f_tr: float,
        predicted: float,
        f_cor: float,
        bounds: tuple[float, float, int],
        status: int,
    ) -> Command:
        """Fill in the command; the force on the environment is F_cat = predicted contact force + F_cor (3.45)."""
        result = self.result
        result.u_tr, result.u_tr_next = u_tr, u_next
        result.f_tr, result.f_predicted, result.f_cor, result.f_cat = f_tr, predicted, f_cor, predicted + f_cor
        result.f_cor_lower, result.f_cor_upper, result.correction = bounds
        result.status = status
        return result
