"""Rules of a rig for tests, and a drive that follows its reference as the closed position loop does."""

import math
from typing import Any

import numpy as np
from scipy.linalg import expm

from test_rig_sim.limits import Limits
from test_rig_sim.motion import Pace, Response
from test_rig_sim.retract import Retract
from test_rig_sim.supervisor import Ramp, Rules, Supervisor
from test_rig_sim.touch import Touch

TS = 0.002
LIMITS = Limits(
    position=0.3,
    speed=3.0,
    force=500.0,
    current=12.0,
    reference_step=0.05,
    trip_position=0.35,
    trip_speed=4.0,
    trip_force=1000.0,
    trip_saturation=10,
    thermal_time=5.0,
)
RETRACT = Retract(position=0.0, speed=0.25, acceleration=5.0, braking=60.0)
TOUCH = Touch(
    gap=0.02, speed=0.02, landing_speed=0.05, acceleration=0.5, force=5.0, cycles=5, lowest=-0.2, highest=0.25
)
OMEGA, ZETA = 2.0 * math.pi * 40.0, 0.8
RULES = Rules(
    period=TS,
    late_limit=5,
    limits=LIMITS,
    retract=RETRACT,
    touch=TOUCH,
    pace=Pace(speed=0.25, acceleration=5.0),
    entry_cycles=50,
    entry_acceleration=60.0,
    response=Response(2.0 * ZETA / OMEGA, OMEGA**2),
    trajectory=0.01 * np.sin(2.0 * math.pi * np.minimum(np.arange(200) * TS, 0.2)) ** 2,
)


def fresh(operation: str = "impedance", reference: float = 0.0, touching: bool = True, **changes: Any) -> Supervisor:
    """Make a supervisor at cycle 0."""
    return Supervisor(RULES._replace(**changes), operation, reference, touching)


class Drive:
    """A PT2 of 40 Hz that follows a supervisor's ramps, exact at the cycle; acceleration in m/s^2."""

    def __init__(self, reference: float = 0.0) -> None:
        generator = np.zeros((4, 4))
        generator[0, 1] = TS
        generator[1, :3] = np.array([-(OMEGA**2), -2.0 * ZETA * OMEGA, OMEGA**2]) * TS
        generator[2, 3] = 1.0
        self._step = expm(generator)
        self.w, self.v, self.acceleration = reference, 0.0, 0.0

    def follow(self, ramp: Ramp) -> None:
        """Go through one cycle."""
        self.w, self.v, u, _ = (self._step @ [self.w, self.v, ramp.start, ramp.end - ramp.start]).tolist()
        self.acceleration = OMEGA**2 * (u - self.w) - 2.0 * ZETA * OMEGA * self.v
