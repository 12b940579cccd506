"""Figures of a ride against time and frequency, in the manner of thesis Fig. 3.15."""

from __future__ import annotations

import gc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from energy_monitor.bag import Table
from energy_monitor.report import wires
from energy_monitor.report.outline import highest, line, lowest, pieces
from energy_monitor.report.results import Floats, Report, Series
from energy_monitor.report.style import (
    CONTROLLER,
    FAINT,
    INK,
    MONITOR,
    MUTED,
    RIG,
    WIRE,
    extent,
    figure,
    legend_above,
    plain_logarithmic,
    room,
    save,
)

ZOOM = 2.5
"""Length of the zoomed windows, s, as in Fig. 3.15."""

NODES = {"test_rig_sim": RIG, "impedance_mpc": CONTROLLER, "catenary_model": WIRE, "energy_monitor": MONITOR}
KEEPERS = {"energy_monitor": ("monitor", MONITOR), "impedance_mpc": ("controller", CONTROLLER)}


def draw_all(report: Report, folder: Path) -> dict[str, Path]:
    """Draw every figure that the bag has data for into `folder`; give the files by name."""
    folder.mkdir(parents=True, exist_ok=True)
    drawings: dict[str, Callable[[Report], Any]] = {
        "displacement": displacement,
        "contact_force": contact_force,
        "spectrum": spectrum,
        "conservation": conservation,
        "correction": correction,
        "wires": wires.wires,
        "timing": timing,
        "ride": overview,
    }
    files = {}
    for name, draw in drawings.items():
        drawing = draw(report)
        if drawing is not None:
            files[name] = save(drawing, folder / f"{name}.png")
            del drawing
            if pieces(len(report.series.time)) > 1:
                gc.collect()  # what hangs together in a circle in a figure holds the data of a long ride
    return files


def zoom(series: Series) -> tuple[float, float]:
    """Choose the window of the close-up: the middle of what is evaluated, s."""
    time = series.time[series.evaluated]
    middle = 0.5 * (time[0] + time[-1])
    return max(float(time[0]), middle - 0.5 * ZOOM), min(float(time[-1]), middle + 0.5 * ZOOM)


def displacement(report: Report) -> Any:
    """Contact point of wire and rig, and their difference; whole ride and close-up."""
    series = report.series
    error = (series.w_tr - series.w_cat) * 1e3
    window = zoom(series)
    with figure(4.6) as drawing:
        axes = drawing.subplots(2, 2, sharex="col", height_ratios=[1.5, 1.0], width_ratios=[1.0, 1.0])
        for column, (begin, end) in enumerate(((series.time[0], series.time[-1]), window)):
            upper, lower = axes[:, column]
            shown = (series.time >= begin) & (series.time <= end)
            _displacement(upper, series, shown)
            line(lower, series.time[shown], error[shown], color=INK, linewidth=0.8)
            extent(lower, begin, end)
            lower.set_xlabel("time in s")
        axes[0, 0].set_title("Contact point, whole ride")
        axes[0, 1].set_title("Close-up")
        legend_above(axes[0, 1])
        axes[0, 0].set_ylabel("displacement in mm")
        axes[1, 0].set_ylabel(r"$w_\mathrm{tr} - w_\mathrm{cat}$ in mm")
        for row in axes[:, 0]:
            _run_in(row, series)
            row.axvspan(*window, color=FAINT, alpha=0.25, linewidth=0)
        limit = next((v.high for v in report.verdicts if v.key == "position"), None)
        axes[1, 1].set_title(_rms_title(report, limit), fontweight="normal", fontsize=8.5)
        room(axes[1, 0], error, least=0.2)
        room(axes[1, 1], error[(series.time >= window[0]) & (series.time <= window[1])], least=0.2)
        drawing.align_ylabels(axes[:, 0])
        return drawing


def contact_force(report: Report) -> Any:
    """Contact force: measured, low-passed at 20 Hz, mean, and the range of the standard for the mean."""
    with figure(3.4) as drawing:
        axes = drawing.subplots()
        _force(axes, report, slice(None))
        axes.set_xlabel("time in s")
        axes.set_title("Contact force")
        legend_above(axes, 5)
        _run_in(axes, report.series)
        return drawing


def spectrum(report: Report) -> Any:
    """Power spectral density of the contact force with the passing frequencies of spans and droppers."""
    series = report.series
    if len(series.frequency) == 0:
        return None
    with figure(3.4) as drawing:
        axes = drawing.subplots()
        shown = series.frequency <= 200.0
        frequency, density = series.frequency[shown], np.maximum(series.density[shown], 1e-12)
        axes.loglog(frequency, density, color=WIRE, linewidth=1.0)
        top = float(density.max())
        marks = [(20.0, "20 Hz low-pass", MUTED)]
        marks += [(f, f"{name} {f:.3g} Hz", INK) for name, f in wires.passing(report).items()]
        # What lies outside is left out: its text would still take room of the axes.
        marks = [mark for mark in marks if frequency[0] <= mark[0] <= frequency[-1]]
        for row, (at, text, colour) in enumerate(marks):
            axes.axvline(at, color=colour, linewidth=0.8, linestyle="--" if colour == MUTED else ":")
            axes.text(
                at, 0.99 - 0.065 * row, f" {text}", color=colour, fontsize=8, va="top",
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip
        axes.set_ylim(max(float(density.min()) * 0.5, top * 1e-9), top * 30.0)
        extent(axes, frequency[0], frequency[-1])
        plain_logarithmic(axes.xaxis)
        axes.set_xlabel("frequency in Hz")
        axes.set_ylabel("density in N²/Hz")
        axes.set_title("Power spectral density of the measured contact force")
        return drawing


def conservation(report: Report) -> Any:
    """Errors of energy and momentum by both books: recomputed, and as monitor and controller saw them."""
    series = report.series
    with figure(4.4) as drawing:
        upper, lower = drawing.subplots(2, 1, sharex=True)
        limit = next((v.high for v in report.verdicts if v.key == "energy"), None)
        if limit is not None:
            size = pieces(len(series.time))
            time, band = series.time[::size], limit / 100.0 * series.exchanged_energy[::size]
            upper.fill_between(
                time, -band, band, color=FAINT, alpha=0.3, linewidth=0, label=f"±{limit:g} % of exchanged"
            )
        for axes, sums, accumulated in ((upper, "delta_e", "delta_work"), (lower, "delta_p", "delta_impulse")):
            broad = {"linewidth": 4.0}
            line(axes, series.time, getattr(series, accumulated), color=RIG, alpha=0.4, label="accumulated", **broad)
            line(axes, series.time, getattr(series, sums), color=FAINT, label="sums", **broad)
            for node, table in series.books.items():
                label, colour = KEEPERS[node]
                style = "-" if node == "energy_monitor" else (0, (4, 3))
                time = table.real("cycle") * report.ride.ts
                for number, values in enumerate((_kept(table, sums), _kept(table, accumulated))):
                    own = label if number == 0 else None
                    line(axes, time, values, color=colour, linewidth=1.2, linestyle=style, label=own)
            _run_in(axes, series)
        least = limit / 100.0 * float(series.exchanged_energy[-1]) if limit is not None else 0.0
        room(upper, np.concatenate([series.delta_e, series.delta_work, [-least, least]]))
        upper.set_title("Energy error, eq. (3.46)")
        lower.set_title("Momentum error, eq. (3.47)")
        upper.set_ylabel("dE in J")
        lower.set_ylabel("dp in N s")
        lower.set_xlabel("time in s")
        legend_above(upper, 5)
        drawing.align_ylabels([upper, lower])
        return drawing


def _kept(table: Table, name: str) -> Floats:
    """Give a column of a node's own books; the message leaves the difference of the impulses to its reader."""
    if name == "delta_impulse":
        return table.real("impulse_tr") - table.real("impulse_cat")
    return table.real(name)


def correction(report: Report) -> Any:
    """Correction force between its bounds; whole ride and close-up."""
    series = report.series
    with figure(2.9) as drawing:
        both = drawing.subplots(1, 2, sharey=True)
        window = zoom(series)
        for axes, (begin, end) in zip(both, ((series.time[0], series.time[-1]), window), strict=True):
            shown = (series.time >= begin) & (series.time <= end)
            times, low, high = series.time[shown], series.f_cor_lower[shown], series.f_cor_upper[shown]
            size = pieces(len(times))
            least, most = lowest(low, size), highest(high, size)
            axes.fill_between(
                times[::size], least, most, color=FAINT, alpha=0.55, linewidth=0, step="post", label="allowed"
            )
            force = series.f_cor[shown]
            line(axes, times, force, color=INK, linewidth=0.8, drawstyle="steps-post", label="$F_\\mathrm{cor}$")
            extent(axes, begin, end)
            axes.set_xlabel("time in s")
        both[0].axvspan(*window, color=FAINT, alpha=0.2, linewidth=0)
        both[0].set_ylabel("force in N")
        both[0].set_title("Correction force and its bounds, eq. (3.49)")
        both[1].set_title("Close-up")
        legend_above(both[1])
        return drawing


def timing(report: Report) -> Any:
    """Histogram of each node's turnaround against the cycle time."""
    measured = report.series.turnaround
    if not measured:
        return None
    with figure(2.9) as drawing:
        axes = drawing.subplots()
        everything = np.concatenate(list(measured.values())) * 1e3
        low = max(float(np.percentile(everything, 0.1)) * 0.7, 1e-3)
        high = max(float(everything.max()) * 1.2, report.ride.ts * 1.5e3)
        bins = np.geomspace(low, high, 90)
        for node, values in measured.items():
            axes.hist(
                np.clip(values * 1e3, low, high),
                bins=bins,
                histtype="step",
                linewidth=1.3,
                color=NODES.get(node, INK),
                label=node,
            )
        axes.axvline(report.ride.ts * 1e3, color=INK, linewidth=0.9, linestyle="--")
        axes.text(
            report.ride.ts * 1e3, 0.97, "cycle time ", fontsize=8, rotation=90, ha="right", va="top",
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
        axes.set_xscale("log")
        axes.set_yscale("log")
        plain_logarithmic(axes.xaxis)
        axes.set_xlim(low, high)
        axes.set_ylim(bottom=0.7)
        axes.set_xlabel("turnaround in ms")
        axes.set_ylabel("cycles")
        axes.set_title("Turnaround")
        legend_above(axes)
        return drawing


def overview(report: Report) -> Any:
    """One picture of the ride: the wires, the contact point, the force."""
    series = report.series
    window = zoom(series)
    shown = (series.time >= window[0]) & (series.time <= window[1])
    with figure(6.0) as drawing:
        rows = drawing.subplots(3, 1, height_ratios=[1.15, 1.0, 1.0])
        middle = 0.5 * (window[0] + window[1])
        if not wires.snapshot(drawing, rows[0], report, middle):
            rows[0].set_axis_off()
        _displacement(rows[1], series, shown)
        rows[1].set_title(f"Contact point at {report.ride.speed * 3.6:.0f} km/h")
        rows[1].set_ylabel("displacement in mm")
        legend_above(rows[1])
        _force(rows[2], report, shown)
        rows[2].set_title("Contact force")
        rows[2].set_xlabel("time in s")
        legend_above(rows[2], 5)
        for axes in rows[1:]:
            extent(axes, *window)
        rows[1].tick_params(labelbottom=False)
        drawing.align_ylabels(rows)
        return drawing


def _displacement(axes: Any, series: Series, shown: Any) -> None:
    time, wire, rig = series.time[shown], series.w_cat[shown] * 1e3, series.w_tr[shown] * 1e3
    line(axes, time, wire, color=WIRE, linewidth=3.2, alpha=0.45, label="contact wire")
    line(axes, time, rig, color=RIG, linewidth=1.1, label="rig")
    room(axes, np.concatenate([wire, rig]), least=2.0)


def _force(axes: Any, report: Report, shown: Any) -> None:
    series, force = report.series, report.contact_force
    time = series.time[shown]
    line(axes, time, series.f_raw[shown], color=FAINT, linewidth=0.7, label="measured")
    line(axes, time, series.f_filtered[shown], color=WIRE, linewidth=1.2, label="below 20 Hz")
    axes.axhline(force.mean, color=INK, linewidth=0.9, label=f"mean {force.mean:.1f} N")
    for value, label in ((force.statistical_minimum, "mean ± 3σ"), (force.statistical_maximum, None)):
        axes.axhline(value, color=MUTED, linewidth=0.9, linestyle=":", label=label)
    rule = next(
        (v for v in report.verdicts if v.key.endswith("_mean") and v.low is not None and v.high is not None), None
    )
    if rule is not None:
        axes.axhspan(rule.low, rule.high, color=MONITOR, alpha=0.12, linewidth=0, label="standard, mean")
    axes.set_ylabel("force in N")
    values: Floats = np.concatenate(
        [series.f_filtered[shown], series.f_raw[shown], [force.statistical_minimum, force.statistical_maximum]]
    )
    room(axes, values, share=0.05)


def _run_in(axes: Any, series: Series) -> None:
    """Shade what is not evaluated."""
    begin, end = float(series.time[0]), float(series.time[series.evaluated][0])
    if end > begin:
        axes.axvspan(begin, end, color="#EFEFEF", linewidth=0, zorder=0)


def _rms_title(report: Report, limit: float | None) -> str:
    text = f"rms {report.tracking.position_error_rms * 1e3:.3g} mm"
    return text if limit is None else f"{text} (limit {limit:g} mm)"
