"""Picture of the reference model's ride: contact force over the evaluated spans, uplift of their supports."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import DROPPERS_3_1
from catenary_model.reference import Ride
from phil_study.drawing import save, subplots

Array = NDArray[np.float64]


class Evaluated(NamedTuple):
    """A ride and what it is judged by; forces in N."""

    record: Ride
    below: Array
    """Contact force below 20 Hz, without the filter's delay."""
    mean: float
    sigma: float


def draw(rides: Mapping[float, Evaluated], between: tuple[float, float], span: float, path: Path) -> None:
    """Draw force below 20 Hz (and as it is, faint) of every speed, and the uplift of the supports as it passes.

    ``between`` is the stretch that is evaluated, ``span`` the length of a span, m.
    """
    first, last = between
    figure, axes = subplots(len(rides) + 1, 1, figsize=(10, 3.0 * (len(rides) + 1)), layout="constrained")
    for number, (speed, (record, below, mean, sigma)) in enumerate(rides.items()):
        axis, colour = axes[number], f"C{number}"
        inside = record.between(first, last)
        zeta = record.zeta[inside]
        axis.plot(zeta, record.F[inside], color="0.75", lw=0.6, label="contact force")
        axis.plot(zeta, below[inside], color=colour, lw=1.4, label="below 20 Hz, without the filter's delay")
        axis.axhspan(mean - 3.0 * sigma, mean + 3.0 * sigma, color=colour, alpha=0.08, lw=0)
        axis.axhline(mean, color=colour, lw=0.8, ls="--")
        for mast in span * np.arange(int(first // span), int(last // span)):
            for position in DROPPERS_3_1:
                axis.axvline(mast + position, ymax=0.03, color="k", lw=0.8)
            axis.axvline(mast, color="k", lw=0.8, alpha=0.5)
        axis.set(
            title=f"{speed:g} km/h: mean {mean:.1f} N, sigma {sigma:.1f} N (band: mean +- 3 sigma)",
            ylabel="force in N",
            xlim=between,
        )
        axis.legend(loc="upper right", fontsize=8, ncols=2)
        for i, support in enumerate(record.supports):
            if first - 1.0 < support < last + 1.0:
                away = record.zeta - support
                near = abs(away) < span
                label = f"{speed:g} km/h" if support < first + 1.0 else None
                axes[-1].plot(away[near], 1e3 * record.uplift[near, i], color=colour, lw=1.0, label=label)
    axes[-2].set_xlabel("track position in m (ticks: droppers)")
    axes[-1].set(xlabel="pantograph past the support in m", ylabel="uplift in mm", title="Uplift of the contact wire")
    axes[-1].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, path)
