"""Would the contact force on the line have been the same? The closed loop against the coupling without a rig.

Every speed, pantograph, rig and control: `DURATION` s, side by side with the same pantograph on the same catenary
(`impedance_ride`, `impedance_figures`). Goals are for the integrated control with correction on the nominal rig, and
for two rigs that the controller finds changed: one more cycle of delay, of which it is told, and a natural frequency
30 % below its model's, of which it is not. The harsh rig has to stay within its limits (it must not trip) and within
`BOUND` of the wire; what else it costs is told. A control that loses the wire is shown with the time at which it did.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, fields, replace
from multiprocessing import get_context
from pathlib import Path

from impedance_mpc.solver import DAQP
from phil_study.outcome import Outcome, Row
from validate.impedance_figures import SETTLED, Figures, Statistics, evaluate, in_units, statistics, whole_spans
from validate.impedance_ride import (
    CASCADED,
    CONTROLS,
    CORRECTED,
    RUN_IN,
    VARIANTS,
    Case,
    Direct,
    Record,
    closed_loop,
    direct,
)
from validate.impedance_sheet import LEGEND, sheet
from validate.realtime import line

Say = Callable[[str], None]
Bounds = Mapping[str, tuple[float | None, float | None]]
Place = tuple[int, str]
"""Speed in km/h and pantograph."""

SPEEDS = (160, 250, 320)
"""km/h."""
KINDS = ("en50318", "three_mass")
RIGS = ("ideal", "nominal", "harsh")
DURATION, QUICK = 20.0, 4.0
"""Length of a ride, and in a quick run, s."""
LATER = 0.6
"""Share of a short ride after which it is evaluated."""
WORKERS = 2
"""Processes that ride side by side."""
BOUND = 5.0
"""Largest position error on the harsh rig, mm."""

CLOSED: Bounds = {
    "position": (None, 0.25),
    "lag": (-0.3, 0.3),
    "energy": (None, 0.1),
    "true_work": (None, 0.1),
    "momentum": (None, 0.1),
    "impulse": (None, 0.1),
    "mean_change": (-1.0, 1.0),
    "sigma_change": (-5.0, 5.0),
}
"""Goals on the nominal rig, in the units that people read."""
CHANGED: Bounds = {
    "energy": (None, 0.5),
    "true_work": (None, 0.5),
    "momentum": (None, 1.0),
    "impulse": (None, 1.0),
}
"""Goals on a rig that the controller finds changed."""
HARSH: Bounds = {"position_max": (None, BOUND)}
"""Goals on the harsh rig, beside that none of its limits trips."""
BETTER = 5.0
"""How many times larger the velocity error of the cascaded control has to be on the nominal rig."""


@dataclass(frozen=True)
class Ridden:
    """One case and what became of it; the record only where it is drawn."""

    case: Case
    figures: Figures
    reason: str
    """Why the rig's limits would have ended the ride."""
    record: Record | None


def cases(quick: bool = False) -> list[Case]:
    """List all rides; a quick run takes one."""
    if quick:
        return [Case(250, "en50318")]
    found = []
    for speed in SPEEDS:
        for kind in KINDS:
            found += [Case(speed, kind, rig, control) for rig in RIGS for control in CONTROLS]
            found += [Case(speed, kind, variant=variant) for variant in VARIANTS[1:]]
    return found


def drawn(case: Case) -> bool:
    """Tell whether the pictures show this ride itself and not only its figures."""
    return case.rig == "nominal" and not case.variant


def window(case: Case, ts: float, duration: float) -> slice:
    """Choose the cycles of a ride that are evaluated; a short ride is evaluated sooner."""
    passing = line().period / len(line().spans) / (case.speed / 3.6)
    return whole_spans(ts, duration, passing, min(SETTLED, LATER * duration))


def ridden(case: Case, coupled: Direct, duration: float) -> Ridden:
    """Ride one case and evaluate it."""
    record = closed_loop(case, duration)
    figures = evaluate(record, coupled, window(case, record.ts, duration))
    return Ridden(case, figures, record.reason, record if drawn(case) else None)


def everything(
    wanted: Sequence[Case], duration: float, workers: int, say: Say
) -> tuple[dict[Place, Direct], list[Ridden]]:
    """Make all rides, side by side in processes of their own if there is more than one; cases in their order."""
    places = list(dict.fromkeys(case.at for case in wanted))
    if workers < 2:
        coupled = {place: direct(Case(*place), duration) for place in places}
        found = []
        for number, case in enumerate(wanted):
            say(f"ride {number + 1} of {len(wanted)}: {case}")
            found.append(ridden(case, coupled[case.at], duration))
        return coupled, found
    # Not forked: the caller may have a thread that shows the progress.
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        say(f"{len(places)} rides without a rig")
        made = pool.map(direct, [Case(*place) for place in places], [duration] * len(places))
        coupled = dict(zip(places, made, strict=True))
        going = {pool.submit(ridden, case, coupled[case.at], duration): number for number, case in enumerate(wanted)}
        done: dict[int, Ridden] = {}
        for ended in as_completed(going):
            done[going[ended]] = ended.result()
            say(f"ride {len(done)} of {len(wanted)}: {wanted[going[ended]]}")
    return coupled, [done[number] for number in range(len(wanted))]


def goals(case: Case) -> Bounds:
    """Give the goals that a case has."""
    if case.control != CORRECTED or case.rig == "ideal":
        return {}
    if case.rig == "harsh":
        return HARSH
    return CHANGED if case.variant else CLOSED


def rows(found: Ridden, cascaded: Figures | None) -> list[Row]:
    """Make the rows of one ride; `cascaded` is what that control made of the same rig."""
    case, values, wanted = found.case, in_units(found.figures), goals(found.case)
    made = [
        Row(entry.metadata["label"], str(case), values[entry.name], entry.metadata["unit"],
            *wanted.get(entry.name, (None, None)))
        for entry in fields(Figures)
    ]  # fmt: skip
    if cascaded is not None and case.control == CORRECTED:
        lost = not math.isnan(cascaded.left)
        ratio = math.nan if lost else cascaded.velocity / found.figures.velocity
        note = f"cascaded lost the wire after {cascaded.left:.2f} s" if lost else ""
        low = BETTER if wanted and case.rig == "nominal" and not lost else None
        made.append(Row("velocity error, cascaded over this", str(case), ratio, "", low, None, note))
    if wanted:
        ended = not (math.isnan(values["left"]) and math.isnan(values["tripped"]))
        made.append(Row("trips of the rig", str(case), float(ended), "", None, 0.0, found.reason))
    return made


def direct_rows(place: Place, found: Statistics) -> list[Row]:
    """Make the rows of a direct coupling."""
    case = f"{place[0]} km/h, {place[1]}, no rig"
    return [
        Row(entry.metadata["label"], case, value, entry.metadata["unit"])
        for entry, value in zip(fields(Statistics), in_units(found).values(), strict=True)
    ]


def run(quick: bool, out: Path | None, say: Say, solver: str = DAQP) -> Outcome:
    """Make all rides with a solver of the controller; a quick run makes a single one."""
    wanted, duration = [replace(case, solver=solver) for case in cases(quick)], QUICK if quick else DURATION
    workers = 1 if quick else min(WORKERS, os.cpu_count() or 1)
    coupled, every = everything(wanted, duration, workers, say)
    windows = {case.at: window(case, coupled[case.at].ts, duration) for case in wanted}
    without = {place: statistics(coupled[place].f, coupled[place].ts, windows[place]) for place in coupled}
    figures = {found.case: found.figures for found in every}
    made: list[Row] = []
    for place, found in without.items():
        made += direct_rows(place, found)
        for one in every:
            if one.case.at == place:
                rival = figures.get(Case(*place, one.case.rig, CASCADED)) if not one.case.variant else None
                made += rows(one, rival)
    if out is not None:
        from validate.impedance_picture import draw

        say("pictures")
        draw(out, coupled, figures, {one.case: one.record for one in every if one.record is not None}, windows)
    notes = [
        f"Rides of {duration:g} s from the same place under the same static force, which comes up within {RUN_IN:g} s; "
        f"motion and force are evaluated over whole spans from {min(SETTLED, LATER * duration):g} s on, the books from "
        f"{RUN_IN:g} s on. The controller's solver: {solver}.",
        "|dE| and |dp| are the largest at any time after that, over what the whole ride exchanged; over what was "
        "exchanged by then they are told and have no goal: early in a ride next to nothing has been exchanged.",
        "|dp| by true impulse is told and has no goal: the load cell's bias is in it, which no controller can know of.",
        LEGEND,
    ]
    return Outcome(
        "Transparency: the closed loop against the coupling without a rig",
        [row for row in made if row.holds is not None],
        notes,
        details=[row for row in made if row.holds is None],
        grouped=True,
        overviews=[
            sheet(speed, without, list(figures.items())) for speed in dict.fromkeys(case.speed for case in wanted)
        ],
    )
