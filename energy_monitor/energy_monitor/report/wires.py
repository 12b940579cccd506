"""Figures of the wires' shape: a snapshot with all that hangs on them, and the contact wire over space and time."""

from __future__ import annotations

from typing import Any

import numpy as np

from energy_monitor.bag import Table
from energy_monitor.report.outline import pieces
from energy_monitor.report.results import Floats, Report
from energy_monitor.report.style import INK, MUTED, RIG, WIRE, figure

MAP = "viridis"
SHAPES = 2000
"""Shapes that are coloured at most: more than the picture has rows."""
STEP = 20.0
"""Dropper forces of one colour, N."""


def wires(report: Report) -> Any:
    """Snapshot of both wires, and the contact wire's displacement around the pantograph over the ride."""
    table = report.series.shapes
    if table is None or len(table) == 0:
        return None
    with figure(5.4) as drawing:
        upper, lower = drawing.subplots(2, 1, height_ratios=[1.0, 1.25])
        time = report.series.time[report.series.evaluated]
        snapshot(drawing, upper, report, 0.5 * float(time[0] + time[-1]))
        _space_time(drawing, lower, report, table)
        return drawing


def passing(report: Report) -> dict[str, float]:
    """Give the frequencies in Hz at which spans and droppers pass, from their places in the bag and the speed."""
    table = report.series.shapes
    found: dict[str, float] = {}
    if table is None or len(table) == 0 or report.ride.speed <= 0.0:
        return found
    for name, column in (("spans", "mast_x"), ("droppers", "dropper_x")):
        gaps = [np.diff(np.sort(places)) for places in table.entries(column) if len(places) > 1]
        if gaps:
            spacing = float(np.median(np.concatenate(gaps)))
            if spacing > 0.0:
                found[name] = report.ride.speed / spacing
    return found


def snapshot(drawing: Any, axes: Any, report: Report, time: float) -> bool:
    """Draw the wires at the recorded instant nearest to `time` (s); False if the bag has no shape."""
    table = report.series.shapes
    if table is None or len(table) == 0:
        return False
    at = table.real("cycle") * report.ride.ts
    rows = np.flatnonzero([len(entry) > 0 for entry in table.entries("x")])  # of a long ride not every shape is kept
    if not len(rows):
        return False
    index = int(rows[np.abs(at[rows] - time).argmin()])
    x, contact, carrier, places, tension, masts = (
        np.asarray(table.entries(name)[index], np.float64)
        for name in ("x", "contact", "carrier", "dropper_x", "dropper_force", "mast_x")
    )
    if len(x) < 2:
        return False
    inside = (masts >= x[0]) & (masts <= x[-1])
    top = float(carrier.max()) + 0.15
    bottom = min(float(contact.min()), 0.0) - 0.65
    for place in masts[inside]:
        axes.axvline(place, color="#BDBDBD", linewidth=3.0, zorder=1)
    axes.plot(x, carrier, color=INK, linewidth=1.4, zorder=3)
    axes.plot(x, contact, color=WIRE, linewidth=1.8, zorder=3)
    _droppers(drawing, axes, places, tension, np.interp(places, x, contact), np.interp(places, x, carrier))
    _pantograph(axes, float(np.interp(0.0, x, contact)), bottom, float(x[-1] - x[0]))
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(bottom, top)
    axes.set_ylabel("height in m")
    axes.set_xlabel("place relative to the pantograph in m, ahead is positive")
    uplift = float(np.interp(0.0, x, contact)) * 1e3
    axes.set_title(f"Wires at {at[index]:.2f} s: contact wire {uplift:.0f} mm above nominal height at the pantograph")
    axes.grid(False)
    return True


def _droppers(drawing: Any, axes: Any, places: Floats, tension: Floats, feet: Floats, heads: Floats) -> None:
    import matplotlib
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    if len(places) == 0:
        return
    taut = tension > 0.0
    steps = max(int(np.ceil(tension.max() / STEP)), 2)
    norm = Normalize(0.0, STEP * steps)
    colours = matplotlib.colormaps[MAP].resampled(steps)
    for place, foot, head, force, tight in zip(places, feet, heads, tension, taut, strict=True):
        if tight:
            axes.plot([place, place], [foot, head], color=colours(norm(force)), linewidth=1.5, zorder=2)
        else:
            axes.plot([place, place], [foot, head], color=MUTED, linewidth=0.9, linestyle=(0, (3, 2)), zorder=2)
    if (~taut).any():
        middle = 0.5 * (feet + heads)
        axes.plot(
            places[~taut], middle[~taut], "o", markersize=5, markerfacecolor="white", markeredgecolor=INK,
            markeredgewidth=0.9, linestyle="none", zorder=4, label="slack dropper",
        )  # fmt: skip
        axes.legend(loc="lower right")
    bar = drawing.colorbar(ScalarMappable(norm, colours), ax=axes, pad=0.01, aspect=14)
    bar.set_label("dropper force in N")
    bar.outline.set_visible(False)


def _pantograph(axes: Any, height: float, bottom: float, width: float) -> None:
    """Draw the head under the wire and its arms; out of scale along the line, so that it can be seen."""
    reach = 0.018 * width
    knee = bottom + 0.45 * (height - bottom)
    axes.plot([-reach, reach], [height, height], color=RIG, linewidth=3.2, solid_capstyle="round", zorder=5)
    axes.plot([0.0, reach * 1.2, 0.0], [height, knee, bottom], color=RIG, linewidth=1.6, zorder=5)
    axes.plot([0.0], [bottom + 0.01], "s", color=RIG, markersize=6, zorder=5, clip_on=False)


def _space_time(drawing: Any, axes: Any, report: Report, table: Table) -> None:
    """Colour the displacement of the contact wire over place (in the frame of the train) and time."""
    size = [len(entry) for entry in table.entries("x")]
    usual = next((n for n in reversed(size) if n), 0)
    rows = [i for i, n in enumerate(size) if n == usual and n > 1]
    rows = rows[:: pieces(len(rows), SHAPES)]
    x = np.asarray(table.entries("x")[rows[-1]], np.float64)
    contact = np.array([table.entries("contact")[i] for i in rows], np.float64) * 1e3
    time = table.real("cycle")[rows] * report.ride.ts
    low, high = np.percentile(contact, [0.5, 99.5])
    mesh = axes.pcolormesh(
        x,
        time,
        contact,
        shading="nearest",
        cmap="RdBu_r",
        rasterized=True,
        vmin=-max(-low, high, 1.0),
        vmax=max(-low, high, 1.0),
    )
    axes.axvline(0.0, color=INK, linewidth=0.6, linestyle=":")
    axes.set_xlim(x[0], x[-1])
    axes.set_xlabel("place relative to the pantograph in m")
    axes.set_ylabel("time in s")
    axes.set_title("Contact wire around the pantograph: masts and waves pass as oblique lines")
    axes.grid(False)
    bar = drawing.colorbar(mesh, ax=axes, pad=0.01, aspect=18)
    bar.set_label("displacement in mm")
    bar.outline.set_visible(False)
