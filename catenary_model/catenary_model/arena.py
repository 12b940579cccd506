"""All arrays of a model in two blocks of memory, so that a call into compiled code hands over four arguments.

To hand over an array costs about 0.2 us a call; `layout` has thirty of them, and the step itself takes some 20 us. The
bundles are made once, as views into the blocks, and are put together again inside the compiled code. Which arrays there
are, in which order, of what kind and with how many dimensions, is said once: by the fields of the bundles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from catenary_model.layout import Array, Ints, Kind
from phil_base.kernels import njit

C = TypeVar("C", bound=NamedTuple)
S = TypeVar("S", bound=NamedTuple)


def pack(constants: C, state: S) -> tuple[Array, Ints, Ints, C, S]:
    """Copy both bundles into blocks; return the block of floats, of integers, the table, and the bundles as views.

    The table has a row per array, those of the constants first: where it begins in its block, then its shape. Raises
    TypeError for an array that is not what its field is declared as.
    """
    declared = [*kinds(type(constants)), *kinds(type(state))]
    arrays: list[NDArray[np.generic]] = []
    for name, entry, kind in zip((*constants._fields, *state._fields), (*constants, *state), declared, strict=True):
        if (entry.dtype if isinstance(kind, np.dtype) else Kind(entry.dtype.type, entry.ndim)) != kind:
            raise TypeError(f"{name} is {entry.dtype} with {entry.ndim} dimensions, declared is {kind}")
        arrays.append(np.array([entry]).view(kind[0]) if isinstance(kind, np.dtype) else entry)
    table = np.zeros((len(arrays), 6), dtype=np.int64)
    size = {True: 0, False: 0}
    for row, array in zip(table, arrays, strict=True):
        is_float = array.dtype == np.float64
        row[0] = size[is_float]
        row[1 : 1 + array.ndim] = array.shape
        size[is_float] += 8 * -(-array.size // 8)  # a cache line each
    floats, whole = np.zeros(size[True]), np.zeros(size[False], dtype=np.int64)
    views: list[Any] = []
    for row, array, kind in zip(table, arrays, declared, strict=True):
        block: NDArray[np.generic] = floats if array.dtype == np.float64 else whole
        view = block[row[0] : row[0] + array.size].reshape(array.shape)
        view[...] = array
        views.append(view.view(kind)[0] if isinstance(kind, np.dtype) else view)
    n = len(constants)
    return floats, whole, table, type(constants)._make(views[:n]), type(state)._make(views[n:])


@njit
def one(block: Array, t: Ints) -> Array:
    """View of an array with one dimension in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1]]


@njit
def two(block: Array, t: Ints) -> Array:
    """View of an array with two dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2]].reshape((t[1], t[2]))


@njit
def three(block: Array, t: Ints) -> Array:
    """View of an array with three dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3]].reshape((t[1], t[2], t[3]))


@njit
def four(block: Array, t: Ints) -> Array:
    """View of an array with four dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4]].reshape((t[1], t[2], t[3], t[4]))


@njit
def five(block: Array, t: Ints) -> Array:
    """View of an array with five dimensions in its block; t is its row of the table."""
    return block[t[0] : t[0] + t[1] * t[2] * t[3] * t[4] * t[5]].reshape((t[1], t[2], t[3], t[4], t[5]))


def unpacker(constants: type[C], state: type[S]) -> Any:
    """Make the compiled `unpack(floats, whole, table)` that puts two bundles together again, views into the blocks.

    Every field has to be declared as one of the arrays of `layout`, which say kind and number of dimensions. Raises
    TypeError for another one.
    """
    n = len(constants._fields)
    first, second = _views(kinds(constants), 0), _views(kinds(state), n)

    @njit(inline="always")
    def unpack(floats: Array, whole: Ints, table: Ints) -> Any:
        return constants(*first(floats, whole, table)), state(*second(floats, whole, table))

    return unpack


def record(kind: np.dtype[np.void], **values: float) -> Any:
    """Make a record of `layout.numbers`; what is not given is 0. Raises ValueError for a name that it does not have."""
    made = np.zeros(1, kind)[0]
    for name, value in values.items():
        made[name] = value
    return made


def kinds(bundle: type[NamedTuple]) -> list[Kind | np.dtype[np.void]]:
    """Give the kinds of a bundle's arrays and records in their order. Raises TypeError for a field that is neither."""
    found = []
    for name, hint in get_type_hints(bundle, include_extras=True).items():
        said = [one for one in getattr(hint, "__metadata__", ()) if isinstance(one, Kind | np.dtype)]
        if not said:
            raise TypeError(f"{bundle.__name__}.{name} is not declared as an array of catenary_model.layout")
        found += said
    return found


def _views(arrays: Sequence[Kind | np.dtype[np.void]], row: int) -> Any:
    """Make the compiled function that gives arrays as a tuple of views, the first by this row of the table.

    A tuple of arrays of different kinds cannot be filled in a loop: each function adds one view to those of the next.
    They are inlined before types are found: else every tuple on the way counts references, 8 % of a cycle.
    """
    if not arrays:

        @njit(inline="always")
        def none(floats: Array, whole: Ints, table: Ints) -> Any:
            return ()

        return none
    kind = arrays[0]
    view = _record(kind) if isinstance(kind, np.dtype) else _VIEWS[kind.dimensions]
    block = _BLOCKS[kind[0].type if isinstance(kind, np.dtype) else kind.kind]
    rest = _views(arrays[1:], row + 1)

    @njit(inline="always")
    def some(floats: Array, whole: Ints, table: Ints) -> Any:
        return (view(block(floats, whole), table[row]), *rest(floats, whole, table))

    return some


def _record(kind: np.dtype[np.void]) -> Any:
    """Make the compiled function that gives a record in its block; t is its row of the table."""

    @njit
    def view(block: Array, t: Ints) -> Any:
        return block[t[0] : t[0] + t[1]].view(kind)[0]

    return view


@njit(inline="always")
def _floats(floats: Array, whole: Ints) -> Array:
    return floats


@njit(inline="always")
def _whole(floats: Array, whole: Ints) -> Ints:
    return whole


_BLOCKS: dict[type[np.generic], Any] = {np.float64: _floats, np.int64: _whole}
_VIEWS = {1: one, 2: two, 3: three, 4: four, 5: five}
