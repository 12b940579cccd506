"""Two pantographs of one train: the real-time models against the catenary-fixed reference, force by force.

The leading one rides at x = 0, coupled within the step; the trailing one is a companion within the model
(`catenary_model.companions`). Line, uplift, filter and evaluated stretch are those of the study `realtime`, with four
spans. Error: rms of the difference below 20 Hz over the standard deviation of the reference's force.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from catenary_model import reference
from catenary_model.build import build
from catenary_model.companions import FORCE, HEIGHT, Companion
from catenary_model.pantograph import Pantograph
from catenary_model.ride import Coupled
from phil_study.outcome import Row
from validate import realtime
from validate.realtime_signals import Signals, agreement

Say = Callable[[str], None]

MODELS: dict[str, dict[str, object]] = {
    "fd, 0.2 m, 3 steps": {"discretisation": "fd", "grid_spacing": 0.2, "grid_substeps": 3},
    "fd": {"discretisation": "fd"},
    "fe": {"discretisation": "fe"},
}
"""What is held against the reference; the first one is judged."""
ELEMENT, STEP = 0.125, 1e-4
"""Of the reference, m and s: with twice of both, as elsewhere, the trailing one's force at 250 km/h and 200 m, which is
small there, is off by 4.5 % of sigma."""
GOAL = 0.10
SPANS = 4
KIND = "three_mass"


def of_reference(speed: int, rider: Pantograph, distance: float, window: float) -> list[Signals]:
    """Ride with both on the reference (speed in km/h, distance in m), whose ends nothing comes back from in time."""
    v, duration = speed / 3.6, realtime.SETTLED + window + realtime.TAIL
    behind, ahead = realtime.needed_spans(v, duration)
    behind += math.ceil(distance / realtime.line().period)
    model = reference.Reference(
        reference.Config(
            line=realtime.line(),
            speed=v,
            spans=behind + ahead,
            first_span=-behind,
            start_position=realtime.START,
            element_length=ELEMENT,
            time_step=STEP,
        )
    )
    train = [reference.Mounted(rider), reference.Mounted(rider, distance)]
    return [Signals(one.t, one.w, one.F) for one in model.ride_together(train, duration, realtime.SOFT)]


def of_model(
    speed: int, rider: Pantograph, distance: float, window: float, changes: dict[str, object]
) -> list[Signals]:
    """Ride with both on a real-time model."""
    base = realtime.config(speed, SPANS, **changes)
    catenary = build(dataclasses.replace(base, companions=(Companion(rider, distance, realtime.SOFT),)))
    train = Coupled(catenary, rider, realtime.SOFT)
    count = round((realtime.SETTLED + window + realtime.TAIL) / base.cycle_time)
    w, F = np.zeros((2, count)), np.zeros((2, count))
    for k in range(count):
        one = train.go_on(1)
        w[0, k], F[0, k] = one.w[0], one.F[0]
        w[1, k], F[1, k] = catenary.companions[0, [HEIGHT, FORCE]]
    t = base.cycle_time * np.arange(1, count + 1, dtype=np.float64)
    return [Signals(t, w[i], F[i]) for i in range(2)]


def rows(speeds: tuple[int, ...], distances: tuple[float, ...], quick: bool, say: Say) -> list[Row]:
    """Hold each model against the reference, both forces."""
    window = 1.5 if quick else realtime.WINDOW
    made = []
    for speed in speeds[:1] if quick else speeds:
        say(f"{speed} km/h: uplift")
        rider = realtime.pantograph(KIND, realtime.uplift_for(speed, KIND, window))
        for distance in distances[:1] if quick else distances:
            say(f"{speed} km/h, {distance:g} m: reference")
            truth = [realtime.evaluated(one, window) for one in of_reference(speed, rider, distance, window)]
            for number, (name, changes) in enumerate(MODELS.items()):
                say(f"{speed} km/h, {distance:g} m: {name}")
                found = of_model(speed, rider, distance, window, changes)
                for which, one, right in zip(("leading", "trailing"), found, truth, strict=True):
                    error = agreement(realtime.evaluated(one, window).F, right.F).error
                    note = f"reference sigma {right.F.std():.1f} N" + ("" if number == 0 else f"; asked: {GOAL:g}")
                    case = f"{speed} km/h, {distance:g} m, {which}, {name}"
                    made.append(Row("error of force", case, error, "", None, GOAL if number == 0 else None, note))
    return made
