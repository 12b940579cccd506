"""The closed loop of one ride in one process: the cycle functions of the nodes, one after the other, without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import isfinite
from time import perf_counter_ns
from typing import Any, Protocol

from catenary_model.build import MovingCatenary
from catenary_model.build import build as build_catenary
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from catenary_model.sequence import LARGEST_FORCE
from impedance_mpc.controller import EnvironmentReading, RigReading
from impedance_mpc.cycle import Answer, ControllerCycle
from impedance_mpc.parameters import CORRECTED, INTEGRATED
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.plant import Impedance
from impedance_mpc.solver import SolverMaker, solver_of
from phil_base.enumerations import FOLLOWING, SolverStatus
from phil_base.guard import LARGEST
from phil_base.parameters import ParameterError, build
from phil_loop.controllers import Commander, Controller, Own
from phil_loop.events import Events, by_cycle
from phil_loop.record import Record
from phil_loop.rows import Rows
from test_rig_sim.cycle import ENDLESS, RigCycle, last_cycle_of
from test_rig_sim.operation import unlimited
from test_rig_sim.parameters import Parameters as RigParameters
from test_rig_sim.rig import Rig, RigSample


class Moment:
    """A cycle as an observer sees it: everything at t_k, the command of cycle k, and nothing moved yet.

    One object for the whole ride, and the arrays in ``wire`` are views: copy what is to be kept.
    """

    __slots__ = ("command", "cycle", "loop", "mode", "rig", "wire")

    loop: ClosedLoop
    cycle: int
    """k."""
    mode: int
    """What the drive did until t_k, `RigState.mode`."""
    rig: RigSample
    """The rig at t_k, with what only a simulation knows."""
    wire: EnvironmentReading
    """The catenary at t_k, with the segment."""
    command: Answer
    """The command of cycle k."""

    @property
    def following(self) -> bool:
        """Whether the rig did as it was told until t_k."""
        return self.mode in FOLLOWING


class Observer(Protocol):
    """Called once a cycle; may call `ClosedLoop.stop`."""

    def __call__(self, moment: Moment, /) -> object:
        """Take what happened."""


def impedance_of(catenary: MovingCatenary) -> Impedance:
    """Give the reduced model that the controller is designed for, as the message ImpedanceModel has it."""
    red = catenary.reduced
    ts, compliance = catenary.config.cycle_time, catenary.local_compliance
    return Impedance(red.M, red.D, red.K, red.b, red.b, ts, NEWMARK_BETA, NEWMARK_GAMMA, compliance)


class ClosedLoop:
    """Catenary, controller and rig of one ride, from the parameters of all nodes (`settings`).

    ``controller`` takes the place of ours. ``observers`` are called in each cycle. Without ``limits`` the drive follows
    each command as it is: nothing is refused, cut or smoothed, and no limit ends the ride. ``solver`` makes the solvers
    of our controller's quadratic programs.

    ``catenary``, ``rig`` and ``control`` (our controller with its switch of environments; None with another one) may be
    looked at.

    Raises
    ------
    ValueError
        The parameters describe what cannot be built.
    """

    def __init__(
        self,
        settings: Mapping[str, Mapping[str, Any]],
        controller: Controller | None = None,
        *,
        observers: Iterable[Observer] = (),
        limits: bool = True,
        solver: SolverMaker = solver_of,
    ) -> None:
        self.settings = {node: dict(values) for node, values in settings.items()}
        self.observers = list(observers)
        wire = build(CatenaryParameters, self.settings["catenary_model"], "catenary_model")
        self._control = build(ControllerParameters, self.settings["impedance_mpc"], "impedance_mpc")
        self._parameters = build(RigParameters, self.settings["test_rig_sim"], "test_rig_sim")
        self.ts = self._parameters.cycle_time
        self.catenary = build_catenary(wire.config())
        self.rig_cycle = RigCycle(self._parameters)
        if not limits:
            self.rig_cycle.rules = unlimited(self.rig_cycle.rules)
        self.control: ControllerCycle | None = None
        self._commander: Commander
        if controller is None:
            self._commander = self.control = ControllerCycle(self._control, impedance_of(self.catenary), solver)
        else:
            self._commander = Own(controller, self.ts)
        self.reset()

    # What an operator can do -----------------------------------------------------------------------------------

    def land(self) -> bool:
        """Part softly from the pantograph and rest there; False if the drive retracts or rests already."""
        return self.rig_cycle.supervisor.land()

    def emergency_stop(self) -> None:
        """Go to the safe position and rest there."""
        self.rig_cycle.supervisor.retract("emergency stop")

    def select_operation(self, name: str) -> None:
        """Choose the rig's operating mode: hold, position or impedance. Raises ValueError for another one."""
        self.rig_cycle.supervisor.select(name)

    def select_environment(self, name: str) -> None:
        """Let the drive follow another environment, one of `ENVIRONMENTS`, from the next command on.

        Raises
        ------
        ValueError
            There is none of that name, or the controller is not ours.
        """
        self._ours("environments").switch.select(name)

    def set_control(self, name: str) -> None:
        """Choose the control scheme from the next command on.

        Raises
        ------
        ParameterError
            There is none of that name.
        ValueError
            The controller is not ours.
        """
        control = self._ours("control schemes")
        build(ControllerParameters, self.settings["impedance_mpc"] | {"control": name}, "impedance_mpc")
        control.switch.set_control(name)

    def _ours(self, what: str) -> ControllerCycle:
        if self.control is None:
            raise ValueError(f"the controller in place of impedance_mpc has no {what}")
        return self.control

    def set_correction(self, on: bool) -> None:
        """Switch the correction force on or off from the next command on; raises ValueError if it is not ours."""
        self.set_control(CORRECTED if on else INTEGRATED)

    def set_uplift_force(self, force: float) -> None:
        """Change the pantograph's uplift force (N) within 0.2 s. Raises ParameterError if it is out of range."""
        build(RigParameters, self.settings["test_rig_sim"] | {"uplift_force": force}, "test_rig_sim")
        self.rig.set_uplift_force(float(force))

    def stop(self) -> None:
        """End the ride with this cycle: for observers."""
        self._stopped = True

    # The ride --------------------------------------------------------------------------------------------------

    @property
    def rig(self) -> Rig:
        """The simulated rig."""
        return self.rig_cycle.rig

    def reset(self) -> None:
        """Go back to cycle 0 of the same ride, whatever was changed during the last one."""
        self.catenary.reset()
        self.rig.set_uplift_force(self._parameters.uplift_force)
        self.rig_cycle.restart(self._parameters)
        if self.control is not None:
            self.control.switch.set_control(self._control.control)
            self.control.switch.select(self._control.environment)
        self._commander.reset()
        self._stopped = False

    def ride(self, duration: float | None = None, events: Events | None = None, *, timed: bool = False) -> Record:
        """Ride from cycle 0 for ``duration`` s (else that of the settings) to the end, as the nodes do in lockstep.

        With `land_at_end` the landing begins after the duration. ``events`` are done on the way, see `events`. A ride
        begins anew: two of them are equal to the last bit. ``timed``: note what each part took.

        Raises
        ------
        ParameterError
            The duration is out of range, or 0 (endless).
        ValueError
            An event's time is negative or no number.
        """
        self.reset()
        rig = self.rig_cycle
        rig.last_cycle = self._last_cycle(duration)
        due = by_cycle(events or {}, self.ts)
        rows = Rows(rig.last_cycle + 1)
        stuck = self._cycles(rows, due, timed)
        if rig.last:
            rig.supervisor.finish()
        outcome = "stuck" if stuck else "stopped" if self._stopped and not rig.last else rig.outcome
        return rows.record(self.ts, outcome, stuck or rig.supervisor.reason, self.settings, timed)

    def _last_cycle(self, duration: float | None) -> int:
        p = self._parameters
        if duration is not None:
            p = build(RigParameters, self.settings["test_rig_sim"] | {"duration": duration}, "test_rig_sim")
        last = last_cycle_of(p.duration, p.cycle_time)
        if last == ENDLESS:
            raise ParameterError("test_rig_sim: parameter 'duration' = 0.0 is endless: a ride of the loop needs an end")
        return last

    def _cycles(self, rows: Rows, due: Mapping[int, tuple[Any, ...]], timed: bool) -> str:
        """Ride; say what a node would refuse if there is such a thing, else nothing."""
        rig, catenary, commander = self.rig_cycle, self.catenary, self._commander
        books, observers = commander.books, self.observers
        supervisor = rig.supervisor
        signals, point, counter = rig.rig.signals, catenary.state.point, catenary.state.counter
        q, qd, qdd, held = catenary.state.segment
        moment = Moment()
        moment.loop = self
        state, k = rig.state, 0
        while True:
            if k in due:
                for action in due[k]:
                    action(self)
            begun = perf_counter_ns()
            w, v, _, f, _, work, impulse = point.tolist()
            problem = _unusable(state, w, v, f, work, impulse)
            if problem:
                return f"state {k} of the {problem}"
            wire = EnvironmentReading(q, qd, qdd, held, w, v, f, work, impulse)
            mode = rig.mode
            answer = commander.answer(
                RigReading(state.w_tr, state.v_tr, state.f_tr, state.reference, state.work, state.impulse), wire, mode
            )
            solved = perf_counter_ns()
            rows.note(k, mode, signals, point, counter, answer, books.totals)
            for observe in observers:
                moment.cycle, moment.mode, moment.rig, moment.wire, moment.command = k, mode, state, wire, answer
                observe(moment)
            if not abs(answer.f_cat) <= LARGEST_FORCE:
                return f"command {k}: f_cat = {answer.f_cat:.4g} N"
            resumed = perf_counter_ns()
            catenary.step(answer.f_cat)
            stepped = perf_counter_ns()
            if rig.last or self._stopped:
                if timed:
                    rows.time(k, solved - begun, stepped - resumed, 0)
                return ""
            u_tr, u_next = answer.u_tr, answer.u_tr_next
            if supervisor.admissible(u_tr, u_next):
                state = rig.follow(u_tr, u_next, answer.status == SolverStatus.FALLBACK)
            else:
                supervisor.objection(u_tr, u_next)
                state = rig.bridge(refused=True)
            rows.moved(k, rig.ramp)
            if timed:
                rows.time(k, solved - begun, stepped - resumed, perf_counter_ns() - stepped)
            k += 1


def _unusable(rig: RigSample, w: float, v: float, f: float, work: float, impulse: float) -> str:
    """Say whose state the controller's node would refuse; empty: neither."""
    if not _plausible(rig.w_tr, rig.v_tr, rig.f_tr, rig.work, rig.impulse):
        return "rig is not finite or out of all proportion"
    if not _plausible(w, v, f, work, impulse):
        return "catenary is not finite or out of all proportion"
    return ""


def _plausible(w: float, v: float, f: float, work: float, impulse: float) -> bool:
    return abs(w) <= LARGEST and abs(v) <= LARGEST and abs(f) <= LARGEST and isfinite(work + impulse)
