"""Where the time of the catenary's step goes: the phases of `catenary_model.step`, one after the other, with a clock.

The same calls in the same sequence as in `step.advance` (a test holds both to the same bits), compiled into one loop
over a ride, with the system's clock read after every call. So each phase meets the caches, the branch predictor and
the slack states of a real ride. The cost of reading the clock is measured and taken off. The whole, timed in the same
rounds without the clocks, differs from the sum: between the phases the compiler may not move anything across a clock,
the clock itself waits for what is under way, and the processor otherwise overlaps the end of one phase with the
beginning of the next.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numba import types
from numpy.typing import NDArray

from catenary_model import cycle, layout, ride, sites, step, wires
from catenary_model.layout import Constants, State
from catenary_model.model import Catenary, Config
from phil_base.kernels import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

PHASES = (
    "sites: list and place",
    "boundary: command",
    "predictors",
    "right side",
    "boundary: drive",
    "wires' solve, first",
    "compliances",
    "slack iteration",
    "forces onto the right side",
    "wires' solve, second",
    "correctors",
    "masses",
    "observation",
)
GROUPS = {
    "assembly (sites, compliances)": (0, 6),
    "wires' right side (predictors, K q + D q', site forces)": (2, 3, 8),
    "solve (twice)": (5, 9),
    "slack iteration": (7,),
    "boundary": (1, 4),
    "correctors": (10, 11),
    "observation (once a cycle)": (12,),
}
"""Phases under the names of the table."""

_clock = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.uintp))
_MONOTONIC = int(time.CLOCK_MONOTONIC)


@njit(cache=True)
def _stamp(now: Ints) -> int:
    """Read the monotonic clock, ns; `now` (2,) is a timespec."""
    _clock(_MONOTONIC, now.ctypes.data)
    return now[0] * 1_000_000_000 + now[1]


@njit(cache=True)
def _lap(now: Ints, spent: Ints, phase: int, before: int) -> int:
    """Charge the time since `before` (ns) to a phase and return the present time."""
    after = _stamp(now)
    spent[phase] += after - before
    return after


@njit(cache=True)
def _substep(c: Constants, s: State, now: Ints, spent: Ints) -> None:
    """Do what `step.substep` does, with a clock after every call."""
    ts, beta, gamma = c.real.ts, c.real.beta, c.real.gamma
    t = _stamp(now)
    s.counter[layout.STEPS] += 1
    sites.collect(c, s, cycle.track_position(c, s))
    t = _lap(now, spent, 0, t)
    step.command_layers(c.gain, s.q, s.layer)
    t = _lap(now, spent, 1, t)
    wires.predict(s.q, ts, beta, gamma)
    t = _lap(now, spent, 2, t)
    wires.load(c.inner, c.outer, s.q, s.rhs)
    t = _lap(now, spent, 3, t)
    step.drive_layers(s.layer, c.pivot, s.rhs)
    t = _lap(now, spent, 4, t)
    wires.solve(c.sweep, c.middle, s.rhs, s.q[2])
    t = _lap(now, spent, 5, t)
    sites.compliances(c, s)
    t = _lap(now, spent, 6, t)
    sites.settle(c, s)
    t = _lap(now, spent, 7, t)
    sites.press(c.pivot, s)
    t = _lap(now, spent, 8, t)
    wires.solve(c.sweep, c.middle, s.rhs, s.q[2])
    t = _lap(now, spent, 9, t)
    wires.correct(s.q, ts, beta, gamma)
    t = _lap(now, spent, 10, t)
    sites.move_masses(c, s)
    _lap(now, spent, 11, t)


@njit(cache=True)
def _staged(c: Constants, s: State, force: Array, now: Ints, spent: Ints) -> None:
    """Go on a cycle for every force (N) as `step.advance` does; add each cycle's times (ns) to a row of `spent`."""
    n = c.whole.substeps
    for k in range(force.size):
        f_cat, before = force[k], s.contact[layout.LAST_FORCE]
        s.counter[layout.ITERATIONS] = 0
        given, w = before, s.point[layout.W_CAT]
        for j in range(n):
            old, given = given, before + (f_cat - before) * ((j + 1) / n)
            s.contact[layout.GIVEN] = given
            _substep(c, s, now, spent[k])
            t = _stamp(now)
            w = cycle.book(c, s, old, given, w, step.height(c, s, given))
            _lap(now, spent[k], len(PHASES) - 1, t)
        s.contact[layout.LAST_FORCE] = f_cat
        t = _stamp(now)
        step.observe(c, s, f_cat)
        _lap(now, spent[k], len(PHASES) - 1, t)


@njit(cache=True)
def _whole(c: Constants, s: State, force: Array, now: Ints, spent: Ints) -> None:
    """Go on a cycle for every force (N); write the time (ns) of each, without a clock inside."""
    before = _stamp(now)
    for k in range(force.size):
        step.advance(c, s, force[k])
        after = _stamp(now)
        spent[k] = after - before
        before = after


@njit(cache=True)
def _empty(count: int, now: Ints, spent: Ints) -> None:
    """Read the clock as often as that, with nothing in between."""
    t = _stamp(now)
    for _ in range(count):
        t = _lap(now, spent, 0, t)


def stages(catenary: Catenary, force: Array) -> Array:
    """Go on a cycle for every force (N); return the time of each phase in each cycle, s, (cycles, phases)."""
    now, spent = np.zeros(2, np.int64), np.zeros((force.size, len(PHASES)), np.int64)
    _staged(catenary.constants, catenary.state, force, now, spent)
    return np.asarray(spent * 1e-9, dtype=np.float64)


def same_bits(config: Config, force: Array) -> bool:
    """Tell whether the phases do what the model's step does with these forces (N), to the last bit.

    They would not if the sequence had changed there, or if compiled code on disk were older than the model's.
    """
    whole, staged = Catenary(config), Catenary(config)
    for value in force:
        whole.step(value)
    stages(staged, force)
    return all(np.array_equal(one, other) for one, other in zip(whole.state, staged.state, strict=True))


def clock_cost(count: int = 20_000) -> float:
    """Return what one reading of the clock adds to a phase, s."""
    now, spent = np.zeros(2, np.int64), np.zeros(len(PHASES), np.int64)
    _empty(count, now, spent)
    spent[:] = 0
    _empty(count, now, spent)
    return float(spent[0]) * 1e-9 / count


@dataclass(frozen=True)
class Share:
    """Times of the phases of one cycle, medians over the cycles, s."""

    boundary: str
    """Kind of the ends."""
    phase: Array
    """One time for each of `PHASES`, the clock's own taken off."""
    whole: float
    """A cycle in a compiled loop without clocks inside."""
    clock: float
    """Cost of one reading of the clock."""

    def group(self, name: str) -> float:
        """Time of the phases of `GROUPS` under this name, s."""
        return float(self.phase[list(GROUPS[name])].sum())


class Shares:
    """One kind of boundary on its ride, measured in rounds; the ride goes on from round to round."""

    def __init__(self, config: Config, warm_up: Array) -> None:
        """Build the model and ride it in. Raises ValueError for a boundary that cannot be built."""
        self.catenary = Catenary(config)
        ride.push(self.catenary, warm_up)
        self._parts: list[Array] = []
        self._whole: list[Array] = []
        self._clock: list[float] = []

    def round(self, force: Array) -> None:
        """Ride on, half of the cycles with clocks between the phases, half without."""
        half = force.size // 2
        self._clock.append(clock_cost())
        self._parts.append(stages(self.catenary, force[:half]))
        now, spent = np.zeros(2, np.int64), np.zeros(force.size - half, np.int64)
        _whole(self.catenary.constants, self.catenary.state, force[half:], now, spent)
        self._whole.append(np.asarray(spent * 1e-9, dtype=np.float64))

    def share(self) -> Share:
        """Summarise all rounds."""
        clock, config = float(np.median(self._clock)), self.catenary.config
        readings = np.full(len(PHASES), float(config.substeps))
        readings[-1] += 1.0
        phase = np.median(np.concatenate(self._parts), axis=0) - readings * clock
        whole = float(np.median(np.concatenate(self._whole))) - clock
        return Share(config.boundary, np.maximum(phase, 0.0), whole, clock)
