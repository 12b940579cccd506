"""The closed loop of one ride in one process: the cycle functions of the nodes, one after the other, without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from catenary_model.build import MovingCatenary
from catenary_model.build import build as build_catenary
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from impedance_mpc.cycle import ControllerCycle
from impedance_mpc.parameters import CORRECTED, INTEGRATED
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.parts import PARTS, Parts
from impedance_mpc.plant import Impedance
from phil_base.parameters import ParameterError, build
from phil_loop.controllers import Commander, Controller, Own
from phil_loop.events import Events, by_cycle
from phil_loop.observing import Observer
from phil_loop.record import Record
from phil_loop.ride import Ride
from test_rig_sim.cycle import RigCycle, last_cycle_of
from test_rig_sim.operation import unlimited
from test_rig_sim.parameters import Parameters as RigParameters
from test_rig_sim.rig import Rig


def impedance_of(catenary: MovingCatenary) -> Impedance:
    """Give the reduced model that the controller is designed for, as the message ImpedanceModel has it."""
    red = catenary.reduced
    ts, compliance = catenary.config.cycle_time, catenary.local_compliance
    return Impedance(red.M, red.D, red.K, red.b, red.b, ts, NEWMARK_BETA, NEWMARK_GAMMA, compliance)


class ClosedLoop:
    """Catenary, controller and rig of one ride, from the parameters of all nodes (`settings`).

    ``controller`` takes the place of ours. ``observers`` are called in each cycle. Without ``limits`` the drive follows
    each command as it is: nothing is refused, cut or smoothed, and no limit ends the ride. Our controller is put
    together from ``parts``.

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
        parts: Parts = PARTS,
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
        self.going: Ride | None = None
        self.control: ControllerCycle | None = None
        self.commander: Commander
        if controller is None:
            self.commander = self.control = ControllerCycle(self._control, impedance_of(self.catenary), parts)
        else:
            self.commander = Own(controller, self.ts)
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
        """End the ride that goes on with this cycle: for observers."""
        if self.going is not None:
            self.going.stopped = True

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
        self.commander.reset()
        self.going = None

    def ride(self, duration: float | None = None, events: Events | None = None, *, timed: bool = False) -> Record:
        """Ride from cycle 0 for ``duration`` s (else that of the settings) to the end, as the nodes do in lockstep.

        With `land_at_end` the landing begins after the duration. ``events`` are done on the way, see `events`. A ride
        begins anew: two of them are equal to the last bit. ``timed``: note what each part took.

        Raises
        ------
        ParameterError
            The duration is out of range, or 0 (endless).
        ValueError
            An event's time is negative or no number, or it cannot be done.
        """
        going = self.begin(duration, events, timed=timed)
        if going.endless:
            raise ParameterError("test_rig_sim: parameter 'duration' = 0.0 is endless: a ride of the loop needs an end")
        going.run()
        return going.record()

    def begin(self, duration: float | None = None, events: Events | None = None, *, timed: bool = False) -> Ride:
        """Go to cycle 0 of a ride, which goes on with each call of its `run`; a duration of 0 has no end.

        The loop has one ride at a time: the one before cannot go on.

        Raises
        ------
        ParameterError
            The duration is out of range.
        ValueError
            An event's time is negative or no number.
        """
        p = self._parameters
        if duration is not None:
            p = build(RigParameters, self.settings["test_rig_sim"] | {"duration": duration}, "test_rig_sim")
        due = by_cycle(events or {}, self.ts)
        self.reset()
        self.rig_cycle.last_cycle = last_cycle_of(p.duration, p.cycle_time)
        self.going = Ride(self, due, timed)
        return self.going
