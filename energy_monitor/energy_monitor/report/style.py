"""One look for all figures of a report: colours, type, saving."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from energy_monitor.report.results import Floats

# Okabe and Ito's colours: told apart by colour-blind readers and in greyscale print.
WIRE = "#0072B2"
RIG = "#D55E00"
MONITOR = "#009E73"
CONTROLLER = "#B4508C"
INK = "#222222"
MUTED = "#8A8A8A"
FAINT = "#B9CBD9"

DPI = 144
LARGE = 180_000
"""Bytes; the pictures are embedded in the page, which has to stay small enough for mail."""
WIDTH = 9.6
"""Inches; the text width of the page at which the type sizes below are meant to be read."""

RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "lines.linewidth": 1.2,
    "legend.fontsize": 8.5,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "legend.borderpad": 0.2,
    "mathtext.fontset": "dejavusans",
    "figure.constrained_layout.use": True,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


@contextmanager
def figure(height: float) -> Iterator[Any]:
    """Give an empty figure of the common width in the common style; no global state of matplotlib is touched."""
    with matplotlib.rc_context(RC):
        yield Figure(figsize=(WIDTH, height), dpi=DPI)


def save(drawing: Any, path: Path) -> Path:
    """Write a figure as PNG; one that comes out large gets a palette of 256 colours, a third of the size."""
    buffer = io.BytesIO()
    with matplotlib.rc_context(RC):
        drawing.savefig(buffer, format="png", dpi=DPI, facecolor="white")
    with Image.open(buffer) as image:
        plain = image.convert("RGB")
        plain.save(path, optimize=True)
        if path.stat().st_size > LARGE:
            plain.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
    return path


def legend_above(axes: Any, columns: int = 4) -> None:
    """Put the legend above the axes at the right, where no line runs."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        borderaxespad=0.1,
        handlelength=1.8,
        columnspacing=1.2,
    )


def plain_logarithmic(axis: Any) -> None:
    """Label a logarithmic axis 1, 2, 5, 10 in plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def extent(axes: Any, begin: float, end: float) -> None:
    """Set the horizontal range; one that holds a single instant gets a width."""
    if not end > begin:
        half = 1e-3 * max(abs(begin), 1.0)
        begin, end = begin - half, begin + half
    axes.set_xlim(begin, end)


def room(axes: Any, values: Floats, share: float = 0.08, least: float = 0.0) -> None:
    """Set the vertical range to the finite values and some room, `least` high at least."""
    finite = values[np.isfinite(values)]
    if len(finite) == 0:
        return
    low, high = float(finite.min()), float(finite.max())
    missing = max(least - (high - low), 0.0)
    smallest = max(1e-6 * max(abs(low), abs(high)), 1e-12)  # equal values still need a range
    margin = share * max(high - low, least, smallest) + 0.5 * missing
    axes.set_ylim(low - margin, high + margin)
