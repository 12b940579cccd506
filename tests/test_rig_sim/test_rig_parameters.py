"""Parameters of the rig: defaults are complete, bad ones are named."""

from typing import Any

import pytest

from phil_node.parameters import ParameterError, infos
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.parameters import Parameters
from test_rig_sim.rig import Rig


def test_defaults_build_a_rig(rig_parameters: Any) -> None:
    assert Rig(rig_parameters()).cycle == 0


def test_every_pantograph_can_be_chosen(rig_parameters: Any) -> None:
    for name in PANTOGRAPHS:
        rig = Rig(rig_parameters({"pantograph": name}))
        rig.advance(0.0, 0.0)
        assert rig.pantograph_state()[0].size == rig.bodies


def test_every_parameter_is_described() -> None:
    for info in infos(Parameters):
        assert info.description
        assert info.kind is not float or info.unit, info.name


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pantograph": "violin"}, ("pantograph", "en50318")),
        ({"mode": "fast"}, ("mode", "lockstep")),
        ({"uplift_force": -1.0}, ("uplift_force", "1000")),
        ({"uplift_force": "much"}, ("uplift_force",)),
        ({"drive.mass": float("nan")}, ("drive.mass",)),
        ({"inner_steps": 2.5}, ("inner_steps",)),
        ({"colour": 1.0}, ("colour", "unknown")),
        ({"load_cell.cut_off_hz": 2500.0}, ("load_cell.cut_off_hz", "2500")),
        ({"limits.trip_position": 0.1}, ("limits.trip_position", "limits.position")),
        ({"retract.position": 0.4}, ("retract.position", "limits.position")),
        ({"drive.current_limit": 1.0}, ("drive.current_limit",)),
    ],
)
def test_bad_parameters_are_named(rig_parameters: Any, changes: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(ParameterError) as refused:
        rig_parameters(changes)
    for word in words:
        assert word in str(refused.value)
