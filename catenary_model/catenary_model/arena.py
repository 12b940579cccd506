"""All arrays of a model in two blocks of memory, so that a call into compiled code hands over four arguments.

To hand over an array costs about 0.2 us a call; `layout` has thirty of them, and the step itself takes some 20 us. The
bundles are made once, as views into the blocks, and are put together again inside the compiled code.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from catenary_model.layout import Array, Constants, Ints, State
from phil_base.kernels import njit

C = TypeVar("C", bound=tuple[Any, ...])
S = TypeVar("S", bound=tuple[Any, ...])


def pack(constants: C, state: S) -> tuple[Array, Ints, Ints, C, S]:
    """Copy both bundles into blocks; return the block of floats, of integers, the table, and the bundles as views.

    The table has a row per array, those of the constants first: where it begins in its block, then its shape.
    """
    arrays: list[NDArray[np.generic]] = [*constants, *state]
    table = np.zeros((len(arrays), 6), dtype=np.int64)
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
    return floats, whole, table, type(constants)(*views[:n]), type(state)(*views[n:])


@njit(cache=True)
def one(block: Array, t: Ints) -> Array:
    """View of an array with one dimension in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1]]


@njit(cache=True)
def two(block: Array, t: Ints) -> Array:
    """View of an array with two dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2]].reshape((t[1], t[2]))


@njit(cache=True)
def three(block: Array, t: Ints) -> Array:
    """View of an array with three dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3]].reshape((t[1], t[2], t[3]))


@njit(cache=True)
def four(block: Array, t: Ints) -> Array:
    """View of an array with four dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4]].reshape((t[1], t[2], t[3], t[4]))


@njit(cache=True)
def five(block: Array, t: Ints) -> Array:
    """View of an array with five dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4] * t[5]].reshape((t[1], t[2], t[3], t[4], t[5]))


@njit(cache=True)
def unpack(floats: Array, whole: Ints, table: Ints) -> tuple[Constants, State]:
    """Put the bundles together again, in compiled code."""
    c = Constants(
        real=one(floats, table[0]),
        whole=one(whole, table[1]),
        sweep=four(floats, table[2]),
        middle=two(floats, table[3]),
        inner=four(floats, table[4]),
        outer=five(floats, table[5]),
        pivot=three(floats, table[6]),
        green=five(floats, table[7]),
        site=two(floats, table[8]),
        local=two(floats, table[9]),
        static=two(floats, table[10]),
        segment=three(floats, table[11]),
        gain=four(floats, table[12]),
    )
    s = State(
        q=four(floats, table[13]),
        taut=one(whole, table[14]),
        particle=two(floats, table[15]),
        counter=one(whole, table[16]),
        point=one(floats, table[17]),
        contact=one(floats, table[18]),
        segment=two(floats, table[19]),
        external=three(floats, table[20]),
        layer=three(floats, table[21]),
        rhs=three(floats, table[22]),
        here=two(floats, table[23]),
        where=two(whole, table[24]),
        psi=two(floats, table[25]),
        compliance=two(floats, table[26]),
        system=two(floats, table[27]),
        scratch=one(floats, table[28]),
    )
    return c, s
