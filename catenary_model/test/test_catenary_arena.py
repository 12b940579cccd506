"""What compiled code puts together from the blocks of memory is what was packed, each array under its own name."""

from typing import Any

import numpy as np
import pytest

from catenary_model import arena, build, finite_difference
from catenary_model.config import Config
from catenary_model.finite_difference import layout as grid_layout


@pytest.mark.parametrize(
    ("config", "unpack"),
    [(Config(spans=2), arena.unpack), (Config(discretisation="fd", grid_boundary="one_way"), grid_layout.unpack)],
    ids=["fe", "fd"],
)
def test_every_array_comes_back_under_its_name(config: Config, unpack: Any) -> None:
    model: Any = build.build(config)
    assert isinstance(model, finite_difference.Catenary) is (config.discretisation == "fd")
    bundles = model.constants, model.state
    for number, array in enumerate(array for bundle in bundles for array in bundle):
        array[...] = number + 1  # no two alike
    floats, whole, table, constants, state = arena.pack(*bundles)
    for given, found in zip((constants, state), unpack(floats, whole, table), strict=True):
        assert type(found) is type(given)
        for name in given._fields:
            mine, compiled = getattr(given, name), getattr(found, name)
            assert compiled.shape == mine.shape and compiled.dtype == mine.dtype, name
            assert np.array_equal(compiled, mine), name
            assert compiled.size == 0 or np.shares_memory(compiled, mine), name
