"""The closed loop in one process and without ROS: the same three cores, called one after the other."""

from __future__ import annotations

from collections.abc import Iterator
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

from catenary_model.build import build as build_catenary
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from impedance_mpc.controller import EnvironmentReading, ImpedanceController, RigReading
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.plant import Impedance
from phil_base.parameters import build
from ride.settings import Settings
from test_rig_sim.parameters import Parameters as RigParameters
from test_rig_sim.rig import Rig

PARTS = ("catenary", "impedance_mpc", "test_rig_sim")


class ClosedLoop:
    """Catenary, controller and rig of one ride, from the parameters of all nodes."""

    def __init__(self, settings: Settings) -> None:
        wire = build(CatenaryParameters, settings["catenary_model"])
        control = build(ControllerParameters, settings["impedance_mpc"])
        self.catenary = build_catenary(wire.config())
        self.rig = Rig(build(RigParameters, settings["test_rig_sim"]))
        red = self.catenary.reduced
        newmark, compliance = (NEWMARK_BETA, NEWMARK_GAMMA), self.catenary.local_compliance
        model = Impedance(red.M, red.D, red.K, red.b, red.b, wire.cycle_time, *newmark, compliance)
        self.controller = ImpedanceController(control, model)

    def cycles(self, count: int) -> Iterator[tuple[int, int, int]]:
        """Ride ``count`` cycles; give for each the times in ns of catenary, controller and rig."""
        catenary, controller, rig = self.catenary, self.controller, self.rig
        for _ in range(count):
            state = rig.state
            begun = perf_counter_ns()
            if rig.cycle == 0:  # it has followed nothing yet, as the nodes say by RigState.mode
                controller.disengage()
            command = controller.command(
                RigReading(state.w_tr, state.v_tr, state.f_tr, state.reference, state.work, state.impulse),
                self.wire(),
            )
            solved = perf_counter_ns()
            catenary.step(command.f_cat)
            stepped = perf_counter_ns()
            rig.advance(command.u_tr, command.u_tr_next)
            yield stepped - solved, solved - begun, perf_counter_ns() - stepped

    def wire(self) -> EnvironmentReading:
        """Read the catenary."""
        c = self.catenary
        q, qd, qdd, held = c.state.segment
        return EnvironmentReading(q, qd, qdd, held, c.w_cat, c.v_cat, c.f_cat, c.work, c.impulse)

    def times(self, count: int, skip: int = 200) -> dict[str, NDArray[np.float64]]:
        """Ride and give the times in s of each part, the first ``skip`` cycles left out."""
        measured = np.array(list(self.cycles(count + skip))[skip:], dtype=np.float64) * 1e-9
        return dict(zip(PARTS, measured.T, strict=True))
