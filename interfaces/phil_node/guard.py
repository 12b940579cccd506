"""Checks of incoming numbers, cheap enough for every cycle."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray


def finite(*values: float) -> bool:
    """Tell whether all values are finite numbers."""
    return all(map(isfinite, values))


def finite_array(values: Sequence[float], out: NDArray[np.float64]) -> bool:
    """Copy ``values`` into ``out``; tell whether the size fits and every entry is finite (else ``out`` is unusable)."""
    if len(values) != out.shape[0]:
        return False
    out[:] = values
    # A sum is finite only if every term is, unless finite terms overflow: such a state is to be refused as well.
    return isfinite(float(out.sum()))
