"""What the controller believes of the rig beside what the simulated rig has."""

import pytest

from energy_monitor.beliefs import HEAD_MASS, RIGS, beliefs, remark
from ride.settings import resolve, rig_layer, rig_names
from test_rig_sim.pantographs import PANTOGRAPHS


@pytest.fixture(scope="module")
def usual():
    return resolve(None, {})


def differing(usual, layer=None, **changes):
    """Parameters that are marked in the usual ride with changes, given as node__parameter, and the line about them."""
    settings = {node: {**values, **(layer or {}).get(node, {})} for node, values in usual.items()}
    for name, value in changes.items():
        node, _, key = name.partition("__")
        key = key.replace("__", ".")
        assert key in settings[node]
        settings[node][key] = value
    return [one.parameter for one in beliefs(settings) if one.differs], remark(settings)


PT2 = ["rig_natural_frequency_hz", "rig_damping_ratio", "rig_delay"]


@pytest.mark.parametrize(
    ("changes", "marked"),
    [
        ({}, []),
        ({"test_rig_sim__contact__stiffness": 1e5}, ["forecast.stiffness"]),
        ({"impedance_mpc__forecast__stiffness": 1e5}, ["forecast.stiffness"]),
        ({"test_rig_sim__contact__stiffness": 1e5, "impedance_mpc__forecast__stiffness": 1e5}, []),
        ({"test_rig_sim__contact__stiffness": 1e5, "impedance_mpc__forecast__kind": "constant"}, []),
        ({"test_rig_sim__contact__damping": 20.0}, ["(none in its forecast)"]),
        ({"test_rig_sim__pantograph": "three_mass"}, ["forecast.head_mass"]),
        ({"test_rig_sim__pantograph": "state_space"}, ["forecast.head_mass"]),
        ({"test_rig_sim__load_cell__noise": 1.5}, ["forecast.noise"]),
        ({"test_rig_sim__imperfections__load_cell_noise": False}, ["forecast.noise"]),
        ({"test_rig_sim__command_delay": 1}, ["rig_delay"]),
        ({"test_rig_sim__command_delay": 1, "impedance_mpc__rig_delay": 0.0028423}, []),
        ({"test_rig_sim__drive__viscous_friction": 60.0}, PT2),
        ({"test_rig_sim__imperfections__delay": False}, PT2),
        ({"impedance_mpc__rig_natural_frequency_hz": 30.0}, PT2[:1]),
        ({"test_rig_sim__touch__speed": 0.01, "test_rig_sim__seed": 7}, []),
    ],
)
def test_what_does_not_follow_the_rig_is_marked(usual, changes, marked):
    found, said = differing(usual, **changes)
    assert found == marked
    assert (said is None) is (not marked)
    for parameter in marked:
        assert f"{parameter} " in said


def test_the_line_says_both_values(usual):
    _, said = differing(usual, test_rig_sim__contact__stiffness=1e5, test_rig_sim__pantograph="state_space")
    assert "\n" not in said
    assert said.endswith(
        "forecast.stiffness 50000 N/m, the rig's is 100000; forecast.head_mass 7.2 kg, the rig's is not known"
    )


@pytest.mark.parametrize("rig", RIGS)
def test_a_rig_brings_the_model_that_was_identified_on_it(usual, rig):
    found, _ = differing(usual, rig_layer(rig))
    assert not set(found) & set(PT2)


def test_rigs_and_heads_are_those_of_the_simulated_rig():
    """The monitor knows them by name only; here both are side by side."""
    assert sorted(RIGS) == rig_names()
    for name, mass in HEAD_MASS.items():
        assert PANTOGRAPHS[name]().mass[-1] == mass, name


def test_without_a_simulated_rig_nothing_is_said(usual):
    assert beliefs({"impedance_mpc": usual["impedance_mpc"]}) == []
    assert remark({}) is None
