"""Every pantograph in closed loop with catenary and controller, and what may happen to it on the way."""

from typing import Any

import numpy as np
import pytest

from phil_loop import ClosedLoop, settings
from test_rig_sim.pantographs import PANTOGRAPHS

QUICK = {"run_in": 0.2}
HAPPENING = {
    "events.pressure_time": 0.4,
    "events.pressure_share": 0.8,
    "events.pressure_ramp": 0.1,
    "events.knock_time": 0.6,
    "events.knock_impulse": 4.0,
    "car_body.bounce_amplitude": 0.005,
    "car_body.random_rms": 0.002,
}


def ride(changes: dict[str, Any]) -> tuple[np.ndarray, float]:
    """Ride for 1 s; give the contact force from cycle 100 on (all of the lift has come up), and the whole lift."""
    loop = ClosedLoop(settings(duration=1.0, test_rig_sim={**QUICK, **changes}), limits=False)
    lift = loop.rig.plant.pantograph.frame.air + 120.0
    return loop.ride().true.f_contact[100:], lift


@pytest.mark.parametrize("name", PANTOGRAPHS)
@pytest.mark.slow
def test_every_pantograph_rides(name: str) -> None:
    # 0.8 s are about one span at 250 km/h; over it the force averages to the lift less what the frame's spring takes,
    # measured within 10 %.
    force, lift = ride({"pantograph": name})
    assert np.isfinite(force).all()
    assert force.mean() == pytest.approx(lift, rel=0.2)
    assert force.min() >= 0.0
    assert force.max() < 2.5 * lift
    assert force.std() > 5.0


def test_a_ride_survives_everything_at_once() -> None:
    force, lift = ride({"pantograph": "nonlinear", **HAPPENING})
    knocked = slice(200, 215)  # 0.6 s to 0.63 s
    assert np.isfinite(force).all()
    assert force[knocked].min() == 0.0
    # Contact is back, at the lower pressure.
    assert force[-50:].min() > 0.0
    assert force[300:].mean() < lift


@pytest.mark.slow
def test_file_and_chain_ride_alike() -> None:
    # The same pantograph twice; rounding grows in a loop with an optimiser that stops at a residual: 1 N of some 27 N.
    first, second = (ride({"pantograph": name})[0] for name in ("en50318", "state_space"))
    assert np.sqrt(np.mean((first - second) ** 2)) < 1.0
