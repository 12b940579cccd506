"""All rides at one speed side by side, for the terminal."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich import box
from rich.table import Table

from validate.impedance_figures import Figures, Statistics, in_units
from validate.impedance_ride import SHORT, Case

COLUMNS = {
    "position": "pos.\nmm",
    "velocity": "vel.\nmm/s",
    "lag": "lag\nms",
    "energy": "dE sum\n%",
    "true_work": "dE true\n%",
    "momentum": "dp sum\n%",
    "true_impulse": "dp true\n%",
    "mean": "mean\nN",
    "sigma": "sigma\nN",
    "most": "max\nN",
    "difference": "force\nN",
    "spectrum": "spec.\n%",
    "f_cor": "F_cor\nN",
    "program": "QP\nms",
    "iterations": "QP\nit.",
}
"""Figures of a ride that a sheet shows, and the heads of their columns."""
LEGEND = (
    "Controls: cascaded, integrated, corrected (integrated_with_correction); *: a limit of the rig tripped. Rigs: "
    "delayed is nominal with one more cycle of delay, of which the controller knows, slower is nominal with a natural "
    "frequency 30 % below its model's. "
    "Sheets: rms errors of position and velocity, lag of the rig behind the wire, largest |dE| and |dp| after the "
    "run-in over what the whole ride exchanged (printed sums; true work and impulse), force below 20 Hz, its rms "
    "difference from the direct coupling in time and over the bands of the spectrum, F_cor rms, median time of the "
    "quadratic program."
)


def sheet(speed: int, without: Mapping[tuple[int, str], Statistics], every: Sequence[tuple[Case, Figures]]) -> Table:
    """Make the sheet of a speed (km/h): each pantograph's direct coupling above its rides."""
    made = Table(title=f"{speed} km/h", title_justify="left", box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    made.add_column("rig", no_wrap=True)
    made.add_column("control", no_wrap=True)
    for head in COLUMNS.values():
        made.add_column(head, justify="right", no_wrap=True)
    for place, found in without.items():
        if place[0] != speed:
            continue
        values = in_units(found)
        made.add_row(place[1], "no rig", *(_text(values[name]) if name in values else "" for name in COLUMNS))
        before = ""
        for case, figures in every:
            if case.at != place:
                continue
            rig = case.variant or case.rig
            tripped = "" if math.isnan(figures.tripped) else " *"
            made.add_row("" if rig == before else rig, SHORT[case.control] + tripped, *_cells(figures))
            before = rig
        made.add_section()
    return made


def _cells(figures: Figures) -> list[str]:
    if not math.isnan(figures.left):
        return ["lost at", f"{figures.left:.2g} s", *[""] * (len(COLUMNS) - 2)]
    values = in_units(figures)
    return [_text(values[name]) for name in COLUMNS]


def _text(value: float) -> str:
    if math.isnan(value):
        return "-"
    if value == 0.0:
        return "0"
    if abs(value) >= 10.0:
        return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"
    text = f"{value:.2g}" if abs(value) >= 0.1 else f"{value:.3f}"
    return "<.001" if text in ("0.000", "-0.000") else text
