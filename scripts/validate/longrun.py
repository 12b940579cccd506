"""Long rides of the real-time model: nothing drifts, no energy grows, no dropper is lost, disturbances die away.

One hour at 250 km/h and 300 s at 320 km/h, 2 and 20 spans; once with the three-mass pantograph, once with a random
contact force (seeded, below 20 Hz, mean as with the pantograph, sigma 0.3 of it, the most that EN 50367 allows).
Recorded per minute: mean and standard deviation of w and F, slack droppers, energy of the deviation. Energy is that of
a wire at rest in the track's frame, kinetic and strain:

    E = 1/2 int rhoA (q_t - v q_x)^2 + EI q_xx^2 + T q_x^2 dx

Drift is the slope of a straight line through the minutes' values times the length of the ride, over the standard error
of that slope where the force is random (4 are allowed), over the value itself with the pantograph (1 % is allowed).

Disturbed rides are compared with an undisturbed one that is the same up to the disturbance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from catenary_model import elements
from catenary_model.line import Wire
from catenary_model.model import Catenary, Config
from catenary_model.moving_frame import CARRIER, CONTACT
from catenary_model.ride import Coupled, Ride, push
from energy_monitor.contact_quality import CUTOFF
from phil_study.drawing import save, subplots
from phil_study.outcome import Outcome, Row
from validate import disturbances
from validate.realtime import config, pantograph, target, uplift_for

Array = NDArray[np.float64]
Say = Callable[[str], None]

KIND = "three_mass"
SPANS = (2, 20)
RIDES = ((250, 3600.0), (320, 300.0))
"""Speed (km/h), duration (s)."""
SETTLED = 10.0
"""s of every ride before its first minute."""
PIECE = 50
"""Cycles between two looks at energy and droppers."""
SIGMA = 0.3
"""Standard deviation of the random force over its mean."""
SEED = 20
CHANGE, ERRORS = 0.01, 4.0
"""Allowed drift with the pantograph, of the value itself; with a random force, in standard errors."""

NAMES = ("mean of w", "sigma of w", "mean of F", "sigma of F", "slack droppers", "energy")
UNITS = ("mm", "mm", "N", "N", "", "J")
SCALES = (1e3, 1e3, 1.0, 1.0, 1.0, 1.0)


class Energy:
    """Energy of the deviation in the wires of one catenary, J."""

    def __init__(self, catenary: Catenary) -> None:
        """Prepare the element matrices of both wires."""
        self._catenary = catenary
        self._h, self._speed = catenary.mesh.h, catenary.config.speed

    def __call__(self) -> float:
        """Energy of the present state."""
        return self.of(CARRIER, self._catenary.config.line.carrier) + self.of(
            CONTACT, self._catenary.config.line.contact
        )

    def of(self, which: int, wire: Wire) -> float:
        """Energy in one wire."""
        q, rate = (self._by_element(self._catenary.deviation[d, :, which]) for d in (0, 1))
        h, v, rho = self._h, self._speed, wire.mass_per_length
        kinetic = _quadratic(rate, elements.mass(h), rate) + v * v * _quadratic(q, elements.tension(h), q)
        kinetic -= 2.0 * v * _quadratic(rate, elements.convection(h), q)
        strain = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
        return 0.5 * (rho * kinetic + _quadratic(q, strain, q))

    @staticmethod
    def _by_element(nodal: Array) -> Array:
        return np.concatenate([nodal[:-1], nodal[1:]], axis=1)


def _quadratic(left: Array, matrix: Array, right: Array) -> float:
    return float(np.einsum("ei,ij,ej->", left, matrix, right, optimize=True))


class RandomForce:
    """Contact force of given mean and standard deviation (N), Gaussian, below 20 Hz; endless, piece by piece."""

    def __init__(self, mean: float, sigma: float, ts: float, seed: int) -> None:
        """Start the generator with this seed; ts in s."""
        self._mean, self._rng = mean, np.random.default_rng(seed)
        self._sections = butter(4, CUTOFF, fs=1.0 / ts, output="sos")
        impulse = np.zeros(round(2.0 / ts))
        impulse[0] = 1.0
        self._gain = sigma / math.sqrt(float((sosfilt(self._sections, impulse) ** 2).sum()))
        self._memory = np.zeros((self._sections.shape[0], 2))

    def __call__(self, cycles: int) -> Array:
        """Return the next forces, N, (cycles,)."""
        noise, self._memory = sosfilt(self._sections, self._rng.standard_normal(cycles), zi=self._memory)
        return np.asarray(np.maximum(0.0, self._mean + self._gain * noise))


@dataclass(frozen=True)
class Minutes:
    """What a long ride gave, minute by minute."""

    values: Array
    """See NAMES, SI units, (minutes, 6)."""
    extremes: Array
    """Least and largest w (m), largest energy (J), most slack droppers, (minutes, 4)."""
    missing: int
    """Looks at which the number of droppers in the domain was not that of the line there."""
    unsettled: int
    """Steps without consistent slack state."""


def expected_droppers(setting: Config, zeta: float) -> int:
    """Count the line's droppers in the domain around track position zeta (m)."""
    line, mesh = setting.line, setting.mesh
    at = np.concatenate(
        [
            start + np.array([d.position for d in s.droppers])
            for start, s in zip(line.span_starts, line.spans, strict=True)
        ]
    )
    first, last = (zeta - mesh.behind) / line.period, (zeta + mesh.ahead) / line.period
    turns = np.arange(math.floor(first) - 1, math.ceil(last) + 1)
    everywhere = turns[:, None] * line.period + at[None, :]
    return int(((everywhere > zeta - mesh.behind) & (everywhere < zeta + mesh.ahead)).sum())


def whole_minute(setting: Config, minute: float) -> int:
    """Return the pieces nearest to a minute (s) in which the train passes a whole number of periods of the line."""
    per_piece = PIECE * setting.cycle_time * setting.speed / setting.line.period
    about = max(1, round(minute / (PIECE * setting.cycle_time)))
    near = np.arange(max(1, about - about // 10), about + about // 10 + 1)
    off = np.abs(near * per_piece - np.rint(near * per_piece))
    return int(near[np.lexsort((np.abs(near - about), np.round(off, 6)))[0]])


def ride_minutes(
    catenary: Catenary, go_on: Callable[[int], Ride], duration: float, minute: float, told: Say
) -> Minutes:
    """Ride on in pieces and take the statistics of every minute (a shorter one in quick runs)."""
    ts = catenary.config.cycle_time
    go_on(round(SETTLED / ts))
    energy, missing = Energy(catenary), 0
    values, extremes = [], []
    pieces = whole_minute(catenary.config, minute)
    for number in range(max(2, round(duration / (pieces * PIECE * ts)))):
        told(f"{number * pieces * PIECE * ts:.0f} of {duration:.0f} s")
        w, F, slack, stored = np.zeros(pieces * PIECE), np.zeros(pieces * PIECE), np.zeros(pieces * PIECE), []
        for i in range(pieces):
            part, record = slice(i * PIECE, (i + 1) * PIECE), go_on(PIECE)
            w[part], F[part], slack[part] = record.w, record.F, record.slack_droppers
            stored.append(energy())
            missing += catenary.droppers != expected_droppers(catenary.config, catenary.track_position)
        values.append((w.mean(), w.std(), F.mean(), F.std(), slack.mean(), np.mean(stored)))
        extremes.append((w.min(), w.max(), max(stored), slack.max()))
    return Minutes(np.array(values), np.array(extremes), missing, catenary.unsettled_steps)


def slope(values: Array) -> tuple[float, float]:
    """Fit a straight line; return its rise over the whole length and the standard error of that rise."""
    n = values.size
    x = np.arange(n) - 0.5 * (n - 1)
    rate = float(x @ values / (x @ x))
    left = values - values.mean() - rate * x
    error = math.sqrt(float(left @ left) / max(n - 2, 1) / float(x @ x))
    return rate * n, error * n


def drift_rows(case: str, found: Minutes, random: bool) -> list[Row]:
    """Judge one ride."""
    made = []
    for i, (name, unit, scale) in enumerate(zip(NAMES, UNITS, SCALES, strict=True)):
        column = scale * found.values[:, i]
        rise, error = slope(column)
        note = f"first minute {column[0]:.4g}, last {column[-1]:.4g} {unit}".rstrip()
        if random:
            value = abs(rise) / error if error > 0.0 else 0.0
            made.append(
                Row(f"drift of {name}", case, value, "std. errors", None, ERRORS, f"{rise:+.3g} {unit}; {note}")
            )
        else:
            made.append(
                Row(f"drift of {name}", case, 100.0 * abs(rise / float(column.mean())), "%", None, 100.0 * CHANGE, note)
            )
    low, high, most, slack = found.extremes.T
    made.append(Row("largest w", case, 1e3 * float(high.max()), "mm", note=f"least {1e3 * float(low.min()):.1f} mm"))
    made.append(Row("largest energy, last half over first half", case, _halves(most), "", None, 1.5))
    made.append(Row("most slack droppers", case, float(slack.max()), "", note=f"first minute {slack[0]:.0f}"))
    made.append(Row("looks with a dropper missing or too many", case, float(found.missing), "", None, 0.0))
    made.append(Row("steps without consistent slack state", case, float(found.unsettled), "", None, 0.0))
    return made


def _halves(values: Array) -> float:
    half = values.size // 2
    return float(values[half:].max() / values[: max(half, 1)].max())


def long_ride(
    speed: int, duration: float, spans: int, random: bool, uplift: float, minute: float, say: Say
) -> tuple[str, Minutes]:
    """Ride one of the long rides; return its name as well."""
    setting = config(speed, spans)
    catenary = Catenary(setting)
    what = "random force" if random else KIND
    case = f"{speed} km/h, {duration:g} s, {spans} spans, {what}"
    if random:
        force = RandomForce(target(speed), SIGMA * target(speed), setting.cycle_time, SEED)
        first = np.linspace(0.0, 1.0, round(2.0 / setting.cycle_time))
        push(catenary, target(speed) * first)
        go_on: Callable[[int], Ride] = lambda cycles: push(catenary, force(cycles))  # noqa: E731
    else:
        go_on = Coupled(catenary, pantograph(KIND, uplift)).go_on
    return case, ride_minutes(catenary, go_on, duration, minute, lambda done: say(f"{case}: {done}"))


def _draw(long: dict[str, Minutes], path: Path) -> None:
    figure, axes = subplots(len(NAMES), 1, figsize=(10, 2.2 * len(NAMES)), sharex=True, layout="constrained")
    for i, (axis, name, unit, scale) in enumerate(zip(axes, NAMES, UNITS, SCALES, strict=True)):
        for case, found in long.items():
            axis.plot(np.arange(1, len(found.values) + 1), scale * found.values[:, i], ".-", lw=0.8, label=case)
        axis.set(ylabel=f"{name}\n{unit}")
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=6, ncols=2)
    axes[-1].set_xlabel("minute")
    save(figure, path)


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Make the long rides and the disturbed ones; a quick run takes seconds for minutes and one speed."""
    made: list[Row] = []
    long: dict[str, Minutes] = {}
    disturbed: list[Row] = []
    minute, after = (5.0, 21.0) if quick else (60.0, disturbances.AFTER)
    for speed, duration in ((250, 20.0),) if quick else RIDES:
        say(f"{speed} km/h: uplift")
        uplift = uplift_for(speed, KIND, 1.5 if quick else 6.0)
        for spans in SPANS[:1] if quick else SPANS:
            for random in (False, True):
                case, found = long_ride(speed, duration, spans, random, uplift, minute, say)
                long[case] = found
                made += drift_rows(case, found, random)
            setting, rider = config(speed, spans), pantograph(KIND, uplift)
            passing = setting.line.period / len(setting.line.spans) / setting.speed
            say(f"{speed} km/h, {spans} spans: disturbances")
            record = Coupled(Catenary(setting), rider).go_on(round((disturbances.BEFORE + after) / setting.cycle_time))
            both = {
                "force given": disturbances.forced_disturbances(setting, record, after),
                KIND: disturbances.coupled_disturbances(setting, rider, after),
            }
            for how, results in both.items():
                case = f"{speed} km/h, {spans} spans, {how}"
                disturbed += disturbances.disturbance_rows(case, results, passing)
            if out is not None:
                disturbances.draw(both, passing, out / f"validate-longrun-disturbances-{speed}-{spans}.png")
    if out is not None:
        _draw(long, out / "validate-longrun.png")
    notes = [
        "A minute is the nearest time in which a whole number of periods of the line is passed.",
        f"Random force: below {CUTOFF:g} Hz, mean as with the pantograph, sigma {SIGMA:g} of it, not below 0; seed "
        f"{SEED}.",
        f"Drift: straight line through the minutes. With the pantograph at most {100.0 * CHANGE:g} % over the ride, "
        f"with the random force at most {ERRORS:g} standard errors of the slope.",
        "Energy: kinetic and strain energy of the deviation in both wires, as seen from the track.",
    ]
    return Outcome("Long rides of the real-time model", made + disturbed, notes)
