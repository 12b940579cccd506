"""Parameters of the simulated rig as they stand in the source tree, with changes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from phil_node.parameters import build, read_file
from test_rig_sim.parameters import Parameters

DEFAULTS = Path(__file__).parents[2] / "test_rig_sim" / "config" / "test_rig_sim.yaml"

Make = Callable[..., Parameters]


@pytest.fixture(scope="session")
def rig_parameters() -> Make:
    """Return a maker: defaults, changed by a mapping of dotted names."""
    values = read_file(DEFAULTS)["test_rig_sim"]

    def make(changes: dict[str, Any] | None = None) -> Parameters:
        return build(Parameters, {**values, **(changes or {})})

    return make


@pytest.fixture(scope="session")
def frictionless() -> dict[str, Any]:
    """Changes that leave of the drive what the inner loop is designed for: the linear part of (3.42)."""
    return {
        "drive.coulomb_friction": 0.0,
        "drive.cogging_amplitude": 0.0,
        "encoder_resolution": 0.0,
        "load_cell.noise": 0.0,
    }
