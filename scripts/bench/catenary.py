"""The catenary's step: distribution, cost over spans, share by phase, and against two other ways to the same wire.

Driven with the contact force of the three-mass pantograph at 250 km/h, recorded from `catenary_model.ride` and replayed
through `Catenary.step`, from Python, as the node calls it. The cases take turns in short blocks, so that whatever else
the machine does meets all of them; verdicts are on the median over all blocks.
"""

from __future__ import annotations

import dataclasses
import os
from time import perf_counter_ns

import numpy as np
from numpy.typing import NDArray

from bench import catenary_picture
from bench.banded_lu import BandedLU
from bench.catenary_competitors import (
    BANDED,
    MODEL,
    SPARSE,
    Contest,
    Contestants,
    Disagreement,
    comparable,
    disagreement,
)
from bench.catenary_phases import GROUPS, Share, Shares, same_bits
from bench.sparse_lu import SparseLU
from bench.turns import first
from catenary_model.boundary import BOUNDARIES
from catenary_model.build import MovingCatenary, build
from catenary_model.companions import Companion
from catenary_model.config import DISCRETISATIONS
from catenary_model.model import Catenary, Config
from catenary_model.pantograph import Pantograph
from catenary_model.ride import push, ride
from phil_loop import ClosedLoop, settings
from phil_study.distribution import distribution
from phil_study.outcome import Outcome, Sheet
from test_rig_sim.pantographs import PANTOGRAPHS

Array = NDArray[np.float64]

SPANS = (2, 3, 4, 6, 8, 12, 16)
GRID_SPANS = (2, 4)
"""Spans with which the finite differences are timed."""
UPLIFT = 144.0
"""On the frame of the three-mass pantograph, N: a mean contact force of 130 N, the most that EN 50367 allows (AC)."""
START = 30.0
"""Track position at cycle 0, m."""
WARM_UP = 1500
"""Cycles before anything is timed: the uplift has come up and the first reflections are through."""
COLD = 50
"""Cycles at the beginning of a block that are not counted: the caches still hold the case before."""
BLOCK = 1000
"""Cycles of a case in one block."""
MEDIAN_GOAL, PER_SPAN_GOAL = 0.025, 0.008
"""ms."""
TAIL_GOAL = 2.0
"""p99 over median."""
THESIS_CATENARY_MS = 0.33
TOLERANCE = 1e-12
"""Coupling tolerance with which the three ways are held against each other."""
SAME = 1e-9
"""They are the same wire if they differ by less, relative to the largest entry: rounding over some hundred steps."""

BESIDE, BESIDE_GOAL = 200.0, 1.6
"""Distance of a second pantograph, m, and what a cycle with it may take over one without."""

DEFAULT = Config(start_position=START)
THESIS_MESH = dataclasses.replace(DEFAULT, element_length=1.0, layer_behind=20.0, layer_ahead=20.0, substeps=1)
THESIS_NAME = "2 spans, thesis's mesh"


def three_mass() -> Pantograph:
    """Give the three-mass pantograph."""
    chain = PANTOGRAPHS["three_mass"]()
    return Pantograph.of(chain.mass, chain.damping, chain.stiffness, UPLIFT)


def recorded_force(cycles: int) -> Array:
    """Contact force (N) of the three-mass pantograph on the default model, one entry a cycle, (cycles,)."""
    return ride(Catenary(DEFAULT), three_mass(), cycles * DEFAULT.cycle_time).F


def called(catenary: MovingCatenary, force: Array) -> Array:
    """Replay forces (N) from Python, one call a cycle; return what each call took, s, (cycles,)."""
    step, times = catenary.step, [0] * force.size
    for k, value in enumerate(force.tolist()):
        begun = perf_counter_ns()
        step(value)
        times[k] = perf_counter_ns() - begun
    return np.array(times) * 1e-9


class Replay:
    """One case on its ride; every block goes on where the last one ended."""

    def __init__(self, config: Config, warm_up: Array) -> None:
        self.catenary = build(config)
        push(self.catenary, warm_up)
        called(self.catenary, warm_up[-2:])
        self.blocks: list[Array] = []

    def block(self, force: Array) -> None:
        """Time these cycles but for the first ones."""
        self.blocks.append(called(self.catenary, force)[COLD:])

    @property
    def times(self) -> Array:
        """All times, s."""
        return np.concatenate(self.blocks)

    @property
    def medians(self) -> Array:
        """Median of every block, s."""
        return np.array([np.median(block) for block in self.blocks])


class InLoop:
    """The model's step in the closed loop, controller and rig called in between."""

    def __init__(self) -> None:
        self._ride = ClosedLoop(settings(), limits=False).begin(0.0, timed=True)
        self.blocks: list[Array] = []
        self._ride.run(WARM_UP // 5)

    def block(self, force: Array) -> None:
        """Time a quarter of these cycles but for the first ones; the force is the controller's own."""
        counted = max(COLD, force.size // 4 - COLD)
        self._ride.run(COLD + counted)
        times = self._ride.record().times
        assert times is not None
        self.blocks.append(times.catenary[-counted:].copy())

    @property
    def times(self) -> Array:
        """All times, s."""
        return np.concatenate(self.blocks)


def per_span(medians: dict[int, float]) -> tuple[float, float]:
    """Return cost of a span and of the rest by linear regression over the number of spans."""
    slope, rest = np.polyfit(list(medians), list(medians.values()), 1)
    return float(slope), float(rest)


def run(quick: bool) -> Outcome:
    """Measure everything."""
    rounds, block = (2, 150) if quick else (20, BLOCK)
    force = recorded_force(WARM_UP + rounds * (block + COLD))
    warm_up, rest = force[:WARM_UP], force[WARM_UP:].reshape(rounds, -1)
    if not same_bits(DEFAULT, force[:300]):
        raise RuntimeError("the phases are not the model's step: bring scripts/bench/catenary_phases.py up to it")
    load_before = os.getloadavg()[0]
    replays = {spans: Replay(dataclasses.replace(DEFAULT, spans=spans), warm_up) for spans in SPANS}
    coarse = Replay(THESIS_MESH, warm_up)
    grids = {n: Replay(dataclasses.replace(DEFAULT, discretisation="fd", spans=n), warm_up) for n in GRID_SPANS}
    shares = {kind: Shares(dataclasses.replace(DEFAULT, boundary=kind), warm_up) for kind in BOUNDARIES}
    contests = {
        f"{config.mesh.stations} stations": Contestants(comparable(config), warm_up)
        for config in (DEFAULT, THESIS_MESH)
    }
    beside = (Companion(three_mass(), BESIDE),)
    trains = {
        kind: Replay(dataclasses.replace(DEFAULT, discretisation=kind, companions=beside), warm_up)
        for kind in DISCRETISATIONS
    }
    loop = InLoop()
    cases: list[Replay | InLoop] = [*replays.values(), coarse, *grids.values(), *trains.values(), loop]
    granted = True
    for number, part in enumerate(rest):
        for case in (*cases[number % len(cases) :], *cases[: number % len(cases)]):  # none is always first
            with first() as got:
                case.block(part)
            granted = granted and got
        for share in shares.values():
            with first():
                share.round(part[: part.size // 2])
        for contest in contests.values():
            with first():
                contest.round(part[: part.size // 2])
    apart, solves = _compared(force, 20 if quick else 100)
    samples = {f"{spans} spans": replay.times for spans, replay in replays.items()}
    samples[f"{THESIS_NAME}, {4 * coarse.catenary.mesh.stations} unknowns"] = coarse.times
    for spans, replay in grids.items():
        samples[f"{spans} spans, finite differences, {2 * replay.catenary.mesh.stations} unknowns"] = replay.times
    for kind, replay in trains.items():
        unknowns = (4 if kind == "fe" else 2) * replay.catenary.mesh.stations
        samples[f"2 spans, {kind}, second pantograph {BESIDE:g} m behind, {unknowns} unknowns"] = replay.times
    samples["2 spans, between controller and rig"] = loop.times
    wanted, nothing = (MEDIAN_GOAL, "median", "goal"), (None, "median", "")
    goals = [
        wanted,
        *[nothing] * (len(SPANS) - 1),
        wanted,
        *[nothing] * (len(GRID_SPANS) + len(trains)),
        (THESIS_CATENARY_MS, "median", "Table 3.2"),
    ]
    rows = [distribution(name, times, *goal) for (name, times), goal in zip(samples.items(), goals, strict=True)]
    measured = {kind: share.share() for kind, share in shares.items()}
    held = {name: contest.contest for name, contest in contests.items()}
    cost = _over_spans(replays)
    sheets = [
        _goals(replays, coarse, cost, {"fe": (trains["fe"], replays[2]), "fd": (trains["fd"], grids[2])}),
        cost,
        _phases(measured, rows[0].median),
        _boundaries(measured),
        _competitors(held),
        _agreement(apart, solves),
    ]
    notes = [
        f"SCHED_FIFO as the nodes have it: {'granted' if granted else 'not granted'}; load average (1 min) "
        f"{load_before:.2f} before, {os.getloadavg()[0]:.2f} after, on {os.cpu_count()} processors; {rounds} rounds.",
        "Caches: a case that is replayed has them to itself; in the closed loop the controller and the rig use them in "
        f"between, which makes a cycle {rows[-1].median - rows[0].median:+.4f} ms longer.",
        "Phases: in sequence on the real ride, the clock read after each and its cost "
        f"({measured[DEFAULT.boundary].clock * 1e9:.0f} ns) taken off. Their sum is not the whole: across a clock the "
        "compiler may move nothing and the processor overlaps less; the call from Python comes on top.",
        "Comparison: same mesh, sites, forces, integration step; local compliance off and matched dashpots for all "
        "three. A step is timed in a compiled loop (splu: from Python), a cycle as called from Python.",
    ]
    title = f"catenary: one cycle of 2 ms ({DEFAULT.substeps} integration steps) at 250 km/h"
    pictures = {
        "histogram": catenary_picture.histogram(replays[2].times, coarse.times),
        "spans": catenary_picture.spans(cost.rows),
        "phases": catenary_picture.phases(measured),
        "competitors": catenary_picture.competitors(held),
    }
    return Outcome(title, rows, notes, sheets=sheets, samples=samples, pictures=pictures)


def _compared(force: Array, cycles: int) -> tuple[dict[str, Disagreement], int]:
    """Hold the three ways against each other over these cycles after the warm-up, and the model's usual tolerance."""
    strict = dataclasses.replace(comparable(DEFAULT), coupling_tolerance=TOLERANCE)
    warm_up, then = force[:WARM_UP], force[WARM_UP : WARM_UP + cycles]
    (banded, sparse), solves = disagreement(strict, warm_up, then, (BandedLU, SparseLU))
    (usual,), _ = disagreement(comparable(DEFAULT), warm_up, then, (BandedLU,))
    found = {BANDED: banded, SPARSE: sparse, f"{BANDED}, model at its usual tolerance": usual}
    for name in (BANDED, SPARSE):
        if not (found[name].wire < SAME and found[name].slack_equal):
            raise RuntimeError(f"{name} is not the same wire as the model: {found[name]}")
    return found, solves


def _over_spans(replays: dict[int, Replay]) -> Sheet:
    rows: list[dict[str, object]] = []
    for spans, replay in replays.items():
        times, mesh = replay.times, replay.catenary.mesh
        rows.append(
            {
                "spans": spans,
                "stations": mesh.stations,
                # In s first, as the rounds': so rounding leaves it between the best and the worst of them.
                "median_ms": float(np.median(times)) * 1e3,
                "best_round_ms": float(replay.medians.min()) * 1e3,
                "worst_round_ms": float(replay.medians.max()) * 1e3,
                "p99_ms": float(np.percentile(times, 99.0)) * 1e3,
            }
        )
    columns = {
        "spans": "spans",
        "stations": "stations",
        "median_ms": "median ms",
        "best_round_ms": "best round's ms",
        "worst_round_ms": "worst round's ms",
        "p99_ms": "p99 ms",
    }
    return Sheet("spans", "cost over spans", columns, rows)


def _goals(replays: dict[int, Replay], coarse: Replay, cost: Sheet, trains: dict[str, tuple[Replay, Replay]]) -> Sheet:
    medians = {spans: float(np.median(replay.times)) * 1e3 for spans, replay in replays.items()}
    best = {spans: float(replay.medians.min()) * 1e3 for spans, replay in replays.items()}
    tail = [float(np.percentile(block, 99.0) / np.median(block)) for block in replays[2].blocks]
    all_two = replays[2].times * 1e3
    measured = [
        ("median, 2 spans", medians[2], best[2], "ms", MEDIAN_GOAL),
        ("p99 over median, 2 spans", float(np.percentile(all_two, 99.0)) / medians[2], min(tail), "1", TAIL_GOAL),
        (
            f"median, {THESIS_NAME}",
            float(np.median(coarse.times)) * 1e3,
            float(coarse.medians.min()) * 1e3,
            "ms",
            MEDIAN_GOAL,
        ),
        ("cost of a span (regression)", per_span(medians)[0], per_span(best)[0], "ms", PER_SPAN_GOAL),
    ]
    for kind, (two, one) in trains.items():
        ratio = float(np.median(two.times) / np.median(one.times))
        least = float((two.medians / one.medians).min())
        measured.append((f"two pantographs over one, {kind}, {BESIDE:g} m, 2 spans", ratio, least, "1", BESIDE_GOAL))
    rows: list[dict[str, object]] = [
        {"name": name, "value": value, "best_round": least, "unit": unit, "at_most": goal, "holds": value <= goal}
        for name, value, least, unit, goal in measured
    ]
    columns = {
        "name": "goal",
        "value": "all rounds",
        "best_round": "best round",
        "at_most": "at most",
        "unit": "unit",
        "holds": "verdict",
    }
    return Sheet("goals", "goals", columns, rows)


def _phases(measured: dict[str, Share], called_ms: float) -> Sheet:
    share = measured[DEFAULT.boundary]
    total = float(share.phase.sum())
    rows: list[dict[str, object]] = [
        {"phase": name, "us": share.group(name) * 1e6, "percent": 100.0 * share.group(name) / total} for name in GROUPS
    ]
    for name, us in (
        ("sum of the phases", total * 1e6),
        ("whole cycle in a compiled loop", share.whole * 1e6),
        ("whole cycle, called from Python", called_ms * 1e3),
    ):
        rows.append({"phase": name, "us": us, "percent": 100.0 * us / (total * 1e6)})
    return Sheet(
        "phases",
        f"share by phase: 2 spans, {DEFAULT.boundary}, one cycle",
        {"phase": "phase", "us": "us", "percent": "%"},
        rows,
    )


def _boundaries(measured: dict[str, Share]) -> Sheet:
    rows: list[dict[str, object]] = [
        {
            "boundary": kind,
            "boundary_us": share.group("boundary") * 1e6,
            "sum_us": float(share.phase.sum()) * 1e6,
            "whole_us": share.whole * 1e6,
        }
        for kind, share in measured.items()
    ]
    columns = {
        "boundary": "kind",
        "boundary_us": "its phase, us",
        "sum_us": "sum of all phases, us",
        "whole_us": "whole cycle, us",
    }
    return Sheet("boundaries", "cost of the boundary kinds: 2 spans, one cycle in compiled code", columns, rows)


def _competitors(held: dict[str, Contest]) -> Sheet:
    rows: list[dict[str, object]] = []
    for mesh, contest in held.items():
        for per, times in (("integration step", contest.step), ("cycle", contest.cycle)):
            for name in (MODEL, BANDED, SPARSE):
                low, middle, high = np.percentile(contest.ratios(times, name), [10.0, 50.0, 90.0])
                rows.append(
                    {
                        "mesh": mesh,
                        "per": per,
                        "way": name,
                        "us": float(np.median(times[name])) * 1e6,
                        "best_round_us": min(times[name]) * 1e6,
                        "ratio": float(middle),
                        "ratio_p10": float(low),
                        "ratio_p90": float(high),
                    }
                )
    columns = {
        "mesh": "mesh",
        "per": "per",
        "way": "way",
        "us": "us",
        "best_round_us": "best round",
        "ratio": "times the model's",
        "ratio_p10": "10 %",
        "ratio_p90": "90 % of rounds",
    }
    return Sheet("competitors", "against other ways to the same wire: 2 spans", columns, rows)


def _agreement(apart: dict[str, Disagreement], solves: int) -> Sheet:
    rows: list[dict[str, object]] = [
        {"way": name, "difference": found.wire, "slack_equal": found.slack_equal, "most_solves": solves}
        for name, found in apart.items()
    ]
    columns = {"way": "way", "difference": "largest difference of q, q' (relative)", "slack_equal": "same slack state"}
    return Sheet("agreement", f"the same wire? (most solves a step: {solves})", columns, rows)
