"""Reference models of EN 50318, spans 5 and 6 of 10: that of 2002 at 250 and 300 km/h, and one like that of 2018.

What the rides are held against is in `reference_values.yaml`, with edition, source and whether anybody has read it:
verdicts are given on ranges that were read, all else stands beside them. The rest of this text is about 2002; for 2018
see `ac_simple`.

Catenary: Table 3.1 (preset `en50318_2002`). The standard leaves two things open that the results depend on, damping
and the stiffness of the supports; they are set here once, for both speeds (`DAMPING`, `SUPPORT`). A scan over 1.0 to
1.6 N s/m^2 and 4e4 to 2e5 N/m found all 16 rows inside for over half the pairs, whichever way the 20 Hz filter is built
(stiffer supports need more damping at 250 km/h and then lose the maximum at 300); this pair lies well among them.
Nothing else is adjusted. The ten spans lie in the middle of 28, so that no reflection from an end comes back.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt, sosfilt_zi, sosfiltfilt

from catenary_model import model
from catenary_model.elements import shape_derivatives
from catenary_model.line import Line
from catenary_model.line_file import load_line
from catenary_model.moving_frame import CONTACT
from catenary_model.reference import Config, Pantograph, Reference, Ride
from catenary_model.ride import Coupled, joined
from energy_monitor.contact_quality import CUTOFF, losses_of, low_passed, statistics_of
from phil_study.outcome import Outcome, Row, Sheet
from test_rig_sim.pantographs import PANTOGRAPHS
from validate import ac_simple
from validate.reference_values import MODELS, QUANTITIES, ReferenceSet, load

Array = NDArray[np.float64]

DAMPING = 1.4
"""beta of both wires, N s/m^2."""
SUPPORT = 5e4
"""Vertical stiffness of a support of the carrier, N/m."""
STATIC_FORCE = 120.0
"""On the frame, N."""
CONTACT_STIFFNESS = 50e3
"""N/m."""
SPAN = 60.0
"""Span length of the reference model, m."""
TEN, BEFORE, ALL = 10, 9, 28
"""Spans of the standard's model, spans of the mesh before them, spans of the mesh."""
START, END = 0.5 * SPAN, 9.5 * SPAN
"""The pantograph rides from the middle of span 1 to the middle of span 10, m."""
FIRST, LAST = 4 * SPAN, 6 * SPAN
"""Spans 5 and 6, m."""
RAMP = 1.0
"""Time within which the static force comes up, s."""

LOW = 5.0
"""Frequency that parts the two bands of the force, Hz: 0 to 5 and 5 to 20 Hz."""
ORDER = 6
"""Order of the filters that part them."""

Filter = Callable[[Array, float], Array]
Say = Callable[[str], None]
TABLE_3_1, AC_SIMPLE = MODELS


@dataclass(frozen=True)
class Setting:
    """What a run differs in; the defaults are what the verdicts are given for."""

    carrier_damping: float = DAMPING
    contact_damping: float = DAMPING
    support: float = SUPPORT
    dropper: float = 1e5
    element_length: float = 0.25
    time_step: float = 2e-4
    start: float = START

    def line(self) -> Line:
        """Return the standard's line: the preset with this damping and these stiffnesses."""
        preset = load_line("en50318_2002")
        (span,) = preset.spans
        droppers = tuple(dataclasses.replace(dropper, stiffness=self.dropper) for dropper in span.droppers)
        mast = dataclasses.replace(span.mast, stiffness=self.support)
        return dataclasses.replace(
            preset,
            carrier=dataclasses.replace(preset.carrier, damping=self.carrier_damping),
            contact=dataclasses.replace(preset.contact, damping=self.contact_damping),
            spans=(dataclasses.replace(span, droppers=droppers, mast=mast),),
        )


def pantograph() -> Pantograph:
    """Return the standard's two-mass pantograph."""
    kind = PANTOGRAPHS["en50318"]()
    return Pantograph.of(kind.mass, kind.damping, kind.stiffness, STATIC_FORCE, CONTACT_STIFFNESS)


def ride(speed: float, setting: Setting, say: Say = lambda _: None) -> Ride:
    """Ride over the ten spans at `speed` km/h."""
    v = speed / 3.6
    reference = Reference(
        Config(
            line=setting.line(),
            speed=v,
            spans=ALL,
            first_span=-BEFORE,
            start_position=setting.start,
            element_length=setting.element_length,
            time_step=setting.time_step,
        )
    )
    report = lambda share: say(f"{speed:g} km/h: {share * 100.0:.0f} %")  # noqa: E731
    record = reference.ride(pantograph(), (END - setting.start) / v - setting.time_step, ramp=RAMP, progress=report)
    if reference.unsettled_steps:
        raise RuntimeError(f"{reference.unsettled_steps} steps at {speed:g} km/h have no consistent slack state")
    return record


def causal(force: Array, ts: float) -> Array:
    """Filter as the monitor does: Butterworth of order 6, causal."""
    return low_passed(force, ts, CUTOFF)


def zero_phase(force: Array, ts: float) -> Array:
    """Filter forwards and backwards with a Butterworth low-pass of order 3."""
    filtered: Array = sosfiltfilt(butter(3, CUTOFF, fs=1.0 / ts, output="sos"), force)
    return filtered


def second_order(force: Array, ts: float) -> Array:
    """Filter with a causal Butterworth low-pass of order 2."""
    return low_passed(force, ts, CUTOFF, 2)


def bands(force: Array, ts: float) -> tuple[Array, Array]:
    """Return the force (N, every ts s) from 0 to 5 and from 5 to 20 Hz.

    Butterworth filters of one order and one frequency part the power of a signal without rest (|L|^2 + |H|^2 = 1), so
    the squares of both standard deviations add up to that below 20 Hz, up to what a short record cuts off.
    """
    below = low_passed(force, ts, CUTOFF)
    high_pass = butter(ORDER, LOW, "highpass", fs=1.0 / ts, output="sos")
    upper: Array = sosfilt(high_pass, below, zi=sosfilt_zi(high_pass) * below[0])[0]
    return low_passed(below, ts, LOW, ORDER), upper


def values(record: Ride, filtered: Filter = causal, first: float = FIRST, last: float = LAST) -> dict[str, float]:
    """Return what a ride gives of `QUANTITIES`, in their units, over spans 5 and 6 and their three supports.

    Mean, sigma and extremes are those of the filtered force; loss of contact is that of the force before any filter,
    and beside it that of the filtered one, which hides what is short.
    """
    ts = float(record.t[1] - record.t[0])
    inside = record.between(first, last)
    support = (record.supports > first - 1.0) & (record.supports < last + 1.0)
    below = filtered(record.F, ts)[inside]
    found = statistics_of(below, losses_of(record.F[inside] <= 0.0))
    slow, quick = (float(band[inside].std()) for band in bands(record.F, ts))
    return {
        "mean": found.mean,
        "sigma": found.sigma,
        "sigma_0_5": slow,
        "sigma_5_20": quick,
        "statistical_maximum": found.statistical_maximum,
        "statistical_minimum": found.statistical_minimum,
        "maximum": found.maximum,
        "minimum": found.minimum,
        "uplift": 1e3 * float(record.uplift[:, support].max()),
        "height_range": 1e3 * float(np.ptp(record.w[inside])),
        "loss": 100.0 * found.loss_share,
        "loss_below_20_hz": 100.0 * float((below <= 0.0).mean()),
    }


def speeds_of(sets: Sequence[ReferenceSet], model: str) -> list[float]:
    """Return the speeds (km/h) that anything is known of for a model, rising."""
    return sorted({entry.speed_kmh for one in sets if one.model == model for entry in one.entries})


def rows(
    sets: Sequence[ReferenceSet], of: str, speed: float, measured: Mapping[str, float], name: str, judged: bool
) -> list[Row]:
    """Make the rows of one ride of the model `of`: a verdict on a range that was read; all else is told in the note."""
    made = []
    for quantity, (title, unit) in QUANTITIES.items():
        known = [
            (one, entry)
            for one in sets
            if one.model == of
            for entry in one.entries
            if (entry.quantity, entry.speed_kmh) == (quantity, speed)
        ]
        range_read = next((entry for _, entry in known if entry.judges), None)
        told = [f"{one.key} {entry.words} ({entry.status})" for one, entry in known if not (judged and entry.judges)]
        note = "; ".join([name, *told])
        low, high = (range_read.low, range_read.high) if judged and range_read is not None else (None, None)
        made.append(Row(title, f"{speed:g} km/h", measured[quantity], unit, low, high, note))
    return made


def sheet(sets: Sequence[ReferenceSet], measured: Mapping[tuple[str, float], Mapping[str, float]]) -> Sheet:
    """Make the table of all reference values beside what the catenary-fixed ride gives, by model and speed."""
    lines: list[dict[str, object]] = []
    for one in sets:
        for entry in one.entries:
            ours = measured[one.model, entry.speed_kmh][entry.quantity]
            title, unit = QUANTITIES[entry.quantity]
            lines.append(
                {
                    "set": one.key,
                    "edition": one.edition,
                    "in_force": "in force" if one.in_force else "withdrawn",
                    "source": entry.source,
                    "status": entry.status,
                    "used": "verdict" if entry.judges else "comparison",
                    "quantity": title,
                    "speed_kmh": entry.speed_kmh,
                    "reference": entry.words,
                    "unit": unit,
                    "ours": ours,
                    "place": ("inside" if entry.low <= ours <= entry.high else "outside") if entry.is_range else "",
                }
            )
    columns = {
        "set": "set",
        "status": "status",
        "used": "used for",
        "quantity": "",
        "speed_kmh": "km/h",
        "reference": "reference",
        "unit": "unit",
        "ours": "ours",
        "place": "",
    }
    return Sheet("reference_values", "Reference values beside the catenary-fixed rides", columns, lines)


def moving_ride(speed: float, setting: Setting, say: Say = lambda _: None) -> Ride:
    """Ride over the ten spans at `speed` km/h with the moving-frame model, `model.Config`'s defaults (two spans)."""
    v = speed / 3.6
    config = model.Config(line=setting.line(), speed=v, start_position=setting.start)
    catenary = model.Catenary(config)
    train, mesh, ts = Coupled(catenary, pantograph(), RAMP), catenary.mesh, config.cycle_time
    cycles = int((END - setting.start) / (v * ts))
    supports: Array = SPAN * np.arange(TEN + 1, dtype=np.float64)
    uplift, parts = np.zeros((cycles, supports.size)), []
    for k in range(cycles):
        parts.append(train.go_on(1))
        at = (supports - catenary.track_position + mesh.behind) / mesh.h
        inside = np.flatnonzero((at >= 0.0) & (at < mesh.elements))
        e = at[inside].astype(np.int64)
        shapes = shape_derivatives(np.asarray(at[inside] - e, dtype=np.float64), mesh.h)[0]
        q = catenary.deviation[0, :, CONTACT]
        uplift[k, inside] = (shapes.T * np.concatenate([q[e], q[e + 1]], axis=1)).sum(axis=1)
        if k % 500 == 0:
            say(f"{speed:g} km/h, moving frame: {100 * k / cycles:.0f} %")
    if catenary.unsettled_steps:
        raise RuntimeError(f"{catenary.unsettled_steps} steps at {speed:g} km/h have no consistent slack state")
    record = joined(parts)
    slack = record.slack_droppers.astype(np.int64)
    nothing = np.zeros(0)
    return Ride(
        t=record.t,
        zeta=record.track,
        w=record.w,
        v=record.v,
        F=record.F,
        head=np.full(cycles, np.nan),
        slack=slack,
        iterations=np.zeros_like(slack),
        supports=supports,
        uplift=uplift,
        snapshot_t=nothing,
        snapshots=nothing.reshape(0, 2, 0),
        speed=np.full(cycles, v),
    )


def _inside(sets: Sequence[ReferenceSet], measured: Mapping[float, Ride], filtered: Filter) -> tuple[int, int]:
    """Count the ranges that were read and that are kept, and all of them."""
    held = [
        row.holds
        for speed, record in measured.items()
        for row in rows(sets, TABLE_3_1, speed, values(record, filtered), "", True)
    ]
    return sum(h is True for h in held), sum(h is not None for h in held)


def _sensitivity(sets: Sequence[ReferenceSet], speeds: Sequence[float], say: Say) -> list[str]:
    """Say what other settings give, one line each."""
    others = {
        "damping of Table 3.1 (0.6, 0.2 N s/m^2)": Setting(carrier_damping=0.6, contact_damping=0.2),
        "damping 1.0 N s/m^2": Setting(carrier_damping=1.0, contact_damping=1.0),
        "damping 2.0 N s/m^2": Setting(carrier_damping=2.0, contact_damping=2.0),
        "supports 5e5 N/m": Setting(support=5e5),
        "supports 1e5 N/m": Setting(support=1e5),
        "droppers 1e6 N/m": Setting(dropper=1e6),
        "droppers 5e4 N/m": Setting(dropper=5e4),
        "elements of 0.5 m": Setting(element_length=0.5),
        "steps of 0.4 ms": Setting(time_step=4e-4),
        "start 5 spans earlier": Setting(start=START - 5 * SPAN),
    }
    lines = []
    for name, setting in others.items():
        say(name)
        records = {speed: ride(speed, setting) for speed in speeds}
        lines.append(f"{name}: {_said(sets, records, causal)}")
    return lines


def _said(sets: Sequence[ReferenceSet], records: Mapping[float, Ride], filtered: Filter) -> str:
    parts = []
    for speed, record in records.items():
        x = values(record, filtered)
        parts.append(
            f"{speed:g} km/h sigma {x['sigma']:.1f}, max {x['maximum']:.0f}, min {x['minimum']:.1f} N, "
            f"uplift {x['uplift']:.1f} mm"
        )
    inside, of = _inside(sets, records, filtered)
    return f"{inside} of {of} inside ({'; '.join(parts)})"


def run(quick: bool, out: Path | None, say: Say, file: Path | None = None) -> Outcome:
    """Ride at all speeds with the one setting; a full run adds what other settings and filters give.

    `file` holds other reference values. Raises ReferenceValuesError.
    """
    sets = load(file)
    setting = Setting(element_length=0.5, time_step=5e-4) if quick else Setting()
    records = {speed: ride(speed, setting, say) for speed in speeds_of(sets, TABLE_3_1)}
    made: list[Row] = []
    measured: dict[tuple[str, float], dict[str, float]] = {}
    config = model.Config()
    moving = f"moving frame, {config.spans} spans, {config.element_length:g} m, {config.step_time * 1e3:g} ms"
    for speed, record in records.items():
        measured[TABLE_3_1, speed] = values(record)
        made += rows(sets, TABLE_3_1, speed, measured[TABLE_3_1, speed], "catenary-fixed", True)
        made += rows(sets, TABLE_3_1, speed, values(moving_ride(speed, setting, say)), moving, False)
    for speed in speeds_of(sets, AC_SIMPLE):
        other = ac_simple.ride(speed, setting.element_length, setting.time_step, say)
        measured[AC_SIMPLE, speed] = values(other, causal, ac_simple.FIRST, ac_simple.LAST)
        name = f"catenary-fixed, {ac_simple.LINE}, {ac_simple.PANTOGRAPH}"
        made += rows(sets, AC_SIMPLE, speed, measured[AC_SIMPLE, speed], name, True)
    notes = [
        *(f"{one.key}: {one.about()}" for one in sets),
        "EN 50318:2002 is withdrawn; EN 50318:2018+A1:2022 and IEC 63453:2025 are in force. Verdicts are given only on "
        "ranges that were read. Values of your own, from the standard, by --values FILE.",
        f"One setting for both speeds: beta = {DAMPING:g} N s/m^2 on both wires, supports {SUPPORT:g} N/m, droppers "
        f"{setting.dropper:g} N/m; elements {setting.element_length:g} m, steps {setting.time_step * 1e3:g} ms.",
        f"Force below {CUTOFF:g} Hz by the monitor's filter (causal Butterworth, order 6), its bands 0 to {LOW:g} and "
        f"{LOW:g} to {CUTOFF:g} Hz by two more of order {ORDER}; loss of contact from the force before any filter.",
    ]
    if any(of == AC_SIMPLE for of, _ in measured):
        notes.append(
            f"ac_simple: the preset {ac_simple.LINE} and the pantograph {ac_simple.PANTOGRAPH} stand in for line and "
            "pantograph of the standard's model, which were not read in it; mean force set to EN 50367's upper limit."
        )
    if records:
        notes += [
            f"filter of order 2, causal: {_said(sets, records, second_order)}",
            f"filter without phase (order 3, both ways): {_said(sets, records, zero_phase)}",
        ]
        if not quick:
            notes += _sensitivity(sets, list(records), say)
        if out is not None:
            from validate.en50318_picture import Evaluated, draw

            shown = {
                speed: Evaluated(
                    record,
                    zero_phase(record.F, float(record.t[1] - record.t[0])),
                    measured[TABLE_3_1, speed]["mean"],
                    measured[TABLE_3_1, speed]["sigma"],
                )
                for speed, record in records.items()
            }
            draw(shown, (FIRST, LAST), SPAN, out / "validate-en50318.png")
    title = "Reference models of EN 50318, spans 5 and 6 of 10"
    return Outcome(title, made, notes, sheets=[sheet(sets, measured)])
