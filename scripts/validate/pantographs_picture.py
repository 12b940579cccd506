"""Picture of the sweep: sigma of both pantographs over their distance, and what the trailing one has of the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phil_study.drawing import save, subplots

Array = NDArray[np.float64]


class Sweep(NamedTuple):
    """Two pantographs at one speed, at every distance; forces in N, below 20 Hz."""

    speed: int
    """km/h."""
    distance: Array
    """m, (distances,)."""
    leading: Array
    """Standard deviation of the leading one's force, (distances,)."""
    trailing: Array
    alone: float
    """That of a ride alone."""
    frequency: Array
    """Of the harmonics of the passing of spans, Hz, (n,)."""
    more: Array
    """What the trailing one has beyond a ride alone, rms over time and distances, (n,)."""
    own: Array
    """What it has alone, rms, (n,)."""
    turns: Array
    """Turns of that phasor for a metre of distance, as measured, 1/m, (n,)."""
    of_c: Array
    """The same of a wave with the contact wire's speed, 1/m, (n,)."""
    of_line: Array
    """The same of the waves of the line that the leading one feeds, 1/m, rising, (waves,)."""


def draw(sweeps: Sequence[Sweep], path: Path) -> None:
    """Draw sigma over the distance, the harmonics' size, and how fast each goes round."""
    figure, axes = subplots(3, 1, figsize=(10, 10), layout="constrained")
    for number, sweep in enumerate(sweeps):
        colour = f"C{number}"
        name = f"{sweep.speed} km/h"
        axes[0].plot(sweep.distance, sweep.trailing, color=colour, lw=1.4, label=f"{name}, trailing")
        axes[0].plot(sweep.distance, sweep.leading, color=colour, lw=0.8, ls=":", label=f"{name}, leading")
        axes[0].axhline(sweep.alone, color=colour, lw=0.8, ls="--", label=f"{name}, alone")
        width = 0.18
        place = sweep.frequency + (number - 0.5 * (len(sweeps) - 1)) * 2 * width
        axes[1].bar(place, sweep.more, width, color=colour, label=f"{name}, of the leading one")
        axes[1].bar(place + width, sweep.own, width, color=colour, alpha=0.35, label=f"{name}, alone")
        strong = sweep.more > 0.1 * sweep.more.max()
        axes[2].plot(sweep.frequency, sweep.of_c, color=colour, lw=0.8, label=f"{name}, wave with c")
        axes[2].scatter(sweep.frequency[strong], sweep.turns[strong], s=8 * sweep.more[strong], color=colour)
        shown = sweep.of_line[sweep.of_line < 0.2]
        edge = sweep.frequency[-1] + 0.4 + 0.8 * number
        label = f"{name}, waves of the line"
        axes[2].hlines(shown, edge, edge + 0.6, color=colour, lw=1.0, label=label)
    axes[0].set(xlabel="distance between the pantographs in m", ylabel="sigma below 20 Hz in N")
    axes[1].set(xlabel="frequency in Hz (harmonics of the passing of spans)", ylabel="force in N, rms")
    axes[2].set(xlabel="frequency in Hz (area: size of the harmonic)", ylabel="turns for a metre of distance")
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.legend(fontsize=8, ncols=2)
    save(figure, path)
