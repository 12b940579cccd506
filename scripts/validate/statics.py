"""Elasticity of the line: a static push along a span, by every model of the line side by side.

IEC 63453 has a static check of the line's model (7.3): uplift and elasticity at every dropper, mid-way between droppers
and at the supports. Here the contact wire is pushed there with 100, 150 and 200 N on every preset, by

mesh-free    the equilibrium in closed form (`statics`) pushed statically (`stiffness`): no mesh, no time, an endless
             line; what the other three are held against
reference    the catenary-fixed reference, 0.25 m, ten spans
fe, fd       the real-time model by finite elements and by finite differences, its default mesh and domain

The last three are integrated at a train's speed of 0, which all of them allow: the force comes up as (1 - cos)/2 in
`RAMP` s, stands for `HOLD` s, and the uplift is the mean over the last `AVERAGED` s, weighted by a Hann window, in
which what still swings at 0.5 Hz and above has no part; then the next force. Where a wire comes to rest does not depend
on damping or time step, so the line keeps its own damping and the reference takes steps of 2 ms.

Elasticity e is the uplift over the force (mm/N), its non-uniformity over the points u = (e_max - e_min)/(e_max +
e_min). **Tolerance.** A mesh lacks compliance dC under a point load (`lattice`, 2e-7 m/N for 0.25 m, 1.3e-6 m/N for
0.75 m): the reference has none of it back, the other two give it to the contact point and to every dropper by itself,
which is once too often where the force stands on a clamp. So an elasticity may be wrong by the largest dC of the
model's contact wire, which counts most where the line is stiffest, and by `REMAINDER` for all else: what the mesh
lacks at the masts and at other clamps, what is not quite at rest, the ends of the moving domain (135 and 225 m away
the wire is lifted by 2e-3 of the uplift at most, and what an end does to that has the same way back). u is off by at
most (1 - u^2) times that. A dropper that is about to slacken does so a little earlier or later on a mesh: as many
have to be slack as the mesh-free line has at this force or one that differs by `NEAR`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model import lattice, reference, statics
from catenary_model.build import Config, build
from catenary_model.config import DISCRETISATIONS
from catenary_model.finite_difference.model import grids
from catenary_model.line import Line
from catenary_model.line_file import load_line, preset_names
from catenary_model.moving_frame import CONTACT
from catenary_model.ride import push
from catenary_model.stiffness import PushedLine
from phil_study.outcome import Outcome, Row, Sheet
from validate.statics_picture import Pushes, draw

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Say = Callable[[str], None]

FORCES = (100.0, 150.0, 200.0)
"""N."""
RAMP, HOLD, AVERAGED = 4.0, 16.0, 12.0
"""Time in which a force comes up, for which it stands, and over whose end the uplift is averaged, s."""
TIME_STEP = 2e-3
"""Cycle of the real-time models and step of the reference, s."""
SPANS, BEFORE = 10, 5
"""Spans of the reference's mesh, spans of it before the line's first one."""
REMAINDER = 1e-3
"""Share of the uplift by which a wire may be off for all but what its mesh lacks under the force."""
REST = 1e-4
"""Share of the uplift by which the two halves of an average may differ: a tenth of `REMAINDER`."""
NEAR = 0.03
"""Share by which the force may differ at which a dropper goes slack."""
LINEAR = 1e-6
"""Most that the mesh-free elasticity may change with the force while no dropper is slack: rounding and its far end."""
TRUTH = "mesh-free"


class Point(NamedTuple):
    """A place where the line is pushed."""

    zeta: float
    """Track position, m."""
    what: str
    """`support`, `dropper` or `between` (two droppers)."""


@dataclass(frozen=True)
class Curve:
    """What one model says of a line."""

    uplift: Array
    """Lift of the contact wire under the force, m, (points, forces)."""
    slack: Counts
    """Slack droppers, (points, forces)."""
    unrest: float = 0.0
    """Largest difference of the two halves of an average, as a share of the uplift."""

    @staticmethod
    def elasticity_of(uplift: Array, forces: Sequence[float]) -> Array:
        """Uplift (m) over force (N), mm/N."""
        return np.asarray(1e3 * uplift / np.array(forces))


Model = Callable[[Line, Sequence[Point], Sequence[float], Say], Curve]


def points_of(line: Line) -> list[Point]:
    """Every support, every dropper and every middle between two droppers of a span, over one period of the line."""
    found = []
    for start, span in zip(line.span_starts, line.spans, strict=True):
        at = np.array([dropper.position for dropper in span.droppers])
        found.append(Point(start, "support"))
        found += [Point(start + float(zeta), "dropper") for zeta in at]
        found += [Point(start + float(zeta), "between") for zeta in 0.5 * (at[1:] + at[:-1])]
    return sorted(found)


def mesh_free(line: Line, points: Sequence[Point], forces: Sequence[float], say: Say = lambda _: None) -> Curve:
    """Push the endless line in closed form."""
    pushed = PushedLine(statics.solve(line))
    say(f"{line.name}, {TRUTH}")
    found = [[pushed.push(point.zeta, force) for force in forces] for point in points]
    return Curve(
        np.array([[one.uplift for one in row] for row in found]),
        np.array([[int((one.dropper_forces <= 0.0).sum()) for one in row] for row in found]),
    )


def slack_near(line: Line, points: Sequence[Point], forces: Sequence[float]) -> tuple[Counts, Counts]:
    """Fewest and most slack droppers of the mesh-free line under forces within `NEAR` of these, (points, forces)."""
    shares = (1.0 - NEAR, 1.0, 1.0 + NEAR)
    every = np.array([mesh_free(line, points, [share * force for force in forces]).slack for share in shares])
    return every.min(axis=0), every.max(axis=0)


def stairs(forces: Sequence[float]) -> tuple[Array, list[int]]:
    """Return the force of every step (N), from 0 up to each of these and on for `HOLD`, and the steps' ends."""
    ramp, hold = round(RAMP / TIME_STEP), round(HOLD / TIME_STEP)
    share = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, ramp + 1) / ramp)
    parts, before = [], 0.0
    for force in forces:
        parts += [before + (force - before) * share, np.full(hold, force)]
        before = force
    return np.concatenate(parts), [(i + 1) * (ramp + hold) for i in range(len(forces))]


def rested(w: Array, ends: Sequence[int]) -> tuple[Array, float]:
    """Return the mean (m) before each end, and the largest share by which its first and second half differ."""
    count = round(AVERAGED / TIME_STEP)
    half = count // 2
    whole, part = np.hanning(count), np.hanning(half)
    means, apart = np.zeros(len(ends)), 0.0
    for i, end in enumerate(ends):
        last = w[end - count : end]
        means[i] = whole @ last / whole.sum()
        halves = [float(part @ piece / part.sum()) for piece in (last[:half], last[-half:])]
        apart = max(apart, abs(halves[1] - halves[0]) / abs(float(means[i])))
    return means, apart


def _pushed(
    line: Line,
    points: Sequence[Point],
    forces: Sequence[float],
    say: Say,
    name: str,
    one: Callable[[float, Array], tuple[Array, Counts]],
) -> Curve:
    """Push at every point by `one`, which returns the lift at every step (m) and the slack droppers."""
    force, ends = stairs(forces)
    uplift, slack, unrest = [], [], 0.0
    for number, point in enumerate(points):
        say(f"{line.name}, {name}: point {number + 1} of {len(points)}")
        w, count = one(point.zeta, force)
        means, apart = rested(w, ends)
        uplift.append(means)
        slack.append(count[np.array(ends) - 1])
        unrest = max(unrest, apart)
    return Curve(np.array(uplift), np.array(slack), unrest)


def moving(
    line: Line,
    points: Sequence[Point],
    forces: Sequence[float],
    say: Say = lambda _: None,
    *,
    discretisation: str = "fe",
) -> Curve:
    """Push the real-time model at speed 0. Raises RuntimeError for unsettled steps."""

    def one(zeta: float, force: Array) -> tuple[Array, Counts]:
        setting = Config(line=line, speed=0.0, start_position=zeta, cycle_time=TIME_STEP, discretisation=discretisation)
        catenary = build(setting)
        rest = catenary.w_cat
        record = push(catenary, force)
        if catenary.unsettled_steps:
            raise RuntimeError(f"{catenary.unsettled_steps} steps at {zeta:g} m have no consistent slack state")
        return record.w - rest, record.slack_droppers.astype(np.int64)

    return _pushed(line, points, forces, say, discretisation, one)


def fixed(line: Line, points: Sequence[Point], forces: Sequence[float], say: Say = lambda _: None) -> Curve:
    """Push the catenary-fixed reference at speed 0. Raises RuntimeError for unsettled steps."""

    def one(zeta: float, force: Array) -> tuple[Array, Counts]:
        model = reference.Reference(
            reference.Config(
                line=line, speed=0.0, spans=SPANS, first_span=-BEFORE, start_position=zeta, time_step=TIME_STEP
            )
        )
        record = model.push(force)
        if model.unsettled_steps:
            raise RuntimeError(f"{model.unsettled_steps} steps at {zeta:g} m have no consistent slack state")
        return record.w - model.height_at_rest(zeta), record.slack

    return _pushed(line, points, forces, say, "reference", one)


MODELS: dict[str, Model] = {
    "reference": fixed,
    **{name: partial(moving, discretisation=name) for name in DISCRETISATIONS},
}
"""What is held against the mesh-free line."""


def lacking(line: Line, model: str) -> float:
    """Return the largest compliance that a model's mesh lacks under a point load on the contact wire, dC in m/N."""
    if model == "fd":
        config = Config(line=line, speed=0.0, discretisation="fd")
        return float(np.abs(grids(config)[CONTACT].missing_compliance()).max())
    h = reference.Config().element_length if model == "reference" else Config().element_length
    return float(np.abs(lattice.missing_compliance(line.contact, h, 32)).max())


def non_uniformity(elasticity: Array) -> Array:
    """Return u = (e_max - e_min)/(e_max + e_min) over the points, (forces,)."""
    most, least = elasticity.max(axis=0), elasticity.min(axis=0)
    return np.asarray((most - least) / (most + least))


def rows(
    line: Line, points: Sequence[Point], forces: Sequence[float], truth: Curve, found: dict[str, Curve]
) -> list[Row]:
    """Make the rows of one line: what the mesh-free line says, and a verdict per claim and model."""
    e = Curve.elasticity_of(truth.uplift, forces)
    u = non_uniformity(e)
    taut = truth.slack == 0
    least = np.where(taut, e, np.inf).min(axis=1)
    change = np.where(taut, e / least[:, None] - 1.0, 0.0).max()
    made = [
        Row("elasticity, smallest", line.name, float(e.min()), "mm/N", note=_where(points, forces, e, e.argmin())),
        Row("elasticity, largest", line.name, float(e.max()), "mm/N", note=_where(points, forces, e, e.argmax())),
    ]
    for force, share, slack in zip(forces, u, truth.slack.max(axis=0), strict=True):
        note = f"{force:g} N, {TRUTH}; slack droppers at most {slack}"
        made.append(Row("non-uniformity u", line.name, 100.0 * float(share), "%", note=note))
    note = "largest, while no dropper is slack"
    made.append(Row("change of e with the force", line.name, 100.0 * float(change), "%", None, 100.0 * LINEAR, note))
    fewest, most = slack_near(line, points, forces)
    for model, curve in found.items():
        case = f"{line.name}, {model}"
        off = np.abs(curve.uplift / truth.uplift - 1.0)
        dC = lacking(line, model)
        allowed = 1e3 * dC / float(e.min()) + REMAINDER
        where = _where(points, forces, off, off.argmax())
        note = f"{where}; mean {100.0 * off.mean():.2g} %; dC {1e6 * dC:.2g} um/N"
        made.append(Row("e against mesh-free", case, 100.0 * float(off.max()), "%", None, 100.0 * allowed, note))
        differs = np.abs(non_uniformity(Curve.elasticity_of(curve.uplift, forces)) - u)
        bound = allowed * (1.0 - float(u.min()) ** 2)
        made.append(Row("u against mesh-free", case, 100.0 * float(differs.max()), "%", None, 100.0 * bound))
        wrong = (curve.slack < fewest) | (curve.slack > most)
        exact = int((curve.slack != truth.slack).sum())
        note = f"of {wrong.size}, at a force within {100.0 * NEAR:g} %; {exact} at this very force"
        made.append(Row("other slack droppers, pushes", case, float(wrong.sum()), "", None, 0.0, note))
        note = "drift within the average, of the uplift"
        made.append(Row("not at rest", case, 100.0 * curve.unrest, "%", None, 100.0 * REST, note))
    return made


def _where(points: Sequence[Point], forces: Sequence[float], of: Array, index: np.intp) -> str:
    i, j = divmod(int(index), of.shape[1])
    return f"{points[i].what} at {points[i].zeta:g} m, {forces[j]:g} N"


def sheet(line: Line, points: Sequence[Point], forces: Sequence[float], curves: dict[str, Curve]) -> Sheet:
    """Make the table of all points; what is for the file alone is under `uplift_mm`, `elasticity_mm_N`, `slack`."""
    e = {name: Curve.elasticity_of(curve.uplift, forces) for name, curve in curves.items()}
    others = [name for name in curves if name != TRUTH]
    lines: list[dict[str, object]] = []
    for i, point in enumerate(points):
        row: dict[str, object] = {"zeta_m": float(point.zeta), "what": point.what, "force_N": list(forces)}
        for j, force in enumerate(forces):
            row[f"e_{force:g}"] = float(e[TRUTH][i, j])
        for name in others:
            off = e[name][i] / e[TRUTH][i] - 1.0
            row[f"off_{name}"] = 100.0 * float(off[np.abs(off).argmax()])
        row["slack_most"] = int(curves[TRUTH].slack[i].max())
        row["uplift_mm"] = {name: (1e3 * curve.uplift[i]).tolist() for name, curve in curves.items()}
        row["elasticity_mm_N"] = {name: value[i].tolist() for name, value in e.items()}
        row["slack"] = {name: curve.slack[i].tolist() for name, curve in curves.items()}
        lines.append(row)
    columns = {"zeta_m": "m", "what": ""}
    columns |= {f"e_{force:g}": f"e {force:g} N" for force in forces}
    columns |= {f"off_{name}": f"{name} %" for name in others} | {"slack_most": "slack"}
    title = f"{line.name}: elasticity e in mm/N ({TRUTH}), largest difference of the other models, slack droppers"
    return Sheet(f"points_of_{line.name}", title, columns, lines)


def pushes(line: Line, points: Sequence[Point], forces: Sequence[float], curves: dict[str, Curve], fine: int) -> Pushes:
    """Collect what the picture shows: the models' points, and the mesh-free line at `fine` places in between."""
    zeta = np.linspace(0.0, line.period, fine)
    between = mesh_free(line, [Point(float(at), "") for at in zeta], forces)
    return Pushes(
        line.name,
        np.array([point.zeta for point in points]),
        np.array(line.span_starts),
        tuple(forces),
        zeta,
        Curve.elasticity_of(between.uplift, forces),
        {name: Curve.elasticity_of(curve.uplift, forces) for name, curve in curves.items()},
        TRUTH,
    )


def run(quick: bool, out: Path | None, say: Say) -> Outcome:
    """Push every preset; a quick run takes one line, one force and six points."""
    made: list[Row] = []
    sheets, pictures = [], {}
    forces = FORCES[:1] if quick else FORCES
    for name in preset_names() if not quick else ("en50318_2002",):
        line = load_line(name)
        points = points_of(line)[:: 3 if quick else 1]
        truth = mesh_free(line, points, forces, say)
        models = {} if line.stitched else MODELS  # they have no stitch wires
        found = {model: measure(line, points, forces, say) for model, measure in models.items()}
        made += rows(line, points, forces, truth, found)
        curves = {TRUTH: truth, **found}
        sheets.append(sheet(line, points, forces, curves))
        if out is not None:
            shown = pushes(line, points, forces, curves, round(line.period / (2.0 if quick else 0.5)) + 1)
            pictures[name] = partial(draw, shown)
    notes = [
        "All models of the line at speed 0, which all of them allow. Points: every support, every dropper, every "
        "middle between two droppers. Elasticity e = uplift / force, u = (e_max - e_min)/(e_max + e_min) over them.",
        "Limit of the difference in e: the largest compliance dC that the model's mesh lacks under a point load, over "
        f"the smallest e, and {100.0 * REMAINDER:g} % for all else; of u: (1 - u^2) times that. Droppers: as many "
        f"slack as {TRUTH} at a force within {100.0 * NEAR:g} %.",
        "Published elasticities of these lines: none was read, so none is compared. For comparison only, no verdict: "
        "second-hand, of another line (KS-400, validation of its model), differences of at most 9.5 %, 3 % on average; "
        "unverified, u below about 10 % as a guideline for stitched high-speed lines. A line with stitch wires is "
        f"pushed by {TRUTH} alone: the other models have none.",
    ]
    return Outcome(
        "Static push along a span, all models of the line", made, notes, sheets=sheets, pictures=pictures, grouped=True
    )
