"""All arrays of a model in two blocks of memory, so that a call into compiled code hands over four arguments.

To hand over an array costs about 0.2 us a call; `layout` has thirty of them, and the step itself takes some 20 us. The
bundles are made once, as views into the blocks, and are put together again inside the compiled code.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from catenary_model.layout import Array, Constants, Ints, State

_FIELDS = len(Constants._fields) + len(State._fields)


def pack(constants: Constants, state: State) -> tuple[Array, Ints, Ints, Constants, State]:
    """Copy both bundles into blocks; return the block of floats, of integers, the table, and the bundles as views.

    The table has a row per array, those of the constants first: where it begins in its block, then its shape.
    """
    arrays: list[NDArray[np.generic]] = [*constants, *state]
    table = np.zeros((_FIELDS, 6), dtype=np.int64)
    size = {True: 0, False: 0}
    for row, array in zip(table, arrays, strict=True):
        is_float = array.dtype == np.float64
        row[0] = size[is_float]
        row[1 : 1 + array.ndim] = array.shape
        size[is_float] += 8 * -(-array.size // 8)  # a cache line each
    floats, whole = np.zeros(size[True]), np.zeros(size[False], dtype=np.int64)
    views: list[NDArray[np.generic]] = []
    for row, array in zip(table, arrays, strict=True):
        block: NDArray[np.generic] = floats if array.dtype == np.float64 else whole
        view = block[row[0] : row[0] + array.size].reshape(array.shape)
        view[...] = array
        views.append(view)
    n = len(constants)
    return floats, whole, table, Constants(*views[:n]), State(*views[n:])  # type: ignore[arg-type]


@njit(cache=True)
def _one(block: Array, t: Ints) -> Array:
    return block[t[0] : t[0] + t[1]]


@njit(cache=True)
def _two(block: Array, t: Ints) -> Array:
    return block[t[0] : t[0] + t[1] * t[2]].reshape((t[1], t[2]))


@njit(cache=True)
def _three(block: Array, t: Ints) -> Array:
    return block[t[0] : t[0] + t[1] * t[2] * t[3]].reshape((t[1], t[2], t[3]))


@njit(cache=True)
def _four(block: Array, t: Ints) -> Array:
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4]].reshape((t[1], t[2], t[3], t[4]))


@njit(cache=True)
def _five(block: Array, t: Ints) -> Array:
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4] * t[5]].reshape((t[1], t[2], t[3], t[4], t[5]))


@njit(cache=True)
def unpack(floats: Array, whole: Ints, table: Ints) -> tuple[Constants, State]:
    """Put the bundles together again, in compiled code."""
    c = Constants(
        real=_one(floats, table[0]),
        whole=_one(whole, table[1]),
        sweep=_four(floats, table[2]),
        middle=_two(floats, table[3]),
        inner=_four(floats, table[4]),
        outer=_five(floats, table[5]),
        pivot=_three(floats, table[6]),
        green=_five(floats, table[7]),
        site=_two(floats, table[8]),
        local=_two(floats, table[9]),
        static=_two(floats, table[10]),
        segment=_three(floats, table[11]),
        gain=_four(floats, table[12]),
    )
    s = State(
        q=_four(floats, table[13]),
        taut=_one(whole, table[14]),
        particle=_two(floats, table[15]),
        counter=_one(whole, table[16]),
        point=_one(floats, table[17]),
        contact=_one(floats, table[18]),
        segment=_two(floats, table[19]),
        external=_three(floats, table[20]),
        layer=_three(floats, table[21]),
        rhs=_three(floats, table[22]),
        here=_two(floats, table[23]),
        where=_two(whole, table[24]),
        psi=_two(floats, table[25]),
        compliance=_two(floats, table[26]),
        system=_two(floats, table[27]),
        scratch=_one(floats, table[28]),
    )
    return c, s
