"""Parameters of operation: what contradicts itself, or asks the drive for more than it has, is named."""

from typing import Any

import pytest

from phil_base.parameters import ParameterError
from test_rig_sim.operation import available_acceleration, rules, supervisor_for
from test_rig_sim.rig import Rig
from test_rig_sim.supervisor import Mode


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"limits.trip_speed": 2.0}, ("limits.trip_speed = 2.0", "limits.speed = 3.0")),
        ({"limits.trip_force": 400.0}, ("limits.trip_force = 400.0", "limits.force = 500.0")),
        ({"touch.highest": 0.31}, ("touch.highest = 0.31", "limits.position")),
        ({"touch.lowest": -0.31}, ("touch.lowest = -0.31", "limits.position")),
        ({"touch.gap": 0.26}, ("touch.gap = 0.26", "touch.highest = 0.25")),
        ({"retract.braking": 200.0}, ("retract.braking = 200.0", "drive can do: 140")),
        ({"motion.acceleration": 145.0}, ("motion.acceleration", "drive can do")),
        ({"motion.entry_acceleration": 145.0}, ("motion.entry_acceleration", "drive can do")),
        ({"retract.acceleration": 145.0}, ("retract.acceleration", "drive can do")),
        ({"touch.acceleration": 50.0, "drive.current_limit": 10.0}, ("drive can do: 40.2",)),
        ({"motion.speed": 3.5}, ("motion.speed", "limits.speed")),
        ({"retract.speed": 3.5}, ("retract.speed", "limits.speed")),
        ({"operating_mode": "dance"}, ("operating_mode", "hold, position, impedance")),
        ({"start": "late"}, ("start", "in_contact, apart")),
    ],
)
def test_bad_parameters_are_named(rig_parameters: Any, changes: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(ParameterError) as refused:
        rig_parameters(changes)
    for word in words:
        assert word in str(refused.value)


@pytest.mark.parametrize(("uplift", "in_the_way"), [(120.0, 9.81 * 8.0), (300.0, 300.0 - 9.81 * 8.0)])
def test_what_the_drive_can_do_is_its_force_less_weight_or_contact(
    rig_parameters: Any, uplift: float, in_the_way: float
) -> None:
    # 40 N/A 30 A = 1200 N on 8 kg
    found = available_acceleration(rig_parameters({"uplift_force": uplift}))
    assert found == pytest.approx((1200.0 - in_the_way) / 8.0)


def test_the_response_is_that_of_the_designed_loop(rig_parameters: Any) -> None:
    """About 39 Hz and 0.8: lead = 2 zeta / omega = 6.5 ms, stiffness = omega^2.

    15 %: the frequency weighting takes gain from the speed, and the loop is no exact PT2.
    """
    p = rig_parameters()
    found = rules(p, Rig(p).plant.loop).response
    assert found.lead == pytest.approx(2.0 * 0.8 / (2.0 * 3.14159 * 39.0), rel=0.15)
    assert found.stiffness == pytest.approx((2.0 * 3.14159 * 39.0) ** 2, rel=0.15)


def test_a_supervisor_begins_as_the_parameters_say(rig_parameters: Any) -> None:
    p = rig_parameters({"operating_mode": "position", "start": "apart"})
    rig = Rig(p)
    found = supervisor_for(p, rules(p, rig.plant.loop), rig.state.reference)
    assert found.mode is Mode.POSITION and not found.touching
    # The drive stands a gap above the head of a pantograph without lift, and nothing presses.
    head = rig.pantograph_state()[0][-1]
    assert rig.state.w_tr - head == pytest.approx(p.touch.gap, abs=p.encoder_resolution)
    assert rig.state.f_contact == 0.0
    ramp = found.bridge()
    assert ramp.start == rig.state.reference
