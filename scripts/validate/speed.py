"""A ride from standstill to standstill on the catenary-fixed reference: start, cruise, brake.

string        a stretched string under a force that accelerates and brakes, against the closed form of d'Alembert: every
              point has risen by I(tau)/(2 rhoA c), I the force's impulse, c (t - tau) = |x - s(tau)|
continuity    two journeys that part when one begins to brake, with a jump of the acceleration: the contact forces must
              part with the square of the time, so that two steps later their difference falls to a quarter when the
              step is halved; a force that jumped would not fall at all
journey       the standard's pantograph over 50 spans of Table 3.1, from 0 to 250 km/h and back, with 2 m/s^2, more than
              a train has, and a jerk of 2 m/s^3; three meshes with their steps against a finer one, by phases
standstill    the contact force when the train has stopped is the static one
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from catenary_model.line import Line, Span, Wire
from catenary_model.reference import Config, Reference, Ride
from catenary_model.travel import Travel, over_time, start_cruise_brake
from phil_study.outcome import Outcome, Row
from validate.en50318 import STATIC_FORCE, Setting, pantograph, zero_phase
from validate.speed_picture import Journey, draw

Array = NDArray[np.float64]
Say = Callable[[str], None]

CRUISE, ACCELERATION, JERK = 250.0 / 3.6, 2.0, 2.0
"""Speed (m/s), acceleration and braking (m/s^2), jerk (m/s^3)."""
SPAN, START, STANDING = 60.0, 150.0, 5.0
"""Length of a span, m; start of the ride from the first mast, m; how long the train is watched after the stop, s."""
MESHES = ((1.0, 1e-3), (0.5, 5e-4), (0.25, 2e-4))
"""Elements (m) and steps (s), the last one as in the EN 50318 study."""
FINEST = (0.125, 1e-4)
GRID, RUN_IN = 0.01, 2.0
"""Step of the common time grid, and beginning that is left out, in which the uplift comes up, s."""
FORCE, PULSE = 50.0, 1.6
"""Largest force on the string (N), and the length of its rise and fall (s)."""


class Course(NamedTuple):
    """A journey from standstill to standstill."""

    cruise: float = CRUISE
    """m/s."""
    distance: float = 50 * SPAN
    """m."""

    @property
    def travel(self) -> Travel:
        """The journey."""
        return start_cruise_brake(
            self.cruise, acceleration=ACCELERATION, braking=ACCELERATION, distance=self.distance, jerk=JERK
        )

    @property
    def spans(self) -> int:
        """Spans of the mesh: those of the journey, and some before and behind."""
        return round(self.distance / SPAN) + 6

    @property
    def phases(self) -> dict[str, tuple[float, float]]:
        """Begin and end of start, cruise and brake, s."""
        ramp = self.cruise / ACCELERATION + ACCELERATION / JERK
        end = self.travel.end
        return {"start": (RUN_IN, ramp), "cruise": (ramp, end - ramp), "brake": (end - ramp, end)}


class Errors(NamedTuple):
    """Differences from the finest run in one phase."""

    force: float
    """Below 20 Hz, rms over the standard deviation of the whole ride, 1."""
    height: float
    """Of the contact point, rms, m."""


def ride_of(course: Course, h: float, ts: float, say: Say) -> Ride:
    """Ride the course with elements of h (m) and steps of ts (s)."""
    reference = Reference(
        Config(
            line=Setting().line(),
            travel=course.travel,
            spans=course.spans,
            start_position=START,
            element_length=h,
            time_step=ts,
        )
    )
    report = lambda share: say(f"journey, {h:g} m, {ts * 1e3:g} ms: {100.0 * share:.0f} %")  # noqa: E731
    record = reference.ride(pantograph(), course.travel.end + STANDING, progress=report)
    if reference.unsettled_steps:
        raise RuntimeError(f"{reference.unsettled_steps} steps of {ts:g} s have no consistent slack state")
    return record


def on_grid(record: Ride) -> tuple[Array, Array]:
    """Contact force below 20 Hz without delay (N) and height of the contact point (m) on the common time grid."""
    grid = np.arange(GRID, record.t[-1], GRID)
    force = zero_phase(record.F, float(record.t[1] - record.t[0]))
    return np.interp(grid, record.t, force), np.interp(grid, record.t, record.w)


def errors_of(course: Course, record: Ride, finest: Ride) -> dict[str, Errors]:
    """Compare a ride with the finest, phase by phase."""
    (F, w), (F0, w0) = on_grid(record), on_grid(finest)
    size = min(F.size, F0.size)
    grid = np.arange(GRID, finest.t[-1], GRID)[:size]
    whole = F0[:size][grid >= RUN_IN].std()
    made = {}
    for name, (begin, end) in course.phases.items():
        inside = (grid >= begin) & (grid < end)
        force, height = (float(np.sqrt(((a[:size] - b[:size])[inside] ** 2).mean())) for a, b in ((F, F0), (w, w0)))
        made[name] = Errors(force / whole, height)
    return made


def string_error(h: float, ts: float) -> tuple[float, float]:
    """Largest error under the force and, at the end, anywhere, over the largest rise; h in m, ts in s."""
    wire = Wire(mass_per_length=1.35, damping=0.0, bending_stiffness=1e-3, tension=20e3)
    moves = over_time([0.0, 0.4, 0.8, 1.2], [10.0, 90.0, 90.0, 0.0])
    begin = 3.0 * SPAN
    reference = Reference(
        Config(
            line=Line(contact=wire, spans=(Span(SPAN, ()),)),
            travel=moves,
            spans=8,
            start_position=begin,
            element_length=h,
            time_step=ts,
        )
    )
    t = ts * np.arange(1, round(moves.end / ts) + 1)
    record = reference.push(FORCE * np.sin(np.pi * t / PULSE) ** 2)
    c, end = wire.wave_speed, float(t[-1])
    per = 2.0 * wire.mass_per_length * c

    def rise(time: float) -> float:
        return FORCE * (0.5 * time - PULSE / (4.0 * math.pi) * math.sin(2.0 * math.pi * time / PULSE)) / per

    def late(tau: float, x: float) -> float:
        return c * (end - tau) - abs(x - begin - moves.at(tau)[0])

    under = np.array([rise(time) for time in t.tolist()])
    places = reference.mesh.zeta.tolist()
    exact = [rise(brentq(late, 0.0, end, args=(x,))) if late(0.0, x) > 0.0 else 0.0 for x in places]
    anywhere = np.abs(reference.heights()[1] - np.array(exact)).max()
    return float(np.abs(record.w - under).max() / under.max()), float(anywhere / under.max())


def parting(ts: float) -> float:
    """Difference (N) of two contact forces two steps of ts (s) after one train has begun to brake with 2 m/s^2."""
    begin = 3.0
    forces = []
    for end in (CRUISE, CRUISE - ACCELERATION):
        reference = Reference(
            Config(
                line=Setting().line(),
                travel=over_time([0.0, begin, begin + 1.0], [CRUISE, CRUISE, end]),
                spans=9,
                element_length=0.5,
                time_step=ts,
            )
        )
        forces.append(reference.ride(pantograph(), begin + 0.1).F)
    before = round(begin / ts) - 1
    if not np.array_equal(forces[0][:before], forces[1][:before]):
        raise RuntimeError("two journeys that are still the same have different forces")
    return float(abs(forces[0][before + 2] - forces[1][before + 2]))


def static_rows(course: Course, record: Ride) -> list[Row]:
    """Compare the force at standstill with the uplift less what the frame's spring takes, F = f_up - k_1 y_1."""
    kind = pantograph()
    stands = record.t > course.travel.end + STANDING - 1.0
    head = float(record.head[stands].mean())
    between = float(-kind.stiffness[0, 1])
    frame = (STATIC_FORCE + between * head) / float(kind.stiffness[0, 0])
    static = STATIC_FORCE - (float(kind.stiffness[0, 0]) - between) * frame
    case = f"{STANDING - 1.0:g} to {STANDING:g} s after the stop"
    difference = float(record.F[stands].mean()) - static
    note = f"mean over a second against {static:.2f} N; the wire still swings"
    moved = float(np.ptp(record.zeta[record.t > course.travel.end]))
    return [
        Row("mean force less the static one", case, difference, "N", -0.5, 0.5, note),
        Row("way after the stop", case, moved, "m", None, 1e-9),
    ]


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Measure all of it."""
    say("string")
    made = []
    found = [string_error(h, ts) for h, ts in ((1.0, 1e-3), (0.5, 5e-4))]
    for place, i in (("under the force", 0), ("anywhere, at the end", 1)):
        case = f"string, 10 to 90 to 0 m/s, 0.5 m, 0.5 ms, {place}"
        made.append(Row("error", case, 100.0 * found[1][i], "%", None, 0.2, "of the largest rise; closed form"))
        order = math.log2(found[0][i] / found[1][i])
        made.append(Row("order", case, order, "", 0.9, None, "force and its kink lie within a step and an element"))
    say("continuity")
    steps = (1e-3, 5e-4, 2.5e-4)
    parted = [parting(ts) for ts in steps]
    for ts, value, before in zip(steps, parted, [None, *parted[:-1]], strict=True):
        case = f"braking begins with {ACCELERATION:g} m/s^2, step {ts * 1e3:g} ms"
        made.append(Row("difference two steps later", case, value, "N"))
        if before is not None:
            made.append(Row("ratio to that of twice the step", case, value / before, "", None, 0.35, "a quarter"))
    meshes, best = (MESHES[:1], MESHES[1]) if quick else (MESHES, FINEST)
    course = Course(20.0, 6 * SPAN) if quick else Course()
    finest = ride_of(course, *best, say)
    records = [ride_of(course, h, ts, say) for h, ts in meshes]
    all_errors = [errors_of(course, record, finest) for record in records]
    for i, (h, ts) in enumerate(meshes):
        judged = not quick and i == len(meshes) - 1
        for phase, errors in all_errors[i].items():
            case = f"{phase}, {h:g} m, {ts * 1e3:g} ms"
            note = f"against {best[0]:g} m, {best[1] * 1e3:g} ms"
            force, height = (3.0, 0.1) if judged else (None, None)
            made.append(Row("error of force", case, 100.0 * errors.force, "%", None, force, note))
            made.append(Row("error of height", case, 1e3 * errors.height, "mm", None, height, note))
    made += static_rows(course, finest)
    notes = [
        f"Journey: 0 to {3.6 * course.cruise:g} km/h and back in {course.travel.end:.1f} s and {course.distance:g} m, "
        f"{ACCELERATION:g} m/s^2, {JERK:g} m/s^3. Force below 20 Hz without phase, rms over the standard deviation of "
        "the whole ride; height of the contact point, rms.",
        f"The beginning, {RUN_IN:g} s in which the uplift comes up, is left out.",
    ]
    F, _ = on_grid(finest)
    grid = np.arange(GRID, finest.t[-1], GRID)
    shown = Journey(
        t=grid,
        speed=np.interp(grid, finest.t, finest.speed),
        force=F,
        errors={
            f"{h:g} m, {ts * 1e3:g} ms": on_grid(record)[0][: F.size] - F[: on_grid(record)[0].size]
            for (h, ts), record in zip(meshes, records, strict=True)
        },
    )
    return Outcome("Speed that changes", made, notes, pictures={"journey": partial(draw, shown)})
