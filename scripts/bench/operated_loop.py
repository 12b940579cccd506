"""The closed loop with all that an operator can do: supervisor of the rig, switch of environments; no ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.build import build as build_catenary
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from impedance_mpc.controller import EnvironmentReading, RigReading
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import EnvironmentSwitch
from phil_base.enumerations import FOLLOWING, Mode
from phil_base.parameters import build
from ride.settings import Settings
from test_rig_sim.operation import rules, supervisor_for
from test_rig_sim.parameters import Parameters as RigParameters
from test_rig_sim.rig import Rig


class Record(NamedTuple):
    """What was seen at each t_k, (n,) each."""

    mode: NDArray[np.float64]
    environment: NDArray[np.float64]
    start: NDArray[np.float64]  # m, of the ramp that begins at t_k
    end: NDArray[np.float64]  # m, of the same
    w_tr: NDArray[np.float64]  # m
    v_tr: NDArray[np.float64]  # m/s, of the simulated drive
    f_contact: NDArray[np.float64]  # N, true
    w_env: NDArray[np.float64]  # m
    v_env: NDArray[np.float64]  # m/s
    w_cat: NDArray[np.float64]  # m
    f_cat: NDArray[np.float64]  # N
    delta_work: NDArray[np.float64]  # J, of the books


class OperatedLoop:
    """Catenary, switch, controllers, supervisor and rig of one ride, from the parameters of all nodes."""

    def __init__(self, settings: Settings) -> None:
        wire = build(CatenaryParameters, settings["catenary_model"])
        self.catenary = build_catenary(wire.config())
        parameters = build(RigParameters, settings["test_rig_sim"])
        self.rig = Rig(parameters)
        self.supervisor = supervisor_for(parameters, rules(parameters, self.rig.plant.loop), self.rig.state.reference)
        red, dc = self.catenary.reduced, self.catenary.local_compliance
        model = Impedance(red.M, red.D, red.K, red.b, red.b, wire.cycle_time, NEWMARK_BETA, NEWMARK_GAMMA, dc)
        self.switch = EnvironmentSwitch(build(ControllerParameters, settings["impedance_mpc"]), model)

    def ride(self, cycles: int, events: dict[int, Callable[[], object]]) -> Record:
        """Ride; each event happens right before the command of its cycle is followed."""
        rig, supervisor, switch, c = self.rig, self.supervisor, self.switch, self.catenary
        rows = np.zeros((cycles, len(Record._fields)))
        shown = supervisor.mode
        for k in range(cycles):
            state = rig.state
            reading = RigReading(state.w_tr, state.v_tr, state.f_tr, state.reference, state.work, state.impulse)
            q, qd, qdd, held = c.state.segment
            wire = EnvironmentReading(q, qd, qdd, held, c.w_cat, c.v_cat, c.f_cat, c.work, c.impulse)
            command = switch.command(reading, wire, shown in FOLLOWING)
            w_cat, f_cat = c.w_cat, c.f_cat
            c.step(switch.force_on_catenary)
            if k in events:
                events[k]()
            if supervisor.admissible(command.u_tr, command.u_tr_next):
                ramp = supervisor.follow(command.u_tr, command.u_tr_next)
            else:
                ramp = supervisor.bridge(refused=True)
            if shown is Mode.APPROACHING and supervisor.mode is Mode.TRACKING:
                rig.lift_pantograph()
            elif supervisor.mode is not shown and supervisor.mode in (Mode.LANDING, Mode.RETRACTING):
                rig.lower_pantograph()
            rows[k] = (
                shown, switch.active, ramp.start, ramp.end, state.w_tr, rig.memory.state[1], state.f_contact,
                switch.w, switch.v, w_cat, f_cat, switch.books.delta_work,
            )  # fmt: skip
            rig.advance(ramp.start, ramp.end)
            shown, now = supervisor.mode, rig.state
            supervisor.watch(now.w_tr, now.v_tr, now.f_tr, now.current, now.saturated == rig.plant.inner_steps)
        return Record(*np.ascontiguousarray(rows.T))
