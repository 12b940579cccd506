"""Picture of the reference model's ride: contact force over the evaluated spans, uplift of their supports."""

from __future__ import annotations

from pathlib import Path

import matplotlib

from catenary_model.line import DROPPERS_3_1
from catenary_model.reference import Ride
from validate import en50318

matplotlib.use("Agg")
from matplotlib import pyplot


def draw(records: dict[int, Ride], path: Path) -> None:
    """Draw force below 20 Hz (and as it is, faint) of every speed, and the uplift of the supports as it passes."""
    figure, axes = pyplot.subplots(len(records) + 1, 1, figsize=(10, 3.0 * (len(records) + 1)), layout="constrained")
    for number, (speed, record) in enumerate(records.items()):
        axis, colour = axes[number], f"C{number}"
        inside = record.between(en50318.FIRST, en50318.LAST)
        zeta = record.zeta[inside]
        force = en50318.zero_phase(record.F, float(record.t[1] - record.t[0]))[inside]
        mean, sigma, high, low = en50318.values(record)[:4]
        axis.plot(zeta, record.F[inside], color="0.75", lw=0.6, label="contact force")
        axis.plot(zeta, force, color=colour, lw=1.4, label="below 20 Hz, without the filter's delay")
        axis.axhspan(low, high, color=colour, alpha=0.08, lw=0)
        axis.axhline(mean, color=colour, lw=0.8, ls="--")
        for span in range(int(en50318.FIRST // en50318.SPAN), int(en50318.LAST // en50318.SPAN)):
            for position in DROPPERS_3_1:
                axis.axvline(span * en50318.SPAN + position, ymax=0.03, color="k", lw=0.8)
            axis.axvline(span * en50318.SPAN, color="k", lw=0.8, alpha=0.5)
        axis.set(
            title=f"{speed} km/h: mean {mean:.1f} N, sigma {sigma:.1f} N (band: mean +- 3 sigma)",
            ylabel="force in N",
            xlim=(en50318.FIRST, en50318.LAST),
        )
        axis.legend(loc="upper right", fontsize=8, ncols=2)
        for i, support in enumerate(record.supports):
            if en50318.FIRST - 1.0 < support < en50318.LAST + 1.0:
                away = record.zeta - support
                near = abs(away) < en50318.SPAN
                label = f"{speed} km/h" if support < en50318.FIRST + 1.0 else None
                axes[-1].plot(away[near], 1e3 * record.uplift[near, i], color=colour, lw=1.0, label=label)
    axes[-2].set_xlabel("track position in m (ticks: droppers)")
    axes[-1].set(xlabel="pantograph past the support in m", ylabel="uplift in mm", title="Uplift of the contact wire")
    axes[-1].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)
