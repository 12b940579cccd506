"""Figures of absorbing boundaries: reflection over frequency, Pareto fronts, snapshots in the manner of Figure 3.7."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.design import Design
from catenary_model.absorbing.dispersion import waves
from catenary_model.absorbing.pareto import Point, nondominated
from catenary_model.absorbing.reflection import reflection
from catenary_model.absorbing.stencil import Array, Stencil

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FLOOR = 1e-16
PROPAGATES = 1.05
"""Growth from node to node up to which a wave counts as propagating: damping makes it differ from 1."""


def reflection_figure(
    stencil: Stencil,
    boundaries: Mapping[str, BoundaryStencil],
    frequencies: Array,
    measured: Mapping[str, tuple[Array, Array]] | None = None,
    band: tuple[float, float] | None = None,
) -> Figure:
    """Draw reflected amplitude over frequency, from the dispersion relation (lines) and from runs (dots).

    Args:
        stencil: of the interior.
        boundaries: by their label.
        frequencies: Hz, of the lines.
        measured: by label, (frequencies in Hz, amplitudes).
        band: that the design was for, shaded, Hz.
    """
    figure, (axes,) = _figure(1, 7.0, 4.2)
    if band:
        axes.axvspan(*band, color="0.93", zorder=0)
    for label, boundary in boundaries.items():
        # Above the cut-off of the grid nothing propagates, and a ratio of evanescent amplitudes says little.
        modes = waves(stencil, np.exp(2j * np.pi * frequencies * stencil.dt), boundary.side)
        f = frequencies[np.abs(modes.incident[:, 0]) < PROPAGATES]
        axes.loglog(f, 100.0 * np.abs(reflection(stencil, boundary, f)) + FLOOR, label=label)
    for label, (f, amplitude) in (measured or {}).items():
        axes.loglog(f, 100.0 * amplitude + FLOOR, "o", ms=4, mfc="none", label=label)
    axes.set(xlabel="frequency / Hz", ylabel="reflected amplitude / %")
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(frameon=False)
    return figure


def fronts_figure(points: Sequence[Point], designs: Sequence[Design], chosen: Design) -> Figure:
    """Draw performance against stability (left) and against the size of the stencil (right), the chosen point marked.

    Args:
        points: candidates of one size, stable or not, from `stability_points`.
        designs: stable ones of several sizes, from `size_points`.
        chosen: one of `designs`.
    """
    figure, (left, right) = _figure(2, 11.0, 4.2)
    excess = np.array([p.radius - 1.0 for p in points])
    reflected = np.array([p.reflection for p in points])
    on = nondominated(np.column_stack([reflected, excess]))
    stable = excess < 0.0
    left.loglog(reflected[stable], -excess[stable], ".", color="C0", label="stable: 1 - spectral radius")
    left.loglog(
        reflected[~stable], np.maximum(excess[~stable], 1e-12), "x", color="0.7", ms=4, label="unstable: excess"
    )
    front = np.flatnonzero(on & stable)
    front = front[np.argsort(reflected[front])]
    left.loglog(reflected[front], -excess[front], "-o", color="C3", mfc="none", label="front")
    left.loglog([chosen.reflection], [max(1.0 - chosen.radius, 1e-12)], "k*", ms=13, label="chosen")
    left.set(xlabel="largest reflected amplitude in the band", ylabel="distance of the spectral radius from 1")
    sized = [Point.of(d) for d in designs]
    for n_t in sorted({d.boundary.n_t for d in designs}):
        line = sorted((p for p in sized if p.boundary.n_t == n_t), key=lambda p: p.boundary.n_x)
        right.semilogy([p.size for p in line], [p.reflection for p in line], ".:", label=f"$N_t$ = {n_t}")
    best = nondominated(np.array([[p.size, p.reflection] for p in sized]))
    steps = sorted((p.size, p.reflection) for p, marked in zip(sized, best, strict=True) if marked)
    right.semilogy(*zip(*steps, strict=True), "-o", color="C3", mfc="none", label="front")
    right.semilogy([Point.of(chosen).size], [chosen.reflection], "k*", ms=13, label="chosen")
    right.set(xlabel="coefficients of the boundary", ylabel="largest reflected amplitude in the band")
    for axes in (left, right):
        axes.grid(True, which="major", alpha=0.3)
        axes.legend(frameon=False, fontsize=8)
    return figure


def snapshots_figure(x: Array, times: Array, frames: Array, exact: Array) -> Figure:
    """Draw snapshots of a run beside those of a domain too long to notice, and their difference (Figure 3.7).

    Args:
        x: m, shape (nodes,).
        times: s, shape (k,).
        frames: with the absorbing boundary, shape (k, nodes).
        exact: of the long domain at the same nodes, shape (k, nodes).
    """
    figure, (left, right) = _figure(2, 11.0, 1.1 * len(times) + 0.8)
    height = float(np.abs(frames).max())
    error = float(np.abs(frames - exact).max()) or 1.0
    for row, (time, frame, truth) in enumerate(zip(times, frames, exact, strict=True)):
        base = -1.3 * row
        left.plot(x, base + frame / height, color="C0", lw=1.2)
        left.plot(x, base + truth / height, "k:", lw=1.0)
        right.plot(x, base + (frame - truth) / error, color="C3", lw=1.0)
        for axes in (left, right):
            axes.text(x[-1], base + 0.15, f"$T_{row + 1}$ = {time:.2f} s", ha="right", fontsize=8)
    left.set(title=f"displacement, largest {height:.3g}; dotted: long domain", xlabel="x / m", yticks=[])
    right.set(title=f"difference to the long domain, largest {error:.2g}", xlabel="x / m", yticks=[])
    return figure


def _figure(columns: int, width: float, height: float):  # type: ignore[no-untyped-def]
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained", dpi=130)
    return figure, [figure.add_subplot(1, columns, 1 + i) for i in range(columns)]
