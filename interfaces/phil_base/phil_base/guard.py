"""Checks of incoming numbers, cheap enough for every cycle."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e6
"""m, m/s or N: beyond it nothing can have been measured, and a solver that is fed with it may not recover."""


def plausible(*values: float) -> bool:
    """Tell whether all lengths, speeds and forces are finite and within `LARGEST`, of either sign."""
    # The smallest of some numbers may not be told if one of them is no number.
    return all(map(isfinite, values)) and min(values) >= -LARGEST and max(values) <= LARGEST


def finite(*values: float) -> bool:
    """Tell whether all values are finite numbers."""
    return all(map(isfinite, values))


def finite_array(values: Sequence[float], out: NDArray[np.float64]) -> bool:
    """Copy ``values`` into ``out``; tell whether the size fits and every entry is finite (else ``out`` is unusable)."""
    if len(values) != out.shape[0]:
        return False
    out[:] = values
    # A sum is finite only if every term is, unless finite terms overflow: such a state is to be refused as well.
    return isfinite(np.add.reduce(out))


def finite_rows(message: Any, names: Sequence[str], out: NDArray[np.float64]) -> bool:
    """Do as `finite_array` with several arrays of a message: the one of ``names[i]`` goes to ``out[i]``.

    A message that has them as ``rows`` of one array is looked at in one go.
    """
    rows = getattr(message, "rows", None)
    if rows is None:
        return all(finite_array(getattr(message, name), row) for name, row in zip(names, out, strict=True))
    if rows.shape != out.shape:
        rows = rows[: len(names)]  # more arrays of that length follow
        if rows.shape != out.shape:
            return False
    out[:] = rows
    return isfinite(np.add.reduce(out, axis=None))


def objection(message: Any, names: Sequence[str], sizes: int | None = None) -> str:
    """Say in words which of a message's fields cannot be used; an array has to have ``sizes`` entries, if given."""
    unusable, found = [], []
    for name in names:
        value = getattr(message, name)
        if isinstance(value, (int, float)):
            if not isfinite(value):
                unusable.append(name)
        elif sizes is not None and len(value) != sizes:
            found.append(f"{name} has {len(value)} entries, not {sizes}")
        elif not np.isfinite(value).all():
            unusable.append(name)
    if unusable:
        found.append(f"{', '.join(unusable)} {'is' if len(unusable) == 1 else 'are'} not finite")
    # Finite, all of them, but too large to be added up.
    return "; ".join(found) or f"{', '.join(names)} are out of all proportion"
