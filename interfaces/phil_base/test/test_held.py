"""Bundles that compiled code holds: arrays are the caller's own, numbers are copies."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phil_base.held import Held, hold
from phil_base.kernels import njit


class Constants(NamedTuple):
    factor: float
    offset: NDArray[np.float64]


class State(NamedTuple):
    x: NDArray[np.float64]


@njit
def scaled(held: Held) -> float:
    x = held.state.x
    for i in range(x.size):
        x[i] = held.constants.factor * x[i] + held.constants.offset[i]
    return x[0]


def test_a_kernel_changes_the_arrays_that_were_given_and_sees_what_python_changes() -> None:
    constants, state = Constants(2.0, np.ones(3)), State(np.arange(3.0))
    held: Any = hold(constants, state)
    assert scaled(held) == 1.0
    np.testing.assert_array_equal(state.x, [1.0, 3.0, 5.0])
    constants.offset[:] = 0.0
    state.x[:] = 4.0
    assert scaled(held) == 8.0
    np.testing.assert_array_equal(state.x, 8.0)


def test_what_is_held_keeps_its_arrays_alive() -> None:
    held: Any = hold(Constants(1.0, np.full(1000, 3.0)), State(np.zeros(1000)))
    for _ in range(50):
        np.full(1000, 7.0)  # would take the place of what was freed
    assert scaled(held) == 3.0
