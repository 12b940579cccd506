"""Parameters of the simulated rig as they stand in the source tree, with changes."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from phil_base.parameters import build, read_file
from test_rig_sim.parameters import Imperfections, Parameters

DEFAULTS = Path(__file__).parents[2] / "test_rig_sim" / "test_rig_sim" / "config" / "test_rig_sim.yaml"

Make = Callable[..., Parameters]


@pytest.fixture(scope="session")
def rig_parameters() -> Make:
    """Return a maker: defaults, changed by a mapping of dotted names."""
    values = read_file(DEFAULTS)["test_rig_sim"]

    def make(changes: dict[str, Any] | None = None) -> Parameters:
        return build(Parameters, {**values, **(changes or {})})

    return make


@pytest.fixture(scope="session")
def perfect() -> dict[str, Any]:
    """Changes that leave of the rig what the inner loop is designed for: the linear part of (3.42)."""
    names = (name for name in Imperfections.model_fields if name != "current_limit")
    return {"inner_loop.frequency_weighting": False, **{f"imperfections.{name}": False for name in names}}


@pytest.fixture(scope="session")
def rig_named() -> Make:
    """Return a maker: one of the rigs that come with the package, changed by a mapping of dotted names."""

    def make(name: str, changes: dict[str, Any] | None = None) -> Parameters:
        of_rig = read_file(DEFAULTS.parent / "rigs" / f"{name}.yaml")["test_rig_sim"]
        return build(Parameters, {**read_file(DEFAULTS)["test_rig_sim"], **of_rig, **(changes or {})})

    return make
