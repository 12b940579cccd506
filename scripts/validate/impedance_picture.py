"""Pictures of the closed loop beside the coupling without a rig."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phil_study.drawing import save, subplots
from validate.en50318 import zero_phase
from validate.impedance_figures import Figures, accounts, in_units, spectra
from validate.impedance_ride import CASCADED, CORRECTED, INTEGRATED, SHORT, Case, Direct, Record

Array = NDArray[np.float64]

SNIPPET = 1.5
"""Length of the piece that is shown, s."""
COLOURS = {CASCADED: "C1", INTEGRATED: "C0", CORRECTED: "C2"}
BARS = {
    "position": "position error, rms\nmm",
    "velocity": "velocity error, rms\nmm/s",
    "true_work": "|dE|, true work\n%",
    "energy": "|dE|, printed sum\n%",
    "sigma_change": "sigma against\nno rig, %",
    "difference": "force against\nno rig, rms, N",
}
"""Figures that are drawn over all cases."""


def snapshot(title: str, direct: Direct, rides: Mapping[Case, Record], window: slice, path: Path) -> None:
    """Draw wire and drive, their difference, and the force below 20 Hz, over the first piece of the window."""
    figure, axes = subplots(4, 1, figsize=(10, 12), sharex=True, layout="constrained")
    for case, record in rides.items():
        if record.cycles < window.stop:
            continue
        piece = slice(window.start, min(window.start + round(SNIPPET / record.ts), window.stop))
        t = record.ts * np.arange(piece.start, piece.stop)
        colour, label = COLOURS[case.control], SHORT[case.control]
        axes[0].plot(t, 1e3 * record.w_cat[piece], color=colour, lw=3.0, alpha=0.3, label=f"wire, {label}")
        axes[0].plot(t, 1e3 * record.w[piece], color=colour, lw=1.0, label=f"drive, {label}")
        axes[1].plot(t, 1e3 * (record.w - record.w_cat)[piece], color=colour, lw=1.0, label=label)
        axes[2].plot(t, 1e3 * (record.v - record.v_cat)[piece], color=colour, lw=0.8)
        axes[3].plot(t, zero_phase(record.f, record.ts)[piece], color=colour, lw=1.2, label=label)
    ts = direct.ts
    before = slice(window.start - 1, min(window.start - 1 + round(SNIPPET / ts), window.stop - 1))
    t = ts * np.arange(before.start + 1, before.stop + 1)
    axes[0].plot(t, 1e3 * direct.w[before], "--", color="0.3", lw=1.2, label="wire, no rig")
    axes[3].plot(t, zero_phase(direct.f, ts)[before], "--", color="0.3", lw=1.2, label="no rig")
    for axis, label in zip(
        axes,
        ("contact point in mm", "position error in mm", "velocity error in mm/s", "force below 20 Hz in N"),
        strict=True,
    ):
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    _tight(axes[1], [1e3 * (r.w - r.w_cat)[window] for c, r in rides.items() if _kept(c, r, window)])
    _tight(axes[2], [1e3 * (r.v - r.v_cat)[window] for c, r in rides.items() if _kept(c, r, window)])
    axes[0].set_title(title)
    axes[0].legend(fontsize=8, ncols=2)
    axes[3].legend(fontsize=8, ncols=4)
    axes[3].set_xlabel("time in s")
    save(figure, path)


def _kept(case: Case, record: Record, window: slice) -> bool:
    """Tell whether a ride sets the scale: a cascade that swings would hide what the others do."""
    return case.control != CASCADED and record.cycles >= window.stop


def _tight(axis: Any, values: Sequence[Array]) -> None:
    if values:
        top = 1.5 * max(float(np.abs(v).max()) for v in values)
        axis.set_ylim(-top, top)


def spectrum(title: str, direct: Direct, rides: Mapping[Case, Record], window: slice, path: Path) -> None:
    """Draw the force's spectrum by bands, with and without a rig, and the coherence of both."""
    figure, axes = subplots(2, 1, figsize=(10, 7), sharex=True, layout="constrained")
    drawn = False
    for case, record in rides.items():
        if record.cycles < window.stop:
            continue
        found = spectra(record.f[window], direct.f[window.start - 1 : window.stop - 1], record.ts)
        if not drawn:
            axes[0].step(found.middle, found.direct, where="mid", color="0.3", lw=3.0, alpha=0.5, label="no rig")
            drawn = True
        colour = COLOURS[case.control]
        axes[0].step(found.middle, found.ours, where="mid", color=colour, lw=1.2, label=SHORT[case.control])
        axes[1].step(found.middle, found.shared, where="mid", color=colour, lw=1.2)
    axes[0].set(yscale="log", ylabel="root of the power in a band of 1 Hz, N", title=title)
    axes[1].set(ylabel="coherence with no rig", xlabel="frequency in Hz", ylim=(0.0, 1.05))
    axes[0].legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.3)
    save(figure, path)


def books(title: str, rides: Mapping[Case, Record], limit: float, path: Path) -> None:
    """Draw the errors of energy and momentum over time by all three measures; `limit` is a share, 1."""
    shown = {case: record for case, record in rides.items() if record.left is None and case.control != CASCADED}
    if not shown:
        return
    figure, axes = subplots(2, len(shown), figsize=(5.5 * len(shown), 7), sharex=True, layout="constrained")
    axes = axes.reshape(2, len(shown))
    for column, (case, record) in enumerate(shown.items()):
        found = accounts(record)
        t = record.ts * np.arange(record.cycles)
        measures = {"printed sum": found.printed, "accumulated": found.accumulated, "true": found.true}
        for axis, name, exchanged in zip(
            axes[:, column], ("energy", "momentum"), (found.energy, found.momentum), strict=True
        ):
            axis.fill_between(t, -limit * exchanged, limit * exchanged, color="0.9", label=f"±{100 * limit:g} %")
            for label, account in measures.items():
                axis.plot(t, getattr(account, name), lw=1.0, label=label)
            axis.grid(alpha=0.3)
        axes[0, column].set_title(f"{title}, {SHORT[case.control]}", fontsize=9)
        axes[1, column].set_xlabel("time in s")
    axes[0, 0].set_ylabel("dE in J")
    axes[1, 0].set_ylabel("dp in N s")
    axes[0, 0].legend(fontsize=8)
    save(figure, path)


def bars(every: Mapping[Case, Figures], path: Path) -> None:
    """Draw the errors of all cases side by side; a ride that was lost has no bar."""
    places = list(dict.fromkeys((case.at, case.rig, case.variant) for case in every))
    figure, axes = subplots(
        len(BARS), 1, figsize=(max(8.0, 0.5 * len(places)), 2.3 * len(BARS)), sharex=True, layout="constrained"
    )
    width = 0.8 / len(COLOURS)
    for axis, (name, label) in zip(axes, BARS.items(), strict=True):
        for number, (control, colour) in enumerate(COLOURS.items()):
            chosen = [(places.index((c.at, c.rig, c.variant)), f) for c, f in every.items() if c.control == control]
            at = np.array([place for place, _ in chosen], dtype=np.float64) + width * (number - 1)
            height = [abs(in_units(found)[name]) for _, found in chosen]
            axis.bar(at, height, width, color=colour, label=SHORT[control])
        axis.set_ylabel(label, fontsize=8)
        axis.set_yscale("log")
        axis.grid(alpha=0.3, axis="y")
    axes[0].legend(fontsize=8, ncols=3)
    names = [", ".join(p for p in (f"{at[0]} {at[1]}", rig, variant) if p) for at, rig, variant in places]
    axes[-1].set_xticks(np.arange(len(places)), names, rotation=90, fontsize=7)
    save(figure, path)


def draw(
    out: Path,
    coupled: Mapping[tuple[int, str], Direct],
    figures: Mapping[Case, Figures],
    records: Mapping[Case, Record],
    windows: Mapping[tuple[int, str], slice],
) -> None:
    """Draw everything into the folder."""
    for place, direct in coupled.items():
        rides = {case: record for case, record in records.items() if case.at == place}
        if not rides:
            continue
        title, name = f"{place[0]} km/h, {place[1]}", f"validate-impedance-{place[0]}-{place[1]}"
        snapshot(title, direct, rides, windows[place], out / f"{name}-tracking.png")
        spectrum(title, direct, rides, windows[place], out / f"{name}-spectrum.png")
        books(title, rides, 1e-3, out / f"{name}-books.png")
    bars(figures, out / "validate-impedance.png")
