"""Parameters: what is accepted, and what the message says when not."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import model_validator

from phil_base.parameters import Group, ParameterError, build, config_file, infos, parameter, read_file, values_of


class Wire(Group):
    tension: float = parameter("Tension", unit="N", low=0.0, high=1e5)


class Sample(Group):
    speed_kmh: float = parameter("Speed", unit="km/h", low=0.0, high=400.0)
    spans: int = parameter("Spans", low=2, high=40)
    boundary: str = parameter("Boundary", choices=("clamped", "dashpot"))
    active: bool = parameter("Active", live=True)
    droppers: list[float] = parameter("Droppers", unit="m", low=0.0)
    wire: Wire = parameter("Wire")


GOOD = {
    "speed_kmh": 250.0,
    "spans": 4,
    "boundary": "clamped",
    "active": True,
    "droppers": [5.0, 10.0],
    "wire.tension": 2e4,
}


def test_good_values_pass_and_come_back():
    assert values_of(build(Sample, GOOD)) == GOOD


def test_an_integer_is_a_number():
    assert build(Sample, {**GOOD, "speed_kmh": 200, "droppers": [1, 2]}).speed_kmh == 200.0


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("speed_kmh", 900.0, ["speed_kmh", "900", "0 to 400", "km/h"]),
        ("speed_kmh", "fast", ["speed_kmh", "fast", "a number"]),
        ("speed_kmh", float("nan"), ["speed_kmh", "nan"]),
        ("speed_kmh", True, ["speed_kmh", "True"]),
        ("spans", 2.0, ["spans", "2.0", "an integer"]),
        ("spans", 1, ["spans", "2 to 40"]),
        ("boundary", "open", ["boundary", "open", "clamped, dashpot"]),
        ("active", 1, ["active", "true or false"]),
        ("droppers", [1.0, -1.0], ["droppers", "-1"]),
        ("droppers", 3.0, ["droppers", "numbers"]),
        ("droppers", [], ["droppers", "one or more numbers"]),
        ("wire.tension", -1.0, ["wire.tension", "-1", "N"]),
    ],
)
def test_a_bad_value_is_one_line_with_key_value_and_range(key, value, words):
    with pytest.raises(ParameterError) as caught:
        build(Sample, {**GOOD, key: value}, "node")
    text = str(caught.value)
    assert text.count("\n") == 0
    for word in ["node", *words]:
        assert word in text


def test_every_line_of_a_long_refusal_says_whose_it_is():
    class Both(Group):
        low: float = parameter("Low", unit="m")

        @model_validator(mode="after")
        def _refuse(self):
            raise ValueError("first\nsecond")

    with pytest.raises(ParameterError) as caught:
        build(Both, {"low": 1.0}, "node")
    assert str(caught.value) == "node: first\nnode: second"


def test_unknown_and_missing_keys_are_named():
    values = {**GOOD, "speed_kph": 1.0}
    del values["spans"]
    with pytest.raises(ParameterError, match=r"speed_kph.*unknown.*did you mean 'speed_kmh'") as caught:
        build(Sample, values)
    assert "'spans' is missing" in str(caught.value)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_exactly_the_range_is_accepted(value):
    inside = 0.0 <= value <= 400.0
    if inside:
        assert build(Sample, {**GOOD, "speed_kmh": value}).speed_kmh == value
    else:
        with pytest.raises(ParameterError):
            build(Sample, {**GOOD, "speed_kmh": value})


def test_infos_flatten_groups_in_order():
    assert [info.name for info in infos(Sample)] == list(GOOD)


def test_numbers_with_an_exponent_are_numbers(tmp_path):
    path = tmp_path / "params.yaml"
    path.write_text("node:\n  ros__parameters: {a: 2e4, b: -1.5E-3, c: 1e, d: [1e3, .5e1], e: 0x1e2}\n")
    values = read_file(path)["node"]
    assert values == {"a": 2e4, "b": -1.5e-3, "c": "1e", "d": [1000.0, 5.0], "e": 0x1E2}


@pytest.mark.parametrize("content", ["a: [", "- 1\n- 2\n", "node:\n  speed: 1\n", "node:\n  ros__parameters: 3\n"])
def test_files_that_are_no_parameter_files(tmp_path, content):
    path = tmp_path / "params.yaml"
    path.write_text(content)
    with pytest.raises(ParameterError, match=str(path)):
        read_file(path)


def test_a_missing_file_is_said_so(tmp_path):
    with pytest.raises(ParameterError, match="cannot be read"):
        read_file(tmp_path / "none.yaml")


@pytest.mark.parametrize("package", ["catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor"])
def test_every_default_is_allowed_and_no_parameter_is_without_one(package):
    from importlib import import_module

    values = read_file(config_file(package, f"{package}.yaml"))[package]
    model = import_module(f"{package}.parameters").Parameters
    assert values_of(build(model, values)).keys() == values.keys()
    for info in infos(model):
        assert info.description, f"{info.name} has no description"
