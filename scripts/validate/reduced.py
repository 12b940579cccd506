"""The controller's reduced model against the full one: what it predicts over 30 cycles, by segment and treatment.

A three-mass pantograph rides; its contact force, replayed cycle by cycle, drives the full model. From every 7th cycle
on the reduced model predicts w at the contact point with the forces that really came, started from the full model's
segment, and with what the controller keeps: f_held = M q'' + D q' + K q - b f_cat and the difference of w_cat to c . q
(local compliance). Told is the rms of the error over all starts after 1, 5, 10, 20 and 30 cycles.

Ends of the segment       free, held in place (stiff springs to the present place), matched dashpot
What is kept              f_held at rest in the frame of the train; the same with damped wires (below); f_held carried
                          backwards with the line, as droppers are; nothing
Damped                    a taut dropper feels an unbounded carrier, a dashpot 2 sqrt(T rhoA); `SMEARED` of that, spread
                          evenly over the segment, since droppers near the contact point go slack
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary import Layer, impose
from catenary_model.elements import shape_derivatives
from catenary_model.line import Line, Span, Wire
from catenary_model.model import Catenary, Config
from catenary_model.moving_frame import CONTACT, Mesh, assemble, dense
from catenary_model.reduced import ReducedModel, discretise
from catenary_model.ride import Coupled
from phil_study.drawing import save, subplots
from phil_study.outcome import Outcome, Row
from validate.realtime import config, pantograph, uplift_for

Array = NDArray[np.float64]
Say = Callable[[str], None]

HALVES = (10.0, 15.0, 20.0, 30.0, 40.0)
"""Half lengths of the segment, m."""
ENDS = ("free", "held", "matched_dashpot")
KEPT = ("at rest", "at rest and damped", "carried", "nothing")
STEPS = (1, 5, 10, 20, 30)
EVERY = 7
"""Cycles between two predictions."""
KIND = "three_mass"
SETTLED, EVALUATED = 4.0, 6.0
"""s before the first prediction, s of predictions."""
STIFF = 1e7
"""Spring that holds an end, N/m; N m for its rotation."""
SMEARED = 0.5
"""Share of the droppers' dashpots."""
BARE = 0.01
"""Largest error of the defaults without droppers, mm: there the reduced model is the full one."""
WORSE = 1.1
"""The defaults may be worse than the best of `HALVES` and `ENDS` by this factor."""


def segment(mesh: Mesh, wire: Wire, speed: float, half_length: float, ends: str) -> ReducedModel:
    """Build the reduced model as `reduced.reduce` does, but with any treatment of its ends."""
    part = Mesh(mesh.h, max(1, round(half_length / mesh.h)))
    frame = assemble(part, wire, wire, speed)
    if ends == "matched_dashpot":
        impose("matched_dashpot", frame, Layer(nodes=0))
    rows = np.concatenate([4 * np.arange(part.stations)[:, None] + 2 * CONTACT + np.arange(2)], axis=1).ravel()
    M, D, K = (dense(matrix)[np.ix_(rows, rows)] for matrix in (frame.mass, frame.damping, frame.stiffness))
    if ends == "held":
        for i in (0, 1, -2, -1):
            K[i, i] += STIFF
    b = np.zeros(2 * part.stations)
    b[2 * part.middle] = 1.0
    return ReducedModel(part.x, M, D, K, b, np.zeros((3, b.size, 6)))


def carried(model: ReducedModel, distance: float) -> Array:
    """Return S, (n, n): nodal forces S f are those of f moved backwards by `distance` (m) along the segment.

    The moved load does the work on q that f does on q read `distance` further behind; what would leave the segment
    stays on its last node, and the forces on the two end nodes (what lies beyond them) stay where they are.
    """
    x, n = model.x, model.n
    h = float(x[1] - x[0])
    at = np.clip((x - distance - x[0]) / h, 0.0, x.size - 1.0)
    e = np.minimum(at.astype(np.int64), x.size - 2)
    shapes, slopes, _ = shape_derivatives(at - e, h)
    P = np.eye(n)
    for j in range(1, x.size - 1):
        P[2 * j] = P[2 * j + 1] = 0.0
        P[2 * j, 2 * e[j] : 2 * e[j] + 4] = shapes[:, j]
        P[2 * j + 1, 2 * e[j] : 2 * e[j] + 4] = slopes[:, j]
    return np.asarray(P.T)


@dataclass(frozen=True)
class Recorded:
    """A ride of the full model, cycle by cycle."""

    F: Array
    """Contact force, N, (cycles,)."""
    w: Array
    """w_cat, m, (cycles,)."""
    q: Array
    """q, q', q'' of the widest segment, (cycles, 3, n)."""
    mesh: Mesh
    setting: Config


def damped(line: Line) -> Wire:
    """Return the contact wire with the droppers' dashpots spread over it."""
    droppers = sum(len(span.droppers) for span in line.spans)
    impedance = 2.0 * math.sqrt(line.carrier.tension * line.carrier.mass_per_length)
    more = SMEARED * impedance * droppers / line.period
    return dataclasses.replace(line.contact, damping=line.contact.damping + more)


def record(setting: Config, uplift: float, cycles: int, say: Say) -> Recorded:
    """Ride with the pantograph, replay its force by `Catenary.step`, keep the widest segment."""
    catenary = Catenary(setting)
    force = Coupled(catenary, pantograph(KIND, uplift)).go_on(cycles).F
    catenary.reset()
    w, q = np.zeros(cycles), np.zeros((cycles, 3, catenary.reduced.n))
    for k in range(cycles):
        catenary.step(float(force[k]))
        w[k] = catenary.w_cat
        q[k] = catenary.segment_displacement, catenary.segment_velocity, catenary.segment_acceleration
        if k % 500 == 0:
            say(f"{setting.speed * 3.6:.0f} km/h: cycle {k} of {cycles}")
    return Recorded(force, w, q, catenary.mesh, setting)


def errors(ride: Recorded, half_length: float, ends: str, kept: str) -> Array:
    """Predict from every start; return the errors of w, m, (starts, steps)."""
    setting = ride.setting
    wire = damped(setting.line) if kept.endswith("damped") else setting.line.contact
    model = segment(ride.mesh, wire, setting.speed, half_length, ends)
    A, B, B_held = discretise(model, setting.cycle_time)
    cut = (ride.q.shape[2] - model.n) // 2
    starts = np.arange(round(SETTLED / setting.cycle_time), ride.w.size - STEPS[-1], EVERY)
    q, v, a = (ride.q[starts, d, cut : cut + model.n].T for d in range(3))
    x = np.concatenate([q, v, a])
    held = model.M @ a + model.D @ v + model.K @ q - np.outer(model.b, ride.F[starts])
    if kept == "nothing":
        held = np.zeros_like(held)
    S = carried(model, setting.speed * setting.cycle_time)
    at = int(np.flatnonzero(model.b)[0])
    beyond = ride.w[starts] - q[at]
    out = np.zeros((starts.size, STEPS[-1]))
    for i in range(1, STEPS[-1] + 1):
        if kept == "carried":
            held = S @ held
        x = A @ x + np.outer(B, ride.F[starts + i]) + B_held @ held
        out[:, i - 1] = x[at] + beyond - ride.w[starts + i]
    return out


def rms(ride: Recorded, half_length: float, ends: str, kept: str) -> Array:
    """Return the rms of the error after every cycle of the horizon, mm, (30,)."""
    return np.asarray(1e3 * np.sqrt((errors(ride, half_length, ends, kept) ** 2).mean(axis=0)))


def bare(line: Line) -> Line:
    """Return the line's wires without droppers."""
    return Line(carrier=line.carrier, contact=line.contact, spans=(Span(line.period, ()),), name="bare")


def lines(setting: Config) -> dict[str, Line]:
    """Return the lines to ride on."""
    return {"droppers": setting.line, "no droppers": bare(setting.line)}


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Predict with all segments and treatments at 250 and 320 km/h; a quick run takes one speed and a short ride."""
    made: list[Row] = []
    courses: dict[str, Array] = {}
    default = Config()
    for speed in (250,) if quick else (250, 320):
        base = config(speed, default.spans, segment_half_length=HALVES[-1])
        uplift = uplift_for(speed, KIND, 1.5 if quick else 6.0)
        cycles = round((SETTLED + (1.0 if quick else EVALUATED)) / base.cycle_time)
        for name, line in lines(base).items():
            ride = record(config(speed, default.spans, segment_half_length=HALVES[-1], line=line), uplift, cycles, say)
            found: dict[tuple[float, str, str], Array] = {}
            for half in HALVES:
                for ends in ENDS:
                    for kept in KEPT if name == "droppers" else KEPT[:1]:
                        found[half, ends, kept] = rms(ride, half, ends, kept)
            best = min(float(found[half, ends, KEPT[0]][-1]) for half in HALVES for ends in ENDS)
            for (half, ends, kept), course in found.items():
                case = f"{speed} km/h, {name}, +-{half:g} m, {ends}, f_held {kept}"
                told = ", ".join(f"{i}: {course[i - 1]:.2g}" for i in STEPS[:-1])
                chosen = (half, ends, kept) == (default.segment_half_length, "matched_dashpot", KEPT[0])
                high = (WORSE * best if name == "droppers" else BARE) if chosen else None
                made.append(Row("error after 30 cycles", case, float(course[-1]), "mm", None, high, f"after {told}"))
                if name == "droppers" and speed == 250:
                    courses[case] = course
    if out is not None:
        _draw(courses, out / "validate-reduced.png")
    notes = [
        "The forces of the horizon are known; the error is that of the model alone. rms over all starts.",
        f"Goal: the defaults (+-{default.segment_half_length:g} m, matched dashpot) within {WORSE:g} of the best of "
        "all segments and ends with f_held at rest.",
    ]
    return Outcome("Reduced model of the controller, prediction of w at the contact point", made, notes)


def _draw(courses: dict[str, Array], path: Path) -> None:
    figure, axes = subplots(1, len(KEPT), figsize=(14, 4.5), sharey=True, layout="constrained")
    for axis, kept in zip(axes, KEPT, strict=True):
        for case, course in courses.items():
            if case.endswith(f"f_held {kept}"):
                _, _, half, ends, _ = case.split(", ")
                style = ("-", "--", ":")[ENDS.index(ends)]
                colour = f"C{[f'+-{h:g} m' for h in HALVES].index(half)}"
                axis.semilogy(np.arange(1, course.size + 1), course, style, color=colour, label=f"{half}, {ends}")
        axis.set(title=f"f_held {kept}", xlabel="cycles ahead")
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("rms error of w in mm")
    axes[-1].legend(fontsize=6, ncols=2)
    save(figure, path)
