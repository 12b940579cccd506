"""Long series drawn by the lowest and the highest value of each piece: the same picture, in less time and memory."""

from __future__ import annotations

from typing import Any

import numpy as np

from energy_monitor.report.results import Floats

MOST = 100_000
"""Values that are drawn as they are, and pieces at most of a longer series: many to each column of a picture."""


def pieces(length: int, most: int = MOST) -> int:
    """Give the size of the pieces of a series of so many values; 1 draws them as they are."""
    return max(1, -(-length // most))


def lowest(values: Floats, size: int) -> Floats:
    """Give the lowest value of each piece of ``size`` values."""
    return values if size == 1 else np.asarray(np.minimum.reduceat(values, np.arange(0, len(values), size)))


def highest(values: Floats, size: int) -> Floats:
    """Give the highest value of each piece of ``size`` values."""
    return values if size == 1 else np.asarray(np.maximum.reduceat(values, np.arange(0, len(values), size)))


def line(axes: Any, time: Floats, values: Floats, **style: Any) -> None:
    """Plot a series, a long one by its outline."""
    axes.plot(*outline(time, values, pieces(len(time))), **style)


def outline(time: Floats, values: Floats, size: int) -> tuple[Floats, Floats]:
    """Give a line that goes through the lowest and the highest value of each piece of ``size`` values."""
    if size == 1:
        return time, values
    both = np.column_stack([lowest(values, size), highest(values, size)])
    return np.repeat(time[::size], 2), both.ravel()
