"""The model's step against two other ways to the same wire: banded LU and scipy's sparse LU of the coupled matrix.

Same mesh, sites, fading, boundary, integration step and forces; each of the three goes along the same ride, in blocks
that take turns. First they must give the same wire (`disagreement`), or the comparison would be worth nothing.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bench.banded_lu import BandedLU
from bench.sparse_lu import SparseLU
from catenary_model import layout, ride, step
from catenary_model.layout import Constants, State
from catenary_model.model import Catenary, Config
from phil_base.kernels import njit

Array = NDArray[np.float64]

MODEL, BANDED, SPARSE = "this model", "banded LU of the coupled matrix", "scipy's sparse LU (splu)"
PART = {BANDED: 4, SPARSE: 20}
"""The slower ones go along one of so many cycles only."""
COLD = 20
"""Steps before a block that are not counted: the caches still hold what ran before."""


class Way(Protocol):
    """One way to step a catenary."""

    catenary: Catenary

    def step(self, f_cat: float) -> None:
        """Advance one cycle."""

    def steps(self, force: Array) -> None:
        """Integrate a step for every force, without an observation."""


@njit(cache=True, fastmath=False)
def _steps(c: Constants, s: State, force: Array) -> None:
    """Integrate a step for every force (N)."""
    for i in range(force.size):
        s.contact[layout.GIVEN] = force[i]
        step.substep(c, s)
    s.contact[layout.LAST_FORCE] = force[-1]


class Own:
    """The model itself."""

    def __init__(self, config: Config) -> None:
        self.catenary = Catenary(config)
        self.step = self.catenary.step

    def steps(self, force: Array) -> None:
        """Integrate a step for every force (N), without an observation."""
        _steps(self.catenary.constants, self.catenary.state, force)


def comparable(config: Config) -> Config:
    """Return settings that all three know: no local compliance, matched dashpots."""
    return dataclasses.replace(config, local_compliance=False, boundary="matched_dashpot")


def copied(state: State) -> list[NDArray[np.generic]]:
    """Return a copy of all that a step changes."""
    return [array.copy() for array in state]


def put(target: Catenary, source: Iterable[NDArray[np.generic]]) -> None:
    """Put a catenary into the state of another one of the same configuration."""
    for to, array in zip(target.state, source, strict=True):
        to[...] = array


@dataclass(frozen=True)
class Disagreement:
    """How far two ways were apart after the same cycles."""

    wire: float
    """Largest difference of q over the largest q; the same for q'; the larger one, 1."""
    slack_equal: bool
    """Whether the same droppers were slack."""


def disagreement(
    config: Config, warm_up: Array, force: Array, make: Sequence[Callable[[Config], Way]]
) -> tuple[list[Disagreement], int]:
    """Let the model and others go along the same cycles from the same moment of a ride (forces in N).

    Also returns the most solves that a step of the model took, above 1 if a dropper changed its state.
    """
    truth = Catenary(config)
    ride.push(truth, warm_up)
    others = [way(config) for way in make]
    for other in others:
        put(other.catenary, truth.state)
    most = 0
    for value in force:
        truth.step(value)
        most = max(most, truth.iterations)
        for other in others:
            other.step(value)
    found = []
    for other in others:
        apart = [
            float(np.abs(mine - theirs).max() / np.abs(theirs).max())
            for mine, theirs in zip(other.catenary.state.q[:2], truth.state.q[:2], strict=True)
        ]
        same = np.array_equal(other.catenary.state.taut, truth.state.taut)
        found.append(Disagreement(max(apart), same))
    return found, most


@dataclass
class Contest:
    """Times of the three, a list entry a round, s; each is the mean (step) or median (cycle) of its block."""

    step: dict[str, list[float]] = field(default_factory=dict)
    """One integration step within compiled code (scipy's: from Python, there is no other way)."""
    cycle: dict[str, list[float]] = field(default_factory=dict)
    """One cycle called from Python, observation included."""

    def ratios(self, times: dict[str, list[float]], name: str) -> Array:
        """Return how many times as long as the model this one took, round by round."""
        return np.array(times[name]) / np.array(times[MODEL])


class Contestants:
    """The three on one ride: the model goes along all of it, the slower ones from the same moments along parts."""

    def __init__(self, config: Config, warm_up: Array) -> None:
        """Build all three and ride them in with these forces (N)."""
        self.own = Own(config)
        self.others: dict[str, Way] = {BANDED: BandedLU(config), SPARSE: SparseLU(config)}
        names = (MODEL, *self.others)
        self.contest = Contest({name: [] for name in names}, {name: [] for name in names})
        ride.push(self.own.catenary, warm_up)
        begin = copied(self.own.catenary.state)
        for way in (self.own, *self.others.values()):  # compiled before it is timed
            put(way.catenary, begin)
            way.steps(warm_up[-2:])
            way.step(float(warm_up[-1]))

    def round(self, force: Array) -> None:
        """Time each along these cycles: one half by integration steps, the other by cycles."""
        half = force.size // 2
        begin = copied(self.own.catenary.state)
        self._by_steps(MODEL, self.own, force[:half])
        between = copied(self.own.catenary.state)
        self._by_cycles(MODEL, self.own, force[half:])
        for name, way in self.others.items():
            count = max(2, half // PART[name])
            put(way.catenary, begin)
            self._by_steps(name, way, force[:count])
            put(way.catenary, between)
            self._by_cycles(name, way, force[half : half + count])

    def _by_steps(self, name: str, way: Way, force: Array) -> None:
        n, last = way.catenary.config.substeps, float(way.catenary.state.contact[layout.LAST_FORCE])
        every = np.interp(np.arange(1, n * force.size + 1) / n, np.arange(force.size + 1), [last, *force])
        before = copied(way.catenary.state)
        way.steps(every[:COLD])
        put(way.catenary, before)
        begun = time.perf_counter()
        way.steps(every)
        self.contest.step[name].append((time.perf_counter() - begun) / every.size)

    def _by_cycles(self, name: str, way: Way, force: Array) -> None:
        times = []
        for value in force.tolist():
            begun = time.perf_counter()
            way.step(value)
            times.append(time.perf_counter() - begun)
        self.contest.cycle[name].append(float(np.median(times)))
