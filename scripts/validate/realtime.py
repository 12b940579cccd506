"""The real-time model against the catenary-fixed reference: same line, same pantograph, same soft start.

against the reference   `Config`'s defaults, finite elements (fe) and finite differences (fd), with 2 and 4 spans
                        against Table 3.1's reference resolution (0.25 m and 0.2 ms), 6 s after the transients, at the
                        same track positions. The reference's ends are so far away that nothing comes back from them
                        within the ride (`needed_spans`)
truncation              against the same model with 20 spans, same mesh and step, 30 s: what the short domain costs
discretisation          those 20 spans against the reference: what mesh and time step cost

Line: Table 3.1 with its damping on both sides. The uplift is set so that the mean contact force is the upper limit that
EN 50367 has for AC lines at that speed. Force below 20 Hz without phase (`en50318.zero_phase`, at each model's own
rate); the rides end `TAIL` s later than what is evaluated, so that the filter sees no end. Error: rms of the difference
over the standard deviation of what it is compared with.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from catenary_model import reference
from catenary_model.build import Config, build
from catenary_model.config import DISCRETISATIONS
from catenary_model.line import Line
from catenary_model.line_file import load_line
from catenary_model.pantograph import Pantograph
from catenary_model.ride import PIECE, ride
from energy_monitor.contact_quality import CUTOFF
from phil_study.outcome import Outcome, Row
from test_rig_sim.pantographs import PANTOGRAPHS
from validate.en50318 import CONTACT_STIFFNESS
from validate.mean_force import target
from validate.realtime_sheet import SideBySide
from validate.realtime_signals import Agreement, Signals, agreement

__all__ = ["Agreement", "Signals", "agreement", "run", "target"]

Array = NDArray[np.float64]
Say = Callable[[str], None]
Measured = dict[str, tuple[float, str, str]]
"""Value, unit and note by name."""

SPEEDS = (200, 250, 320)
"""km/h."""
SPANS = (2, 4)
KINDS = tuple(DISCRETISATIONS)
RIDERS = ("en50318", "three_mass")
"""Of the rig's pantographs, those that are chains of masses."""
FD_LAYERS: dict[str, object] = {"layer_behind": 105.0, "layer_ahead": 225.0}
"""Layers of the finite differences: they do not damp what comes back from afar as the elements do, and have the time
for a longer domain."""
LONG = 20
"""Spans against which the truncation is measured."""
START = 30.0
"""Track position at the start, m: middle of span 0."""
SOFT, SETTLED, TAIL = 2.0, 5.0, 0.3
"""Within s the uplift comes up, from s on the ride is evaluated, and it goes on for s longer."""
WINDOW, LONG_WINDOW = 6.0, 30.0
"""Time that is compared with the reference, and with 20 spans, s."""

GOALS: dict[tuple[int, int], dict[str, tuple[float | None, float | None]]] = {
    (250, 2): {
        "correlation of force": (0.99, None),
        "error of force": (None, 0.12),
        "truncation": (None, 0.07),
        "correlation of displacement": (0.9995, None),
        "displacement, rms of difference": (None, 0.3),
    },
    (250, 4): {
        "correlation of force": (0.995, None),
        "error of force": (None, 0.08),
        "truncation": (None, 0.04),
        "correlation of displacement": (0.9995, None),
        "displacement, rms of difference": (None, 0.3),
    },
    (320, 4): {"error of force": (None, 0.15)},
}
"""Bounds by speed (km/h) and spans; what is not there is information."""
FD_GOALS: dict[tuple[int, int], dict[str, tuple[float | None, float | None]]] = {
    (250, 2): {"error of force": (None, 0.04)},
    (250, 4): {"error of force": (None, 0.03)},
    (320, 2): {"error of force": (None, 0.05)},
    (320, 4): {"error of force": (None, 0.05)},
}
"""What is narrower for the finite differences."""


@cache
def line() -> Line:
    """Return Table 3.1's line."""
    return load_line("en50318_2002")


def pantograph(kind: str, uplift: float) -> Pantograph:
    """Return one of the rig's pantographs with this force (N) on its frame."""
    chain = PANTOGRAPHS[kind]()
    return Pantograph.of(chain.mass, chain.damping, chain.stiffness, uplift, CONTACT_STIFFNESS)


def config(speed: int, spans: int, **changes: object) -> Config:
    """Return the real-time model's settings: the defaults but for speed (km/h), spans, `FD_LAYERS`, and `changes`."""
    base = Config(line=line(), speed=speed / 3.6, start_position=START, spans=spans)
    if changes.get("discretisation") == "fd":
        changes = FD_LAYERS | changes
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


def moving(
    setting: Config, rider: Pantograph, window: float, told: Say = lambda _: None, took: list[float] | None = None
) -> Signals:
    """Ride with the real-time model until `window` s can be evaluated. Raises RuntimeError for unsettled steps.

    `took` is given the times (s) at which the pieces of the ride were done.
    """
    catenary = build(setting)

    def progress(share: float) -> None:
        if took is not None:
            took.append(perf_counter())
        told(f"{setting.speed * 3.6:.0f} km/h, {setting.discretisation}, {setting.spans} spans: {100.0 * share:.0f} %")

    record = ride(
        catenary,
        rider,
        SETTLED + window + TAIL,
        SOFT,
        progress,
    )
    if catenary.unsettled_steps:
        raise RuntimeError(f"{catenary.unsettled_steps} steps of the moving model have no consistent slack state")
    return Signals(record.t, record.w, record.F)


def needed_spans(speed: float, duration: float) -> tuple[int, int]:
    """Return the spans that the reference needs behind and ahead of the start for an unbounded line.

    A wave that leaves the contact point at t = 0 is back from an end at distance d after 2 d/(c - v) from behind and
    2 d/(c + v) from ahead (at v, m/s); later ones are back later. One span is added on either side.
    """
    c = max(line().contact.wave_speed, line().carrier.wave_speed)
    length = line().period / len(line().spans)
    behind = math.ceil((0.5 * (c - speed) * duration - START) / length)
    ahead = math.ceil((0.5 * (c + speed) * duration + START) / length)
    return max(behind, 0) + 1, ahead + 1


def fixed(
    speed: int,
    rider: Pantograph,
    window: float,
    element_length: float = 0.25,
    time_step: float = 2e-4,
    told: Say = lambda _: None,
) -> Signals:
    """Ride with the catenary-fixed reference at `speed` km/h. Raises RuntimeError for unsettled steps."""
    duration, v = SETTLED + window + TAIL, speed / 3.6
    behind, ahead = needed_spans(v, duration)
    model = reference.Reference(
        reference.Config(
            line=line(),
            speed=v,
            spans=behind + ahead,
            first_span=-behind,
            start_position=START,
            element_length=element_length,
            time_step=time_step,
        )
    )
    record = model.ride(
        rider, duration, SOFT, progress=lambda share: told(f"{speed} km/h, reference: {100.0 * share:.0f} %")
    )
    if model.unsettled_steps:
        raise RuntimeError(f"{model.unsettled_steps} steps of the reference have no consistent slack state")
    return Signals(record.t, record.w, record.F)


def uplift_for(speed: int, kind: str, window: float) -> float:
    """Find the force on the frame (N) with which the mean contact force is `target`; the frame's spring takes a part.

    On average F = f_up - k y_frame, and y_frame rises by the wire's compliance a newton: two corrections do.
    """
    wanted = target(speed)
    uplift = wanted
    for _ in range(3):
        found = evaluated(moving(config(speed, 4), pantograph(kind, uplift), window), window)
        uplift += (wanted - float(found.F.mean())) * uplift / max(float(found.F.mean()), 1.0)
    return uplift


def evaluated(signals: Signals, window: float, ts: float = 2e-3) -> Signals:
    """Return the evaluated part of a ride below 20 Hz, every ts (s)."""
    times: Array = SETTLED + ts * np.arange(1, round(window / ts) + 1, dtype=np.float64)
    return signals.filtered().at(times)


def rows(speed: int, kind: str, spans: int, measured: Measured, discretisation: str = "fe") -> list[Row]:
    """Make the rows of one model with the goals that it has; `measured` is name: value, unit, note."""
    case, goals = f"{speed} km/h, {kind}, {spans} spans", GOALS.get((speed, spans), {})
    if discretisation != "fe":
        case, goals = f"{case}, {discretisation}", goals | FD_GOALS.get((speed, spans), {})
    return [
        Row(name, case, value, unit, *goals.get(name, (None, None)), note)
        for name, (value, unit, note) in measured.items()
    ]


@dataclass(frozen=True)
class Truth:
    """What one speed and pantograph is held against."""

    rider: Pantograph
    window: float
    long_window: float
    raw: Signals
    """The reference at the cycles of the evaluated part."""
    filtered: Signals
    """The same below 20 Hz."""
    long: dict[str, Signals]
    """The moving models with 20 spans below 20 Hz, the long part, by discretisation."""


def _cycles(signals: Signals, window: float) -> Signals:
    return signals.at(evaluated(signals, window).t)


def truth_for(speed: int, kind: str, window: float, long_window: float, say: Say) -> tuple[float, Truth]:
    """Ride with the reference and with 20 spans; return the uplift (N) as well."""
    say(f"{speed} km/h, {kind}: uplift")
    uplift = uplift_for(speed, kind, window)
    rider = pantograph(kind, uplift)
    record = fixed(speed, rider, window, told=say)
    long = {
        one: evaluated(moving(config(speed, LONG, discretisation=one), rider, long_window, say), long_window)
        for one in KINDS
    }
    return uplift, Truth(rider, window, long_window, _cycles(record, window), evaluated(record, window), long)


def against(truth: Truth, setting: Config, say: Say) -> tuple[Signals, Measured]:
    """Ride with a real-time model; return its evaluated part and what it differs in."""
    took: list[float] = []
    record = moving(setting, truth.rider, truth.long_window, say, took)
    raw, smooth = _cycles(record, truth.window), evaluated(record, truth.window)
    force, w = agreement(smooth.F, truth.filtered.F), agreement(raw.w, truth.raw.w)
    below = agreement(smooth.w, truth.filtered.w)
    cut = agreement(evaluated(record, truth.long_window).F, truth.long[setting.discretisation].F)
    mean, sigma = float(truth.filtered.F.mean()), float(truth.filtered.F.std())
    return raw, {
        "correlation of force": (force.correlation, "", ""),
        "error of force": (force.error, "", ""),
        "truncation": (cut.error, "", f"force, against {LONG} spans over {truth.long_window:g} s"),
        "correlation of displacement": (w.correlation, "", f"below {CUTOFF:g} Hz: {below.correlation:.5f}"),
        "displacement, rms of difference": (1e3 * w.rms, "mm", f"below {CUTOFF:g} Hz: {1e3 * below.rms:.3f} mm"),
        "error of displacement": (w.error, "", f"mean difference {1e3 * w.offset:+.3f} mm"),
        "mean force": (float(smooth.F.mean()), "N", f"reference {mean:.2f} N"),
        "sigma of force": (float(smooth.F.std()), "N", f"reference {sigma:.2f} N"),
        "time of a cycle": (1e6 * _per_cycle(took), "us", "median, with the pantograph, in compiled code"),
    }


def _per_cycle(took: list[float]) -> float:
    """Median time of a cycle (s) from the instants at which pieces of `ride.PIECE` cycles were done."""
    return float(np.median(np.diff(took[:-1]))) / PIECE


def _information(speed: int, kind: str, truth: Truth, say: Say) -> list[Row]:
    """Say what the short layers, the mesh and the time step cost, and what other filters and clocks would say."""
    default = config(speed, 4)
    half = default.element_length / 2.0
    others: dict[str, tuple[int, dict[str, object]]] = {
        f"{LONG} spans: mesh and step alone": (LONG, {}),
        f"{LONG} spans, twice the substeps": (LONG, {"substeps": 2 * default.substeps}),
        f"{LONG} spans, elements of half the length and twice the substeps": (
            LONG,
            {"element_length": half, "substeps": 2 * default.substeps},
        ),
    }
    alike = {"layer_behind": default.layer_behind, "layer_ahead": default.layer_ahead, "discretisation": "fd"}
    for spans in SPANS:
        others[f"{spans} spans, fd, layers as fe"] = spans, alike
        length = default.boundary_nodes * default.element_length
        short: dict[str, object] = {
            "layer_behind": length,
            "layer_ahead": length,
            "fading_length": min(length, default.fading_length),
        }
        others[f"{spans} spans, layers of {default.boundary_nodes} nodes only"] = spans, short
    made = []
    for name, (spans, changes) in others.items():
        measured = against(truth, config(speed, spans, **changes), say)[1]
        chosen = ("error of force", "truncation", "displacement, rms of difference")
        for what in chosen if spans != LONG else (chosen[0], chosen[2]):
            value, unit, note = measured[what]
            made.append(Row(what, f"{speed} km/h, {kind}, {name}", value, unit, note=note))
    return made


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Compare at all speeds with both pantographs; a quick run takes one case and shorter rides."""
    window, long_window = (1.5, 3.0) if quick else (WINDOW, LONG_WINDOW)
    made: list[Row] = []
    table = SideBySide()
    notes = [
        "Line: Table 3.1 with its damping on both sides. Uplift such that the mean force is EN 50367's upper limit for "
        f"AC lines; same start, uplift over {SOFT:g} s as (1 - cos)/2, evaluated from {SETTLED:g} s on for {window:g} "
        f"s (truncation {long_window:g} s).",
        f"Force below {CUTOFF:g} Hz without phase (Butterworth of order 3 both ways); displacement as it is.",
    ]
    for speed in SPEEDS if not quick else (250,):
        for kind in RIDERS if not quick else ("en50318",):
            uplift, truth = truth_for(speed, kind, window, long_window, say)
            notes.append(
                f"{speed} km/h, {kind}: {uplift:.2f} N on the frame for a mean of {target(speed):.1f} N; reference: "
                f"mean {truth.filtered.F.mean():.2f} N, sigma {truth.filtered.F.std():.2f} N, contact lost in "
                f"{100.0 * (truth.raw.F <= 0.0).mean():.2g} % of the cycles, "
                f"{sum(needed_spans(speed / 3.6, SETTLED + window + TAIL))} spans: nothing comes back from its ends."
            )
            shown = {}
            for spans, one in product(SPANS, KINDS):
                raw, measured = against(truth, config(speed, spans, discretisation=one), say)
                made += rows(speed, kind, spans, measured, one)
                table.add(f"{speed} km/h, {kind}, {spans} spans", one, measured)
                shown[f"{spans} spans" + ("" if one == "fe" else f", {one}")] = raw
            if out is not None:
                from validate.realtime_picture import draw

                draw(f"{speed} km/h, {kind}", truth.raw, shown, out / f"validate-realtime-{speed}-{kind}.png")
            if kind == "three_mass" and speed != SPEEDS[0]:
                made += _information(speed, kind, truth, say)
            if kind == "three_mass" and speed == 250:
                made += _own_error(speed, truth, say)
    notes += [
        f"fd has layers of {FD_LAYERS['layer_behind']:g} and {FD_LAYERS['layer_ahead']:g} m: on those of fe its "
        "truncation is larger than the bound that fe keeps (rows 'layers as fe').",
        f"What limits the error of fe: mesh and time step; {LONG} spans have nearly the error of four. On one mesh a "
        "shorter step is not always the better one: the elements' waves run too fast, Newmark's too slow, and in part "
        "these two make up for each other (320 km/h, twice the substeps). Both refined together, the error falls.",
    ]
    return Outcome("Real-time model against the catenary-fixed reference", made, notes, overviews=[table.sheet()])


def _own_error(speed: int, truth: Truth, say: Say) -> list[Row]:
    """Say what the reference itself is off, against half its step and half its mesh."""
    made = []
    for name, h, ts in (("0.1 ms", 0.25, 1e-4), ("0.125 m, 0.1 ms", 0.125, 1e-4)):
        finer = fixed(speed, truth.rider, truth.window, h, ts, say)
        force = agreement(truth.filtered.F, evaluated(finer, truth.window).F)
        w = agreement(truth.raw.w, _cycles(finer, truth.window).w)
        case = f"{speed} km/h, the reference itself"
        made.append(Row("error of force", case, force.error, "", note=f"against {name}"))
        made.append(Row("displacement, rms of difference", case, 1e3 * w.rms, "mm", note=f"against {name}"))
    return made
