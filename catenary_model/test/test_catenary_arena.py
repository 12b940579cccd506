"""What compiled code puts together from the blocks of memory is what was packed, each array under its own name."""

from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest

from catenary_model import arena, build, finite_difference
from catenary_model.config import Config
from catenary_model.layout import Array, Array1, Array2, Ints2, numbers
from phil_base.kernels import njit


@pytest.mark.parametrize(
    "config", [Config(spans=2), Config(discretisation="fd", grid_boundary="one_way")], ids=["fe", "fd"]
)
def test_every_array_comes_back_under_its_name(config: Config) -> None:
    model: Any = build.build(config)
    assert isinstance(model, finite_difference.Catenary) is (config.discretisation == "fd")
    bundles = model.constants, model.state
    for number, entry in enumerate(entry for bundle in bundles for entry in bundle):
        if isinstance(entry, np.void):
            for place, name in enumerate(entry.dtype.names or ()):
                entry[name] = 1000 * number + place
        else:
            entry[...] = number + 1  # no two alike
    unpack = arena.unpacker(*map(type, bundles))
    floats, whole, table, constants, state = arena.pack(*bundles)

    @njit
    def seen(floats: Any, whole: Any, table: Any) -> Any:
        c, s = unpack(floats, whole, table)
        real = c.real.ts, c.real.ahead, c.real.period, c.real.compliance
        return real, (c.whole.stations, c.whole.substeps, c.whole.segment_stations), c[2:], s

    real, numbers_seen, arrays, found = seen(floats, whole, table)
    assert real == tuple(constants.real[name] for name in ("ts", "ahead", "period", "compliance"))
    assert numbers_seen == tuple(constants.whole[name] for name in ("stations", "substeps", "segment_stations"))
    assert constants._fields[:2] == ("real", "whole") and type(found) is type(state)
    for name, mine, compiled in zip(
        (*constants._fields[2:], *state._fields), (*constants[2:], *state), (*arrays, *found), strict=True
    ):
        assert compiled.shape == mine.shape and compiled.dtype == mine.dtype, name
        assert np.array_equal(compiled, mine), name
        assert compiled.size == 0 or np.shares_memory(compiled, mine), name
    constants.real["ahead"], constants.whole["substeps"] = 0.5, 77
    again = seen(floats, whole, table)  # records are views, too
    assert again[0][1] == 0.5 and again[1][1] == 77


class Few(NamedTuple):
    a: Array1
    b: Ints2


def test_an_array_of_another_kind_than_declared_is_refused() -> None:
    good = Few(np.zeros(3), np.zeros((2, 2), dtype=np.int64))
    assert np.array_equal(arena.pack(good, good)[4].b, good.b)
    for wrong in (good._replace(a=np.zeros((3, 1))), good._replace(b=np.zeros((2, 2)))):
        with pytest.raises(TypeError, match=r"dimensions, declared is"):
            arena.pack(wrong, good)


def test_a_record_has_the_numbers_that_it_is_made_of() -> None:
    kind = numbers(np.float64, "a", "b")
    made = arena.record(kind, b=2.0)
    assert made["a"] == 0.0 and made["b"] == 2.0 and made.dtype == kind
    with pytest.raises(ValueError, match="no field of name c"):
        arena.record(kind, c=1.0)

    class Named(NamedTuple):
        n: Annotated[Any, kind]

    with pytest.raises(TypeError, match=r"n is .* declared is"):
        arena.pack(Named(arena.record(numbers(np.float64, "a", "c"))), Few(np.zeros(3), np.zeros((2, 2), dtype=int)))


def test_a_field_that_does_not_say_its_dimensions_is_refused() -> None:
    class Vague(NamedTuple):
        a: Array2
        b: Array

    with pytest.raises(TypeError, match=r"Vague\.b is not declared"):
        arena.unpacker(Few, Vague)
