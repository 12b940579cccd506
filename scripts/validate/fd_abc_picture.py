"""Pictures and coefficient files of the optimised boundaries."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import matplotlib.figure
import numpy as np
from numpy.typing import NDArray

from catenary_model import absorbing
from catenary_model.absorbing import figures, figures_2d, incidence, pareto
from validate import fd_abc_beam as beams

matplotlib.use("Agg")


def draw(
    fronts: beams.Fronts,
    cases: tuple[beams.Case, ...],
    result: incidence.Incidence,
    box: NDArray[np.float64],
    folder: Path,
) -> None:
    """Write everything into a folder: pictures of (a) and (b), coefficients of the chosen boundaries and the front.

    ``box`` is the amplitude in % that the box scheme reflects, by angle.
    """
    first = cases[0]
    shot = first.snapshots
    snapshots = figures.snapshots_figure(shot.x, shot.times, shot.frames, shot.exact)
    snapshots.savefig(folder / "fd_abc_snapshots.png")
    for number, case in enumerate(cases):
        name = "reflection" if number == 0 else "reflection_damped"
        _reflection(case).savefig(folder / f"fd_abc_{name}.png")
    if fronts.candidates:
        refined = [pareto.Point.of(design) for design in (fronts.chosen, *fronts.margins)]
        points = [*fronts.candidates, *refined]
        figures.fronts_figure(points, fronts.designs, fronts.chosen).savefig(folder / "fd_abc_fronts.png")
    pareto.write_front(folder / "fd_abc_beam_front.json", fronts.designs, fronts.chosen)
    for number, case in enumerate(cases):
        name = "beam_without_damping" if number == 0 else "beam"
        radii = {"small": case.radii.small, "whole": case.radii.whole}
        worst = float(case.reflected.waves.max())
        case.design.write(folder / f"fd_abc_{name}.json", worst_in_band=worst, radii=radii)
    _angle(result, box).savefig(folder / "fd_abc_angle.png", dpi=130)
    figures_2d.square_figure(result).savefig(folder / "fd_abc_square.png", dpi=130)
    if result.size_fronts:
        figures_2d.front_figure(result).savefig(folder / "fd_abc_fronts_2d.png", dpi=130)
    for path in incidence.write(result, folder):
        path.replace(path.with_name(f"fd_abc_{path.name}"))


def _reflection(case: beams.Case) -> matplotlib.figure.Figure:
    ends = {
        "absorbing": case.design.boundary,
        "$w_t = c\\,w_x$": beams.one_way(case.stencil),
        "clamped": absorbing.clamped(case.stencil, "left"),
    }
    measured = {
        "absorbing, pulse in time": (case.reflected.f_pulse, case.reflected.pulse),
        "absorbing, packets in time": (case.reflected.f_packets, case.reflected.packets),
    }
    f = np.geomspace(0.2 * beams.LOW, 0.499 / beams.DT, 600)
    figure = figures.reflection_figure(case.stencil, ends, f, measured, (beams.LOW, beams.HIGH))
    figure.axes[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    figure.axes[0].set_title(case.name)
    return figure


def _angle(result: incidence.Incidence, box: NDArray[np.float64]) -> matplotlib.figure.Figure:
    figure = figures_2d.angle_figure(result)
    axes = figure.axes[0]
    (line,) = axes.semilogy(result.degrees, box, ":", color="0.35")
    handles, labels = axes.get_legend_handles_labels()
    after = 1 + labels.index("Engquist-Majda 2 centred")
    handles.insert(after, line)
    labels.insert(after, "Engquist-Majda 2 in a box scheme")
    axes.legend(handles, labels)
    return figure
