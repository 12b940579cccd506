"""Two pantographs of one train on the catenary-fixed reference: what the trailing one meets of the leading one.

contact force  statistics below 20 Hz of both at 85 and 200 m, 250 and 300 km/h, and of one alone; by the fine mesh of
               the EN 50318 study and by the coarser one of the sweep, which have to agree
sweep          sigma of the trailing one over the distance from 50 to 250 m
wave           a push of 30 ms by the leading contact, heard at contacts behind it: its speed, seen from the train
real time      the real-time models against the reference, both forces (`pantographs_realtime`)
tone           a steady tone of the leading contact on the wire without droppers: its frequency at a mast behind, at a
               mast ahead and at a trailing contact (Doppler)
phase          Both forces repeat themselves from span to span, so they are harmonics n v/L of the passing of spans
               (those near L/p are the passing of droppers p apart). What the trailing one has beyond a ride alone,
               b_n(d), goes round as the leading one moves away: a wave of the frequency f in the frame of the track has
               had d/v more of time to turn when the trailing one is d further behind, f/v turns a metre. A wave with
               the contact wire's c would have f = n v/L (1 - v/(c + v)); the waves of the whole line (`line_waves`)
               have other ones, and none in its stop bands.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from catenary_model.line import Line
from catenary_model.reference import Config, Mounted, Reference, Ride
from energy_monitor.contact_quality import CUTOFF, ContactStatistics, losses_of, low_passed, statistics_of
from phil_study.outcome import Outcome, Row, Sheet
from validate import pantographs_realtime
from validate.en50318 import Setting, pantograph
from validate.line_waves import left_behind
from validate.pantographs_picture import Sweep, draw

Array = NDArray[np.float64]
Phasors = NDArray[np.complex128]
Say = Callable[[str], None]

SPEEDS = (250, 300)
"""km/h."""
DISTANCES = (85.0, 200.0)
"""Distances with statistics of their own, m."""
SWEPT = tuple(np.arange(50.0, 250.1, 2.5).tolist())
"""Distances of the sweep, m: four to a passing of droppers, see `phase`."""
SPAN, SPANS = 60.0, 34
START = 330.0
"""Of the leading one, m from the first mast."""
FIRST, LAST = 780.0, 1380.0
"""Stretch over which both are evaluated, each when it is there, m: ten spans, 450 m or more of run-in before it."""
COARSE = Setting(element_length=0.5, time_step=5e-4)
"""Mesh and step of the sweep."""
PUSH, PUSHED = 20.0, 0.03
"""Force (N) and length (s) of the push."""
LISTENING = tuple(np.arange(20.0, 181.0, 20.0).tolist())
"""Distances at which it is heard, m."""
TONE, TONES, TONE_TIME = 10.0, (6.0, 10.0, 15.0), 3.0
"""Amplitude (N), frequencies (Hz) and length (s) of the tones."""


@dataclass(frozen=True)
class Force:
    """What is kept of one pantograph's ride over the evaluated stretch."""

    statistics: ContactStatistics
    harmonics: Phasors
    """Amplitudes of F at n v/L up to 20 Hz, N; phase 0 is a crest at a mast."""


def reference_of(line: Line, speed: int, setting: Setting, spans: int = SPANS) -> Reference:
    """Build the reference for a speed in km/h."""
    return Reference(
        Config(
            line=line,
            speed=speed / 3.6,
            spans=spans,
            start_position=START,
            element_length=setting.element_length,
            time_step=setting.time_step,
        )
    )


def force_of(record: Ride) -> Force:
    """Evaluate a ride over the stretch as monitor and report do: causal low-pass, losses before it."""
    ts = float(record.t[1] - record.t[0])
    inside = record.between(FIRST, LAST)
    F, zeta, v = record.F[inside], record.zeta[inside], float(record.speed[0])
    n = np.arange(1, int(CUTOFF * SPAN / v) + 1)
    turns: Phasors = np.exp(-2j * np.pi * n[:, np.newaxis] * zeta / SPAN)
    filtered = low_passed(record.F, ts, CUTOFF)[inside]
    return Force(statistics_of(filtered, losses_of(F <= 0.0)), 2.0 / F.size * (turns @ F))


def forces(speed: int, distance: float | None, setting: Setting) -> list[Force]:
    """Ride with one pantograph, or with a second one at this distance (m) behind it; the leading one comes first."""
    reference = reference_of(setting.line(), speed, setting)
    train = [Mounted(pantograph())] + ([] if distance is None else [Mounted(pantograph(), distance)])
    records = reference.ride_together(train, (LAST + (distance or 0.0) - START) / (speed / 3.6))
    if reference.unsettled_steps:
        raise RuntimeError(f"{reference.unsettled_steps} steps at {speed} km/h have no consistent slack state")
    return [force_of(record) for record in records]


def contact_wire(speed: int) -> tuple[float, float]:
    """Wave speed of the contact wire and speed of the train, m/s."""
    return Setting().line().contact.wave_speed, speed / 3.6


def heard_speed(speed: int) -> float:
    """Speed (m/s, seen from the train) of a short push on its way back, from when its peak comes to each distance."""
    reference = reference_of(COARSE.line(), speed, COARSE, 16)
    behind = [0.0, *LISTENING]
    t = COARSE.time_step * np.arange(1, round((LISTENING[-1] / 150.0 + PUSHED) / COARSE.time_step))
    force = np.zeros((t.size, len(behind)))
    force[:, 0] = np.where(t < PUSHED, PUSH * np.sin(np.pi * t / PUSHED) ** 2, 0.0)
    loud, silent = (reference.push_together(given, behind) for given in (force, 0.0 * force))
    arrivals = [t[np.argmax(x.v - y.v)] for x, y in zip(loud[1:], silent[1:], strict=True)]
    return float(1.0 / np.polyfit(LISTENING, arrivals, 1)[0])


def tone_heard(speed: int, tone: float) -> tuple[float, float, float]:
    """Frequency (Hz) of a tone of the leading contact at a mast behind, at one ahead, at a contact 85 m behind it.

    Wires without droppers, so that nothing but the tone is heard.
    """
    line = COARSE.line()
    (span,) = line.spans
    bare = dataclasses.replace(line, spans=(dataclasses.replace(span, droppers=()),))
    v, ts = speed / 3.6, COARSE.time_step
    reference = reference_of(bare, speed, COARSE, 16)
    t = ts * np.arange(1, round(TONE_TIME / ts) + 1)
    force = np.zeros((t.size, 2))
    force[:, 0] = TONE * np.sin(2.0 * np.pi * tone * t)
    leading, trailing = reference.push_together(force, [0.0, DISTANCES[0]])
    passed = (leading.supports - START) / v
    behind, ahead = np.flatnonzero(passed > 0.8)[0], np.flatnonzero(passed > TONE_TIME)[0]
    rate = np.gradient(leading.uplift, ts, axis=0)
    return (
        strongest(rate[t > passed[behind] + 0.1, behind], ts),
        strongest(rate[t > 0.6 * TONE_TIME, ahead], ts),
        strongest(trailing.v[t > 1.0], ts),
    )


def strongest(signal: Array, ts: float) -> float:
    """Frequency of a record's strongest line, Hz: Hann window, zeros behind it, so that the grid is finer than 0.01."""
    window = np.hanning(signal.size)
    size = 1 << 18
    spectrum = np.abs(np.fft.rfft((signal - signal.mean()) * window, size))
    return float(np.fft.rfftfreq(size, ts)[int(spectrum.argmax())])


def turns_a_metre(distances: Array, phasors: Phasors) -> float:
    """Rate at which phasors over the distance go round, 1/m: the strongest line of their spectrum, either sense."""
    rates = np.linspace(-0.2, 0.2, 8001)
    weighted = phasors * np.hanning(distances.size + 2)[1:-1]
    spectrum = np.abs(np.exp(-2j * np.pi * rates[:, np.newaxis] * distances) @ weighted)
    return float(rates[int(spectrum.argmax())])


def sweep(speed: int, distances: Sequence[float], say: Say) -> Sweep:
    """Ride with the trailing one at every distance."""
    (alone,) = forces(speed, None, COARSE)
    both = []
    for distance in distances:
        say(f"{speed} km/h, {distance:g} m")
        both.append(forces(speed, distance, COARSE))
    c, v = contact_wire(speed)
    d = np.array(distances)
    more = np.array([trailing.harmonics - alone.harmonics for _, trailing in both])
    n = np.arange(1, more.shape[1] + 1)
    return Sweep(
        speed=speed,
        distance=d,
        leading=np.array([leading.statistics.sigma for leading, _ in both]),
        trailing=np.array([trailing.statistics.sigma for _, trailing in both]),
        alone=alone.statistics.sigma,
        frequency=n * v / SPAN,
        more=np.sqrt(0.5 * (np.abs(more) ** 2).mean(axis=0)),
        own=np.abs(alone.harmonics) / np.sqrt(2.0),
        turns=np.array([turns_a_metre(d, column) for column in more.T]),
        of_c=n / SPAN * (1.0 - v / (c + v)),
        of_line=left_behind(COARSE.line(), v) / v,
    )


def tone_expected(speed: int, tone: float) -> tuple[float, float]:
    """Frequency (Hz) of the tone at a mast behind and at one ahead, from the dispersion relation of the contact wire.

    With the train's speed v the waves behind have omega(k) + v k = 2 pi tone, those ahead omega(k) - v k (3.26).
    """
    wire, v = COARSE.line().contact, speed / 3.6
    found = []
    for sign in (1.0, -1.0):
        excess = lambda k, sign=sign: wire.frequency(k) + sign * v * k - 2.0 * np.pi * tone  # noqa: E731
        found.append(wire.frequency(brentq(excess, 0.0, 20.0)) / (2.0 * np.pi))
    return found[0], found[1]


def wave_rows() -> list[Row]:
    """Judge how fast a push comes back, and at which frequency a tone is heard where."""
    made = []
    for speed in SPEEDS:
        c, v = contact_wire(speed)
        note = f"c + v = {c:.1f} + {v:.1f} m/s; peak of a push of {PUSHED * 1e3:g} ms at {len(LISTENING)} distances"
        made.append(Row("speed of a push", f"{speed} km/h", heard_speed(speed) / (c + v), "c + v", 0.97, 1.03, note))
    for speed in SPEEDS:
        for tone in TONES:
            expected = (*tone_expected(speed, tone), tone)
            places = ("at a mast behind", "at a mast ahead", "at the trailing one")
            for place, heard, right in zip(places, tone_heard(speed, tone), expected, strict=True):
                note = f"expected {right:.3f} Hz: beam's dispersion relation"
                case = f"{speed} km/h, {tone:g} Hz, {place}"
                made.append(Row("tone", case, heard, "Hz", 0.995 * right, 1.005 * right, note))
    return made


def force_rows(quick: bool, say: Say) -> tuple[list[Row], Sheet]:
    """Ride at the two distances and alone: what is judged, and the statistics as a table of their own."""
    made: list[Row] = []
    table: list[dict[str, object]] = []
    fine = COARSE if quick else Setting()
    for speed in SPEEDS:
        mean = 0.0
        for distance in (None, *DISTANCES):
            say(f"{speed} km/h, " + ("alone" if distance is None else f"{distance:g} m"))
            found = forces(speed, distance, fine)
            coarse = found if quick else forces(speed, distance, COARSE)
            names = ("alone",) if distance is None else ("leading", "trailing")
            for name, force, same in zip(names, found, coarse, strict=True):
                x = force.statistics
                case = f"{speed} km/h, " + (name if distance is None else f"{distance:g} m, {name}")
                made.append(Row("sigma", case, x.sigma, "N", note="below 20 Hz, ten spans"))
                change = 100.0 * (same.statistics.sigma / x.sigma - 1.0)
                if not quick:
                    made.append(Row("sigma by the sweep's mesh", case, change, "%", -3.0, 3.0, "against the fine one"))
                if distance is None:
                    mean = x.mean
                else:
                    note = "both have the same uplift"
                    made.append(Row("mean less that alone", case, x.mean - mean, "N", -1.0, 1.0, note))
                table.append(
                    {
                        "speed_kmh": speed,
                        "distance_m": distance,
                        "which": name,
                        "mean_N": x.mean,
                        "sigma_N": x.sigma,
                        "minimum_N": x.minimum,
                        "maximum_N": x.maximum,
                        "statistical_minimum_N": x.statistical_minimum,
                        "loss_percent": 100.0 * x.loss_share,
                        "losses": x.losses,
                    }
                )
    columns = {
        "speed_kmh": "km/h",
        "distance_m": "m apart",
        "which": "",
        "mean_N": "mean N",
        "sigma_N": "sigma N",
        "minimum_N": "min N",
        "maximum_N": "max N",
        "statistical_minimum_N": "mean - 3 sigma N",
        "loss_percent": "loss %",
        "losses": "losses",
    }
    return made, Sheet("contact", "Contact force below 20 Hz over ten spans; losses before the filter", columns, table)


def sweep_rows(found: Sweep) -> list[Row]:
    """Say where the trailing one is worst and best, and judge how its harmonics go round with the distance."""
    name = f"{found.speed} km/h"
    made = [Row("sigma alone", name, found.alone, "N")]
    for what, i in (("largest", int(found.trailing.argmax())), ("smallest", int(found.trailing.argmin()))):
        note = f"at {found.distance[i]:g} m"
        made.append(Row(f"{what} sigma of the trailing one", name, float(found.trailing[i]), "N", note=note))
    far = np.abs(found.leading / found.alone - 1.0)[found.distance >= 100.0].max()
    made.append(Row("sigma of the leading one, change", f"{name}, 100 m and more", 100.0 * float(far), "%"))
    if found.distance.size < len(SWEPT):
        return made
    v = found.speed / 3.6
    for n in range(2):
        expected = float(found.of_line[n])
        note = f"expected {expected:.4f}/m, {v * expected:.3f} Hz in the track; with c it were {found.of_c[n]:.4f}"
        case = f"{name}, {found.frequency[n]:.2f} Hz"
        made.append(Row("turns a metre", case, float(found.turns[n]), "1/m", 0.97 * expected, 1.03 * expected, note))
    first, second = (1.0 / float(rate) for rate in found.of_line[:2])
    apart, alike = repeats(found.distance, found.trailing)
    step = float(found.distance[1] - found.distance[0])
    note = f"correlation {alike:.2f}; one turn of the first wave {first:.1f} m, two of the second {2.0 * second:.1f} m"
    low, high = sorted((first, 2.0 * second))
    made.append(Row("sigma repeats itself after", name, apart, "m", low - step, high + step, note))
    return made


def repeats(distance: Array, sigma: Array) -> tuple[float, float]:
    """Distance (m) after which sigma is most like itself, from 30 to 150 m, and its correlation with itself there."""
    step = float(distance[1] - distance[0])
    shifts = np.arange(round(30.0 / step), round(150.0 / step) + 1)
    alike = np.array([np.corrcoef(sigma[:-k], sigma[k:])[0, 1] for k in shifts])
    best = int(alike.argmax())
    return step * float(shifts[best]), float(alike[best])


def harmonic_sheet(sweeps: Sequence[Sweep]) -> Sheet:
    """List all harmonics: size, how fast they go round, and the line's wave that is nearest to that."""
    rows: list[dict[str, object]] = []
    for x in sweeps:
        for n in range(x.frequency.size):
            near = x.of_line[np.abs(x.of_line - x.turns[n]).argmin()]
            rows.append(
                {
                    "speed_kmh": x.speed,
                    "frequency_Hz": float(x.frequency[n]),
                    "own_N": float(x.own[n]),
                    "more_N": float(x.more[n]),
                    "turns_per_m": float(x.turns[n]),
                    "of_c_per_m": float(x.of_c[n]),
                    "of_line_per_m": float(near),
                }
            )
    columns = {
        "speed_kmh": "km/h",
        "frequency_Hz": "Hz",
        "own_N": "alone N",
        "more_N": "more N",
        "turns_per_m": "turns/m",
        "of_c_per_m": "with c",
        "of_line_per_m": "nearest wave of the line",
    }
    return Sheet("harmonics", "Harmonics of the passing of spans in the trailing one's force, rms", columns, rows)


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Measure all of it."""
    say("waves")
    made = wave_rows()
    rows, table = force_rows(quick, say)
    made += rows
    made += pantographs_realtime.rows(SPEEDS, DISTANCES, quick, say)
    sweeps = [sweep(speed, SWEPT[::40] if quick else SWEPT, say) for speed in SPEEDS]
    for found in sweeps:
        made += sweep_rows(found)
    notes = [
        f"Line and pantograph of the EN 50318 study, {SPANS} spans; both are evaluated from {FIRST:g} to {LAST:g} m, "
        "each when it is there; elements 0.25 m and steps 0.2 ms, the sweep 0.5 m and 0.5 ms.",
        "Turns a metre: how fast what the leading one adds to a harmonic of the trailing one's force goes round as the "
        "distance grows; its resolution is 1/200 m. Judged are the two lowest, which one wave alone feeds; higher ones "
        "may follow a long wave that droppers have mixed into them, or lie in a stop band.",
    ]
    details = [
        Row(f"sigma, {which}", f"{x.speed} km/h, {distance:g} m", value, "N", note="sweep")
        for x in sweeps
        for which, values in (("leading", x.leading), ("trailing", x.trailing))
        for distance, value in zip(x.distance.tolist(), values.tolist(), strict=True)
    ]
    return Outcome(
        "Two pantographs of one train",
        made,
        notes,
        details=details,
        sheets=[table, harmonic_sheet(sweeps)],
        pictures={"distance": partial(draw, sweeps)},
    )
