"""Picture of the test rig: identified response, current with and without weighting, chirp, force step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from phil_study.drawing import save, subplots
from test_rig_sim import linear_loop
from test_rig_sim.identify import pt2_response
from validate.rig_findings import Findings

WIDEST = 150.0
"""End of the frequency axis in Hz."""


def draw(findings: Sequence[Findings], force: float, path: Path) -> None:
    """Draw all rigs into one picture; ``force`` is that of the step, N."""
    figure, axes = subplots(3, 2, figsize=(11, 11), layout="constrained")
    _response(findings, axes[0, 0], axes[0, 1])
    _current(findings, axes[1, 0], axes[1, 1])
    _chirp(findings, axes[2, 0])
    _step(findings, force, axes[2, 1])
    for axis in axes.flat:
        axis.grid(alpha=0.3, which="both")
    save(figure, path)


def _response(findings: Sequence[Findings], gain: Axes, lag: Axes) -> None:
    for number, one in enumerate(findings):
        f, found = one.response.frequencies_hz, one.found
        fine = np.geomspace(0.5, 100.0, 400)
        model = pt2_response(found.natural_frequency_hz, found.damping, one.parameters.cycle_time, fine, found.delay)
        gain.loglog(fine, np.abs(model), color=f"C{number}", lw=1.0)
        gain.loglog(f, np.abs(one.response.measured), "o", ms=3, color=f"C{number}", label=one.name)
        for x, y, mark in ((fine, model, "-"), (f, one.response.measured, "o")):
            lag.semilogx(x, -1e3 * np.unwrap(np.angle(y)) / (2.0 * np.pi * x), mark, ms=3, lw=1.0, color=f"C{number}")
    gain.set(title="identified: position over reference", ylabel="gain", xlabel="Hz")
    gain.legend(fontsize=8)
    lag.set(title="its lag (line: PT2 with dead time)", ylabel="ms", xlabel="Hz")


def _current(findings: Sequence[Findings], *axes: Axes) -> None:
    flexible = [one for one in findings if one.parameters.imperfections.structure]
    f = np.geomspace(5.0, WIDEST, 1500)
    for axis, one in zip(axes, flexible, strict=False):
        marks = one.parameters.structure.frequencies_hz
        fine = np.sort(np.concatenate([f, *(np.linspace(0.97, 1.03, 121) * mark for mark in marks)]))
        for loop, style, weighting in zip(one.loops, ("--", "-"), ("without", "with"), strict=True):
            for column, label, color in (
                (linear_loop.REFERENCE, "from reference, A/mm", "C0"),
                (linear_loop.FORCE, "from contact force, A/kN", "C1"),
            ):
                scale = 1e-3 if column == linear_loop.REFERENCE else 1e3
                gains = scale * np.abs(loop.response(fine, column, linear_loop.CURRENT))
                said = f"{label}, {weighting} weighting"
                axis.loglog(fine, gains, style, lw=1.0, color=color, label=said)
        axis.set(title=f"current, {one.name}", xlabel="Hz")
    axes[0].legend(fontsize=7)


def _chirp(findings: Sequence[Findings], axis: Axes) -> None:
    for number, one in enumerate(findings):
        _, place, model = one.chirp
        t = one.parameters.cycle_time * np.arange(place.size)
        axis.plot(t, 1e6 * (place - model), lw=0.8, color=f"C{number}", label=one.name)
    axis.set(title="chirp of 10 mm, 0.5 to 12 Hz, free: rig less model", xlabel="s", ylabel="um")
    axis.legend(fontsize=8)


def _step(findings: Sequence[Findings], force: float, axis: Axes) -> None:
    for number, one in enumerate(findings):
        period = one.parameters.cycle_time / one.parameters.inner_steps
        shown = one.deviation[: round(0.1 / period)]
        axis.plot(1e3 * period * np.arange(shown.size), 1e3 * shown, lw=1.0, color=f"C{number}", label=one.name)
    axis.set(title=f"unknown force of {force:g} N", xlabel="ms", ylabel="mm")
    axis.legend(fontsize=8)
