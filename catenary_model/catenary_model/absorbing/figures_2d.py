"""Figures of the 2-D wave equation: reflection over the angle of incidence, fronts, a bump leaving a square."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catenary_model.absorbing.incidence import Design, Incidence
from catenary_model.absorbing.pareto import nondominated
from catenary_model.absorbing.stencil import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {
    "EM 1": "0.7",
    "EM 2": "0.35",
    "EM 2 centred": "0.35",
    "tuned for 0": "tab:blue",
    "tuned for 60": "tab:orange",
}


def angle_figure(result: Incidence) -> Figure:
    """Largest reflected amplitude over the band against the angle of incidence, one line a boundary."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for name, values in result.worst.items():
        style = "--" if name.endswith("centred") else "-"
        label = name.replace("EM ", "Engquist-Majda ") if name.startswith("EM") else f"{name}°"
        axes.semilogy(result.degrees, values, style, color=COLOURS.get(name), label=label)
    axes.axvspan(0.0, 60.0, color="tab:blue", alpha=0.06, lw=0.0)
    axes.set_xlim(0.0, float(result.degrees[-1]))
    axes.set_xlabel("angle of incidence / °")
    axes.set_ylabel("largest reflected amplitude / %")
    axes.set_title(f"Waves of {result.band.shortest:g} to {result.band.longest:g} grid spacings")
    axes.grid(True, which="both", alpha=0.25)
    axes.legend()
    return figure


def front_figure(result: Incidence) -> Figure:
    """Fronts of performance against stability margin and against stencil size; the chosen points are marked.

    Hollow points are stable, but amplify disturbances on their way to decay more than Engquist and Majda's second
    boundary does (products of three factors do); they are not part of the line.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for name, chosen in result.designs.items():
        colour = COLOURS[name]
        for axes, designs, by_size in (
            (left, result.stability_fronts.get(name, ()), False),
            (right, result.size_fronts.get(name, ()), True),
        ):
            points = np.array([_point(d, by_size) for d in designs]).reshape(-1, 2)
            calm = np.array([d.amplification <= result.figures["EM 2"].amplification for d in designs], bool)
            axes.plot(*points[~calm].T, "o", ms=5, color=colour, mfc="none")
            axes.plot(*points[calm].T, "o", ms=4, color=colour, alpha=0.6)
            front = points[calm][nondominated(points[calm] * (1.0 if by_size else -1.0, 1.0))]
            front = front[np.argsort(front[:, 0])]
            axes.plot(*front.T, "-", color=colour, label=f"{name}°")
            axes.plot(*_point(chosen, by_size), "*", ms=14, color=colour, mec="k")
    left.set(
        xscale="log",
        yscale="log",
        xlabel="margin of stability: 1 - spectral radius",
        ylabel="weighted rms of the reflected amplitude / %",
        title="over the damping of the factors",
    )
    right.set(xlabel="coefficients that are not zero", title="over the size of the stencil")
    for axes in (left, right):
        axes.grid(True, which="both", alpha=0.25)
    right.plot([], [], "ko", mfc="none", ms=5, label="amplifies more than EM 2")
    right.legend(title="chosen: star")
    return figure


def _point(design: Design, by_size: bool) -> tuple[float, float]:
    return (float(design.size) if by_size else 1.0 - design.radius), 100.0 * design.objective


def square_figure(result: Incidence, steps: Sequence[int] = (0, 60, 100, 200)) -> Figure:
    """A bump that leaves a square: large domain, Engquist-Majda 2 and the tuned boundary, and the difference.

    Args:
        result: from `incidence`.
        steps: snapshots, within the run of the bump.
    """
    from matplotlib.figure import Figure

    from catenary_model.absorbing import square
    from catenary_model.absorbing.engquist_majda import first_order, second_order
    from catenary_model.absorbing.higdon import diagonal

    stencil, chosen = result.stencil, result.designs["tuned for 0"]
    free = result.free
    nodes = free.shape[1]
    runs: list[tuple[str, Array]] = [("domain too large\nto notice", free)]
    cases = (
        ("Engquist-Majda 2\nminus that", second_order(stencil), first_order(stencil), 0.0),
        ("tuned for 0°\nminus that", chosen.boundary, chosen.near_corner, chosen.damping),
    )
    for label, boundary, near, damping in cases:
        step = square.update(stencil, boundary, nodes, diagonal(stencil, damping=damping), near)
        runs.append((label, square.history(step, square.bump(nodes, 2.0), max(steps)) - free[: max(steps) + 1]))
    figure = Figure(figsize=(2.2 * len(steps) + 1.6, 6.6), layout="compressed")
    grid = figure.subplots(len(runs), len(steps), squeeze=False)
    for row, (label, run) in enumerate(runs):
        scale = 0.1 if row == 0 else 0.003
        for column, n in enumerate(steps):
            axes = grid[row, column]
            image = axes.imshow(run[n].T, cmap="RdBu", vmin=-scale, vmax=scale, origin="lower")
            axes.set_xticks([])
            axes.set_yticks([])
            if row == 0:
                axes.set_title(f"step {n}")
        grid[row, 0].set_ylabel(label)
        figure.colorbar(image, ax=list(grid[row]), shrink=0.8)
    return figure
