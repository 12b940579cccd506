"""Picture of a journey from standstill to standstill: speed, contact force, differences from the finest run."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phil_study.drawing import save, subplots

Array = NDArray[np.float64]


class Journey(NamedTuple):
    """The finest run on a common time grid, and what coarser ones differ in."""

    t: Array
    """s."""
    speed: Array
    """m/s."""
    force: Array
    """Below 20 Hz, N."""
    errors: Mapping[str, Array]
    """By mesh and step: force less that of the finest run, N; may be some samples shorter."""


def draw(journey: Journey, path: Path) -> None:
    """Draw the three, one above the other."""
    figure, axes = subplots(3, 1, figsize=(10, 8), sharex=True, layout="constrained")
    axes[0].plot(journey.t, 3.6 * journey.speed, color="k", lw=1.2)
    axes[0].set(ylabel="speed in km/h")
    axes[1].plot(journey.t, journey.force, lw=0.8)
    axes[1].set(ylabel="force below 20 Hz in N")
    for name, error in journey.errors.items():
        axes[2].plot(journey.t[: error.size], error, lw=0.7, label=name)
    axes[2].set(xlabel="time in s", ylabel="difference in N")
    axes[2].legend(fontsize=8, ncols=3)
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, path)
