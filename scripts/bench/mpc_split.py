"""Where the time of a controller's cycle goes: its parts with clocks in them, beside the same ride without."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import perf_counter_ns
from typing import Any

import numpy as np

from impedance_mpc.books import Books
from impedance_mpc.parts import PARTS as PLAIN
from impedance_mpc.parts import Parts
from impedance_mpc.plant import Array
from impedance_mpc.solver import Solver
from phil_loop import ClosedLoop, Moment

FORECAST, GRADIENT = "plan carried on, forecast of the force", "gradient product, bounds of the rows"
BOUNDS, PROGRAM, BOOKS = "bounds of the correction force", "quadratic program", "books"
REST = "rest: readings, clipping, answer"
PARTS = (FORECAST, GRADIENT, BOUNDS, PROGRAM, BOOKS)


@dataclass
class Split:
    """Times by part in us, an entry a cycle, with the clock's own cost; ``whole`` without any clocks inside."""

    spent: dict[str, list[float]] = field(default_factory=lambda: {part: [] for part in PARTS})
    whole: list[float] = field(default_factory=list)
    clock: float = 0.0
    """What a clocked call costs more than a plain one, us; about half of it is within the measured time."""


def _clocked(function: Callable[..., Any], into: list[int]) -> Callable[..., Any]:
    def call(*given: Any, **named: Any) -> Any:
        begun = perf_counter_ns()
        got = function(*given, **named)
        into[0] += perf_counter_ns() - begun
        return got

    return call


class TimedSolver:
    """A solver with a clock in it."""

    def __init__(self, solver: Solver, into: list[int]) -> None:
        """Add the time of each call, ns, to the number in ``into``."""
        self._solver = solver
        self.hessian, self.rows, self.softness = solver.hessian, solver.rows, solver.softness
        self.tolerance, self.max_iterations = solver.tolerance, solver.max_iterations
        self.z = solver.z
        self.iterations = 0
        self._into = into

    def reset(self) -> None:
        """Forget all earlier solutions."""
        self._solver.reset()
        self.iterations = 0

    def solve(self, g: Array, lower: Array, upper: Array, box_lower: Array, box_upper: Array) -> int:
        """Solve, and take the time."""
        begun = perf_counter_ns()
        status = self._solver.solve(g, lower, upper, box_lower, box_upper)
        self._into[0] += perf_counter_ns() - begun
        self.iterations, self.z = self._solver.iterations, self._solver.z
        return status


def timed_solver(into: list[int]) -> Callable[..., Solver]:
    """Give a maker of solvers that add their time, ns, to the number in ``into``; for `Parts.solver`."""

    def make(*given: Any) -> Solver:
        return TimedSolver(PLAIN.solver(*given), into)

    return make


class _TimedBooks(Books):
    """Books with a clock in them; ``into`` is set after construction, as a cleared book is made anew."""

    into: list[int]

    def add(self, f_tr: float, v_tr: float, f_cat: float, v_cat: float) -> None:
        begun = perf_counter_ns()
        super().add(f_tr, v_tr, f_cat, v_cat)
        self.into[0] += perf_counter_ns() - begun

    def accumulate(
        self, work_tr: float, work_cat: float, impulse_tr: float, impulse_cat: float, counted: bool = True
    ) -> None:
        begun = perf_counter_ns()
        super().accumulate(work_tr, work_cat, impulse_tr, impulse_cat, counted)
        self.into[0] += perf_counter_ns() - begun


def clocked(sums: Mapping[str, list[int]]) -> Parts:
    """Give a controller's parts that add their times, ns, to the sums."""

    def books(ts: float) -> Books:
        made = _TimedBooks(ts)
        made.into = sums[BOOKS]
        return made

    return Parts(
        timed_solver(sums[PROGRAM]),
        books,
        _clocked(PLAIN.force_ahead, sums[FORECAST]),
        _clocked(PLAIN.prepare, sums[GRADIENT]),
        _clocked(PLAIN.bounds, sums[BOUNDS]),
    )


def _clock_cost() -> float:
    """Measure what a clocked call costs more than a plain one, us."""

    def nothing() -> None:
        pass

    clocked = _clocked(nothing, [0])
    found = []
    for _ in range(7):
        begun = perf_counter_ns()
        for _ in range(1000):
            nothing()
        middle = perf_counter_ns()
        for _ in range(1000):
            clocked()
        found.append((perf_counter_ns() - middle) - (middle - begun))
    return float(np.median(found)) * 1e-6


class Splitting:
    """The same ride twice, with clocks in the controller's parts and without; each block goes on where one ended."""

    def __init__(self, settings: Mapping[str, Mapping[str, Any]], warm_up: int) -> None:
        self.split = Split(clock=_clock_cost())
        self._sums: dict[str, list[int]] = {part: [0] for part in PARTS}
        self._cold = 0
        self.plain = ClosedLoop(settings, limits=False)
        self.inside = ClosedLoop(settings, observers=[self._note], limits=False, parts=clocked(self._sums))
        self._rides = self.plain.begin(0.0, timed=True), self.inside.begin(0.0)
        self._cold = warm_up
        for ride in self._rides:
            ride.run(warm_up)

    def _note(self, moment: Moment) -> None:
        for part, one in self._sums.items():
            if moment.cycle >= self._cold:
                self.split.spent[part].append(one[0] * 1e-3)
            one[0] = 0

    def block(self, cycles: int, cold: int) -> None:
        """Ride on for these cycles with and without clocks; the first ``cold`` of each are not counted."""
        plain, inside = self._rides
        self._cold = inside.cycle + cold
        plain.run(cycles)
        times = plain.record().times
        assert times is not None
        self.split.whole += (1e6 * times.controller[-(cycles - cold) :]).tolist()
        inside.run(cycles)
