"""What acts on the pantograph beside the contact, cycle by cycle: actuator, car body, knocks."""

from test_rig_sim.car_body import CarBody
from test_rig_sim.events import Uplift, knock
from test_rig_sim.pantographs.motion import Load
from test_rig_sim.rig_parameters import RigParameters


class Loads:
    """Gives the load at the end of each cycle, in order; between two cycles see `step.load_between`."""

    def __init__(self, parameters: RigParameters, air: float) -> None:
        p = parameters
        self._air = air
        self._cycle_time = p.cycle_time
        self._uplift = Uplift(p.uplift_force, p.events, p.run_in, p.initial_force_share)
        self._car_body = CarBody(p.car_body, p.cycle_time)
        self._knock = knock(p.events, p.cycle_time)
        self._cycle = 0

    @property
    def uplift_force(self) -> float:
        """The uplift force that was set last, N."""
        return self._uplift.target

    def reset(self, lowered: bool = False) -> Load:
        """Go back to cycle 0 and return its load; lowered: without lift until `lift_pantograph`."""
        self._cycle = 0
        self._uplift.reset(lowered)
        self._car_body.reset()
        return Load(self._uplift.at(0.0, self._air), 0.0, 0.0, 0.0)

    def next(self) -> Load:
        """Return the load at the next cycle; the first call gives that of cycle 1."""
        self._cycle += 1
        base, base_rate = self._car_body.next()
        return Load(self._uplift.at(self._time, self._air), base, base_rate, self._knock.force(self._cycle))

    def change_uplift_force(self, force: float) -> None:
        """Let the actuator go to another uplift force (N) within 0.2 s from the present cycle on."""
        self._uplift.change(force, self._time)

    def lift_pantograph(self) -> None:
        """Let the whole lift come up within the run-in from the present cycle on."""
        self._uplift.lift(self._time)

    def lower_pantograph(self) -> None:
        """Let the whole lift go within the run-in from the present cycle on."""
        self._uplift.lower(self._time)

    @property
    def _time(self) -> float:
        return self._cycle * self._cycle_time
