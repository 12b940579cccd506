"""Parameters: defaults build the model of Table 3.1, nonsense is refused by name."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from catenary_model.line import Line
from catenary_model.line_file import dump_line, load_line, preset_names
from catenary_model.model import Config
from catenary_model.parameters import Parameters
from phil_base.parameters import ParameterError, build, defaults


def with_changes(**changes: Any) -> dict[str, Any]:
    return {**defaults("catenary_model"), **changes}


def test_defaults_are_table_3_1_and_those_of_the_model() -> None:
    parameters = build(Parameters, defaults("catenary_model"))
    # The ride starts under the mid-span dropper, where the wire at rest is at nominal height.
    assert parameters.config() == Config(line=Line(), start_position=30.0)
    assert parameters.wire_shape_every == 20


def test_every_setting_of_the_model_is_a_parameter() -> None:
    assert {field.name for field in dataclasses.fields(Config)} - {"speed", "companions"} <= set(
        Parameters.model_fields
    )


def test_every_numerical_parameter_reaches_the_model() -> None:
    changes: dict[str, Any] = {
        "cycle_time": 0.004,
        "substeps": 3,
        "spans": 5,
        "element_length": 1.25,
        "layer_behind": 30.0,
        "layer_ahead": 35.0,
        "fading_length": 20.0,
        "boundary": "clamped",
        "boundary_nodes": 7,
        "newmark_beta": 0.25,
        "newmark_gamma": 0.5,
        "local_compliance": False,
        "max_slack_iterations": 3,
        "coupling_tolerance": 1e-5,
        "segment_half_length": 12.5,
    }
    config = build(Parameters, with_changes(**changes)).config()
    assert {name: getattr(config, name) for name in changes} == changes


@pytest.mark.parametrize("name", [name for name in preset_names() if not load_line(name).stitched])
def test_every_preset_is_a_line(name: str) -> None:
    assert build(Parameters, with_changes(line=name)).config().line == load_line(name)


@pytest.mark.parametrize("discretisation", ["fe", "fd"])
def test_a_line_with_stitch_wires_is_refused_in_one_line(discretisation: str) -> None:
    with pytest.raises(
        ParameterError, match=r"'re330_stitched', spans\[0\]\.stitch_wire: .* has no stitch wires"
    ) as found:
        build(Parameters, with_changes(line="re330_stitched", discretisation=discretisation))
    assert "\n" not in str(found.value)


def test_a_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative to the current directory when the parameters are checked; what happens to it later is of no concern."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text(dump_line(Line(name="mine")))
    parameters = build(Parameters, with_changes(line="mine.yaml"))
    (tmp_path / "mine.yaml").unlink()
    assert parameters.config().line == Line(name="mine")


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"speed_kmh": 500.0}, "speed_kmh"),
        ({"boundary": "wall"}, "boundary"),
        ({"spans": 0}, "spans"),
        ({"spans": 2.5}, "spans"),
        ({"substeps": 0}, "substeps"),
        ({"newmark_gamma": 0.4}, "newmark_gamma"),
        ({"local_compliance": 1}, "local_compliance"),
        ({"fading_length": 300.0}, "fading_length"),
        ({"segment_half_length": 190.0}, "segment_half_length"),
        ({"element_length": 0.375}, r"is too long for element_length = 0\.375 m.*choose more substeps"),
        ({"spans": 1, "layer_behind": 0.0, "layer_ahead": 0.0, "boundary_nodes": 200}, "two layers of 200 nodes"),
        ({"line": ""}, "parameter 'line': .*presets are .*en50318_2002"),
        ({"line": "no_such_line"}, "parameter 'line': .*no_such_line.*presets are .*en50318_2002"),
        ({"line": "/no/such/line.yaml"}, r"parameter 'line': /no/such/line\.yaml: cannot be read"),
        ({"line": 3}, "parameter 'line' = 3"),
        ({"no_such_key": 1.0}, "no_such_key"),
        ({"contact_wire.tension": 2e4}, "contact_wire.tension"),
    ],
)
def test_bad_parameters_are_named(changes: dict[str, Any], names: str) -> None:
    with pytest.raises(ParameterError, match=names) as refused:
        build(Parameters, with_changes(**changes))
    assert "\n" not in str(refused.value)


def test_a_train_faster_than_the_waves_of_its_line_is_refused(tmp_path: Path) -> None:
    text = dump_line(Line()).replace("tension: 20000.0", "tension: 8000.0")
    (tmp_path / "slack.yaml").write_text(text)
    with pytest.raises(ParameterError, match=r"speed 320\.0 km/h exceeds 95 % of the contact wire's wave speed"):
        build(Parameters, with_changes(line=str(tmp_path / "slack.yaml"), speed_kmh=320.0))
