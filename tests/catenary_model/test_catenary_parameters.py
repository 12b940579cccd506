"""Parameters: defaults build the model of Table 3.1, nonsense is refused by name."""

from typing import Any

import pytest

from catenary_model.line import Line
from catenary_model.model import Config
from catenary_model.parameters import Parameters
from phil_node.parameters import ParameterError, build, defaults


def with_changes(**changes: Any) -> dict[str, Any]:
    return {**defaults("catenary_model"), **{name.replace("__", "."): value for name, value in changes.items()}}


def test_defaults_are_table_3_1() -> None:
    parameters = build(Parameters, defaults("catenary_model"))
    # The ride starts under the mid-span dropper, where the wire at rest is at nominal height.
    assert parameters.config() == Config(line=Line(), start_position=30.0)
    assert parameters.wire_shape_every == 20


def test_given_lengths_reach_the_line() -> None:
    lengths = [0.84, 0.66, 0.5, 0.41, 0.37, 0.41, 0.5, 0.66, 0.84]
    parameters = build(Parameters, with_changes(line__dropper_lengths=lengths))
    assert parameters.config().line.dropper_lengths == tuple(lengths)


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"speed_kmh": 500.0}, "speed_kmh"),
        ({"boundary": "wall"}, "boundary"),
        ({"spans": 1}, "spans"),
        ({"spans": 2.5}, "spans"),
        ({"fading_length": 130.0}, "fading_length"),
        ({"line__dropper_positions": [5.0, 4.0]}, r"^line\.dropper_positions.* line\.span_length"),
        ({"line__dropper_positions": []}, r"line\.dropper_positions"),
        ({"line__dropper_lengths": [1.0, 1.0]}, r"^line\.dropper_lengths.* line\.dropper_positions"),
        ({"line__dropper_lengths": [0.0] * 9}, r"^line\.dropper_lengths"),
        ({"line__dropper_lengths": []}, r"line\.dropper_lengths"),
        ({"contact_wire__tension": -1.0}, "contact_wire.tension"),
        ({"no_such_key": 1.0}, "no_such_key"),
    ],
)
def test_bad_parameters_are_named(changes: dict[str, Any], names: str) -> None:
    with pytest.raises(ParameterError, match=names) as refused:
        build(Parameters, with_changes(**changes))
    assert "\n" not in str(refused.value)
