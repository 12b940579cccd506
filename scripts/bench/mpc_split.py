"""Where the time of a controller's cycle goes: its parts clocked from outside, in a closed loop that rides on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter_ns
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

import impedance_mpc.controller as home
from bench.closed_loop import ClosedLoop

GROUPS: dict[str, tuple[str, str]] = {
    "plan carried on, forecast of the force": ("prepare", "force_ahead"),
    "gradient product, bounds of the rows": ("prepare", "prepare"),
    "bounds of the correction force": ("correction", "bounds"),
}
"""Part to module and function, as the controller calls them; the quadratic program comes on top."""
PROGRAM, BOOKS, REST = "quadratic program", "books", "rest: readings, clipping, answer"
PARTS = (*GROUPS, PROGRAM, BOOKS)


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


@contextmanager
def _clocks(loop: ClosedLoop) -> Iterator[dict[str, list[int]]]:
    """Put clocks around the parts of one controller's cycle; the sums go to the lists, ns."""
    sums: dict[str, list[int]] = {part: [0] for part in PARTS}
    before = {name: getattr(home, name) for name, _ in GROUPS.values()}
    for name, module in before.items():
        assert isinstance(module, ModuleType)
        setattr(home, name, SimpleNamespace(**vars(module)))
    for part, (name, function) in GROUPS.items():
        setattr(getattr(home, name), function, _clocked(getattr(before[name], function), sums[part]))
    controller = loop.controller
    qp, books = controller.qp, controller.books
    qp.solve = _clocked(qp.solve, sums[PROGRAM])  # type: ignore[method-assign]
    for name in ("add", "accumulate"):
        setattr(books, name, _clocked(getattr(books, name), sums[BOOKS]))
    try:
        yield sums
    finally:
        for name, module in before.items():
            setattr(home, name, module)
        del qp.solve
        del books.add, books.accumulate


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


def block(loop: ClosedLoop, split: Split, cycles: int, cold: int) -> None:
    """Ride on for twice these cycles, with and without clocks inside; the first ``cold`` of each are not counted."""
    split.clock = split.clock or _clock_cost()
    for number, (_, spent, _) in enumerate(loop.cycles(cycles)):
        if number >= cold:
            split.whole.append(spent * 1e-3)
    with _clocks(loop) as sums:
        for number, _ in enumerate(loop.cycles(cycles)):
            for part, one in sums.items():
                if number >= cold:
                    split.spent[part].append(one[0] * 1e-3)
                one[0] = 0
