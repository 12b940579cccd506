"""What compiled code puts together from the blocks of memory is what was packed, each array under its own name."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from catenary_model import arena, build, finite_difference
from catenary_model.config import Config
from catenary_model.layout import Array, Array1, Array2, Ints2


@pytest.mark.parametrize(
    "config", [Config(spans=2), Config(discretisation="fd", grid_boundary="one_way")], ids=["fe", "fd"]
)
def test_every_array_comes_back_under_its_name(config: Config) -> None:
    model: Any = build.build(config)
    assert isinstance(model, finite_difference.Catenary) is (config.discretisation == "fd")
    bundles = model.constants, model.state
    for number, array in enumerate(array for bundle in bundles for array in bundle):
        array[...] = number + 1  # no two alike
    unpack = arena.unpacker(*map(type, bundles))
    floats, whole, table, constants, state = arena.pack(*bundles)
    for given, found in zip((constants, state), unpack(floats, whole, table), strict=True):
        assert type(found) is type(given)
        for name in given._fields:
            mine, compiled = getattr(given, name), getattr(found, name)
            assert compiled.shape == mine.shape and compiled.dtype == mine.dtype, name
            assert np.array_equal(compiled, mine), name
            assert compiled.size == 0 or np.shares_memory(compiled, mine), name


class Few(NamedTuple):
    a: Array1
    b: Ints2


def test_an_array_of_another_kind_than_declared_is_refused() -> None:
    good = Few(np.zeros(3), np.zeros((2, 2), dtype=np.int64))
    assert np.array_equal(arena.pack(good, good)[4].b, good.b)
    for wrong in (good._replace(a=np.zeros((3, 1))), good._replace(b=np.zeros((2, 2)))):
        with pytest.raises(TypeError, match=r"dimensions, declared is"):
            arena.pack(wrong, good)


def test_a_field_that_does_not_say_its_dimensions_is_refused() -> None:
    class Vague(NamedTuple):
        a: Array2
        b: Array

    with pytest.raises(TypeError, match=r"Vague\.b is not declared"):
        arena.unpacker(Few, Vague)
