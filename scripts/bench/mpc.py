"""The controller's cycle over horizon, moves and segment, where its time goes, and its solver against others.

A cycle is what the node does between the state's arrival and the command's departure: both states in, command out,
called from Python in a closed loop with the catenary and the rig, which use the caches in between. The cases take turns
in short blocks, so that whatever else the machine does meets all of them. The solvers are handed the very sequences of
problems that came up in such rides.
"""

from __future__ import annotations

import os

import numpy as np
from numpy.typing import NDArray

from bench import mpc_picture, mpc_tables
from bench.mpc_contest import Entry, certificate, contest
from bench.mpc_problems import GOOD, Sequence
from bench.mpc_record import controller_of, record
from bench.mpc_solvers import CONTROLLER, SOLVERS, version
from bench.mpc_split import Splitting
from bench.turns import first
from phil_loop import ClosedLoop, resolve
from phil_loop.resolution import Settings
from phil_study.distribution import distribution
from phil_study.outcome import Outcome, Sheet

Array = NDArray[np.float64]
Case = tuple[float, int, int]
"""Length of the segment in m, Np, Nc."""

CASES: tuple[Case, ...] = (
    (40.0, 30, 20),
    (20.0, 30, 20),
    (30.0, 30, 20),
    (60.0, 30, 20),
    (40.0, 10, 5),
    (40.0, 10, 10),
    (40.0, 30, 10),
    (40.0, 50, 20),
    (40.0, 50, 30),
)
"""The first is the one with the goal."""
MEDIAN_GOAL, TAIL_GOAL = 0.09, 0.25
"""ms, of the first case."""
THESIS_CONTROLLER_MS = 1.77
"""Turnaround time of Table 3.2."""
WARM_UP = 600
"""Cycles before anything is timed: the drive has come to the wire's height."""
COLD = 20
"""Cycles at the beginning of a block that are not counted: the caches still hold the case before."""
LIMITS = {"approach_time": 0.02, "acceleration_limit": 15.0, "velocity_limit": 0.3}
"""A ride that runs into the drive's limits: the gap at the start is closed at once, and there is little current."""
RIDE, AT_LIMITS = "ride", "limits"
REFERENCE_EVERY = 10
"""Of the reference solutions, every so manieth is checked by its conditions of optimality."""
EXACT = 1e-6
"""mm, N: by how much the reference may be off, in its bounds or from the solution."""


def settings(case: Case, **changes: float) -> Settings:
    """Give the parameters of a ride with this case."""
    length, horizon, moves = case
    return resolve(
        None,
        {
            "catenary_model": {"segment_half_length": 0.5 * length},
            "impedance_mpc": {"prediction_horizon": horizon, "control_horizon": moves, **changes},
        },
    )


class Riding:
    """One case on its ride; every block goes on where the last one ended."""

    def __init__(self, case: Case, warm_up: int) -> None:
        self.ride = ClosedLoop(settings(case), limits=False).begin(0.0, timed=True)
        self.ride.run(warm_up)
        self.blocks: list[Array] = []

    def block(self, cycles: int) -> None:
        """Time these cycles but for the first ones."""
        self.ride.run(cycles)
        times = self.ride.record().times
        assert times is not None
        self.blocks.append(times.controller[COLD - cycles :].copy())

    @property
    def times(self) -> Array:
        """All times, s."""
        return np.concatenate(self.blocks)

    @property
    def best(self) -> Array:
        """Times of the block with the smallest median, s."""
        return min(self.blocks, key=lambda times: float(np.median(times)))


def recorded(cycles: int) -> dict[str, Sequence]:
    """Record both sequences: an ordinary ride from its start on, and one at the drive's limits."""
    sequences = {
        RIDE: record(ClosedLoop(settings(CASES[0]), limits=False), cycles),
        AT_LIMITS: record(ClosedLoop(settings(CASES[0], **LIMITS), limits=False), cycles),
    }
    one, other = sequences.values()
    if not (np.array_equal(one.hessian, other.hessian) and np.array_equal(one.rows, other.rows)):
        raise RuntimeError("the limits changed more than the bounds of the program")
    return sequences


def run(quick: bool) -> Outcome:
    """Measure everything."""
    rounds, block = (2, 80) if quick else (20, 500)
    load_before = os.getloadavg()[0]
    cases = {case: Riding(case, 50 if quick else WARM_UP) for case in CASES}
    splitting = Splitting(settings(CASES[0]), 50 if quick else WARM_UP)
    granted = True
    for number in range(rounds):
        turn = list(cases.values())
        for riding in turn[number % len(turn) :] + turn[: number % len(turn)]:  # none is always first
            with first() as got:
                riding.block(block)
            granted = granted and got
        with first():
            splitting.block(block // 2, COLD)

    sequences = recorded(150 if quick else 3000)
    present = [name for name in SOLVERS if version(name) is not None]
    entries, failed = contest(present, sequences, 2 if quick else 6)
    checked = _checked(sequences, entries)

    samples = {_name(case): riding.times for case, riding in cases.items()}
    wanted, thesis = (MEDIAN_GOAL, "median", "goal"), (THESIS_CONTROLLER_MS, "median", "Table 3.2")
    goals = [wanted, *[thesis] * (len(cases) - 1)]
    rows = [distribution(name, times, *goal) for (name, times), goal in zip(samples.items(), goals, strict=True)]
    over = _over(cases)
    notes = [
        f"SCHED_FIFO as the nodes have it: {'granted' if granted else 'not granted'}; load average (1 min) "
        f"{load_before:.2f} before, {os.getloadavg()[0]:.2f} after, on {os.cpu_count()} processors; {rounds} rounds.",
        f"Parts: clocked one by one in the same ride, half the {splitting.split.clock * 1e3:.0f} ns of a clock taken "
        "off; the whole is measured in turns without clocks inside, the rest is what the parts leave of it.",
        f"Problems: {sequences[RIDE].count} of each ride, {sequences[RIDE].rows.shape[1]} variables with bounds, "
        f"{sequences[RIDE].rows.shape[0]} two-sided rows. Each solver in a process of its own, through its own Python "
        "interface, with all that it can keep from one problem to the next; its time is from the vectors in to the "
        "solution out. Solvers that have no soft rows get a variable for each. Solved is what fulfils the conditions "
        f"of optimality to {GOOD:g} mm and N, computed here alike for all, whatever the solver says.",
        "First: with the set-up of the solver. Ratio: to the controller's, round by round. Largest differences from "
        "the controller's solutions in the first move, and in the cost (relative). Bits: the same in all rounds, "
        "and in a second process with its heap and all data placed otherwise.",
        *checked,
        *_absent(failed),
    ]
    sheets = [
        _goals(cases[CASES[0]]),
        over,
        mpc_tables.parts(splitting.split, _name(CASES[0])),
        *(mpc_tables.solvers(key, f"solvers on {TITLES[key]}", found) for key, found in entries.items()),
        *(mpc_tables.agreement(key, f"solutions on {TITLES[key]}", sequences[key], entries[key]) for key in sequences),
        mpc_tables.kinds(),
    ]
    pictures = {
        "histogram": mpc_picture.histogram(cases[CASES[0]].times, _name(CASES[0])),
        "cases": mpc_picture.cases(over.rows),
        "solvers": mpc_picture.solvers({TITLES[key]: found for key, found in entries.items()}),
    }
    title = "impedance controller: one cycle, states in to command out"
    return Outcome(title, rows, notes, sheets=sheets, samples=samples, pictures=pictures)


TITLES = {RIDE: "an ordinary ride from its start", AT_LIMITS: "a ride at the drive's limits"}


def _name(case: Case) -> str:
    return f"segment {case[0]:g} m, Np {case[1]}, Nc {case[2]}"


def _goals(riding: Riding) -> Sheet:
    rows: list[dict[str, object]] = []
    for name, percentile, goal in (("median", 50.0, MEDIAN_GOAL), ("p99", 99.0, TAIL_GOAL)):
        value = float(np.percentile(riding.times, percentile)) * 1e3
        best = float(np.percentile(riding.best, percentile)) * 1e3
        rows.append(
            {
                "name": f"{name}, {_name(CASES[0])}",
                "value_ms": value,
                "best_round_ms": best,
                "at_most_ms": goal,
                "holds": value <= goal,
            }
        )
    columns = {
        "name": "goal",
        "value_ms": "all rounds, ms",
        "best_round_ms": "best round, ms",
        "at_most_ms": "at most, ms",
        "holds": "verdict",
    }
    return Sheet("goals", "goals", columns, rows)


def _over(cases: dict[Case, Riding]) -> Sheet:
    rows: list[dict[str, object]] = []
    for (length, horizon, moves), riding in cases.items():
        times, controller = riding.times * 1e3, controller_of(riding.ride.loop)
        rows.append(
            {
                "segment_m": length,
                "horizon": horizon,
                "moves": moves,
                "states": 3 * controller.model.n + 2,
                "rows": int(controller.qp.rows.shape[0]),
                "median_ms": float(np.median(times)),
                "best_round_ms": float(np.median(riding.best)) * 1e3,
                "p99_ms": float(np.percentile(times, 99.0)),
                "best_p99_ms": float(np.percentile(riding.best, 99.0)) * 1e3,
                "max_ms": float(times.max()),
                "fallbacks": controller.result.fallbacks,
            }
        )
    columns = {
        "segment_m": "segment, m",
        "horizon": "Np",
        "moves": "Nc",
        "states": "states",
        "rows": "rows",
        "median_ms": "median ms",
        "best_round_ms": "best round's",
        "p99_ms": "p99 ms",
        "best_p99_ms": "best round's",
        "max_ms": "max ms",
        "fallbacks": "fallbacks",
    }
    return Sheet("cases", "over segment, horizon and moves", columns, rows)


def _checked(sequences: dict[str, Sequence], entries: dict[str, dict[str, Entry]]) -> list[str]:
    """Check the reference, the controller's solutions, by the conditions of optimality; say how good it is."""
    said = []
    for key, sequence in sequences.items():
        entry = entries[key].get(CONTROLLER)
        if entry is None or entry.failures:
            raise RuntimeError(f"the controller's solver did not solve all problems of '{TITLES[key]}'")
        beyond, away = certificate(sequence, entry.solutions, REFERENCE_EVERY)
        if not (beyond < EXACT and away < EXACT):
            raise RuntimeError(f"reference of '{TITLES[key]}': {beyond:.1e} beyond a bound, {away:.1e} off (mm, N)")
        said.append(
            f"Reference of '{TITLES[key]}': the controller's solutions; by the conditions of optimality alone they are "
            f"beyond a bound by {beyond:.0e} and off by {away:.0e} (mm, N) at most."
        )
    return said


def _absent(failed: dict[str, str]) -> list[str]:
    said = [f"{name} took no part: {reason}" for name, reason in failed.items()]
    missing = [name for name in SOLVERS if version(name) is None]
    if missing:
        said.append(
            f"Not installed: {', '.join(missing)}. Type: python -m pip install --group bench (in the repository, with "
            "its virtual environment activated)"
        )
    return said
