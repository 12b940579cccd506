"""Bundles of arrays that compiled code keeps: handed over once, not with each call.

To hand over an array costs about 0.2 us a call, and a number in a named tuple a quarter of that; a rig has eighty of
them, which took longer than its step. What is held is the bundle itself, with views of the same arrays: who changes
them in Python changes what the kernel sees. Numbers are copies: hold anew what gets other ones.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core.extending import overload
from numba.experimental import structref

from phil_base.kernels import njit


@structref.register
class HeldType(types.StructRef):  # type: ignore[misc]
    """Type of what is held, in compiled code."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Keep constants of a type as that type."""
        return tuple((name, types.unliteral(kind)) for name, kind in fields)


class Held(structref.StructRefProxy):  # type: ignore[misc]
    """What is held, in Python: nothing but something to hand over."""


structref.define_boxing(HeldType, Held)


def _made(constants: Any, state: Any) -> Any:
    raise NotImplementedError("only in compiled code")


@overload(_made)
def _overload_made(constants: Any, state: Any) -> Any:
    kind = HeldType((("constants", constants), ("state", state)))

    def make(constants: Any, state: Any) -> Any:
        held = structref.new(kind)
        held.constants = constants
        held.state = state
        return held

    return make


@njit(cache=True)
def hold(constants: Any, state: Any) -> Any:
    """Hold two bundles: what a kernel only reads, and what it changes, as far as that is arrays."""
    return _made(constants, state)
