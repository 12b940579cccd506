"""Parameters of the rig: defaults are complete, bad ones are named."""

import math
from pathlib import Path
from typing import Any

import pytest

from phil_base.parameters import ParameterError, infos, read_file
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.parameters import Imperfections, Parameters
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
        ({"force_observer.bandwidth_hz": 1000.0}, ("force_observer.bandwidth_hz", "1000")),
        ({"drive.static_friction": 10.0}, ("drive.static_friction", "drive.coulomb_friction")),
        ({"drive.static_friction": 200.0, "drive.friction_speed": 0.001}, ("drive.friction_speed", "integration step")),
        ({"structure.modal_masses": [400.0]}, ("structure.modal_masses has 1", "structure.frequencies_hz has 2")),
        ({"inner_loop.filter_weights": [1.0] * 3}, ("inner_loop.filter_weights has 3",)),
        ({"inner_loop.filter_frequencies_hz": [62.0, 1000.0]}, ("inner_loop.filter_frequencies_hz", "1000")),
        ({f"structure.{key}": [1.0] * 3 for key in ("frequencies_hz", "damping_ratios", "modal_masses")}, ("2 modes",)),
        ({"command_delay": 6}, ("command_delay", "5")),
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


def test_the_nominal_rig_is_the_one_of_the_defaults(rig_parameters: Any, rig_named: Any) -> None:
    assert rig_named("nominal") == rig_parameters()


def test_the_rigs_speak_of_the_same_parameters() -> None:
    # An overlay that left out what another one changes would not be a whole rig.
    rigs = Path(__file__).parents[2] / "test_rig_sim" / "test_rig_sim" / "config" / "rigs"
    nominal, harsh = (set(read_file(rigs / f"{name}.yaml")["test_rig_sim"]) for name in ("nominal", "harsh"))
    assert nominal == harsh
    ideal = read_file(rigs / "ideal.yaml")["test_rig_sim"]
    assert set(ideal) <= nominal
    on = [name for name, value in ideal.items() if name.startswith("imperfections.") and value]
    assert on == ["imperfections.current_limit"]


@pytest.mark.parametrize("name", [name for name in Imperfections.model_fields if name != "current_limit"])
def test_every_imperfection_can_be_switched_off_and_matters(rig_named: Any, name: str) -> None:
    # One by one on the worst rig: each makes another ride of a busy reference. The slew's limit needs a step.
    def ride(on: bool) -> list[float]:
        rig = Rig(rig_named("harsh", {f"imperfections.{name}": on}))
        found = []
        for k in range(60):
            u = 0.003 if name == "current_slew" else 0.004 * math.sin(0.5 * k)
            rig.advance(u, u)
            found.append(rig.state.f_raw)
        return found

    assert ride(True) != ride(False)
