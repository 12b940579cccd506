"""Design of stable absorbing boundaries: a sweep of least-squares problems, judged by reflection and eigenvalues."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catenary_model.absorbing import stability
from catenary_model.absorbing.boundary import BoundaryStencil, clamped, read_file, write_file
from catenary_model.absorbing.judge import judge
from catenary_model.absorbing.least_squares import iterates, passes_constant
from catenary_model.absorbing.stencil import Stencil
from catenary_model.absorbing.weighting import Weighting

Progress = Callable[[int, int, str], None]
"""Called with work done, work in all, and what was just found."""


class Sweep(NamedTuple):
    """What the least-squares problems vary, to find one whose solution is stable."""

    tikhonov: tuple[float, ...] = (1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1)
    outside: tuple[float, ...] = (1e-3, 1e-2, 1e-1)
    """Least weights outside the band, in place of smaller ones of the weighting."""
    leak: tuple[float, ...] = (1e-7, 1e-6, 1e-5, 1e-4)
    """Share of a constant displacement that a boundary node forgets a step; 0 keeps it and an eigenvalue at 1."""
    iterations: int = 5


class Demands(NamedTuple):
    """What a design must fulfil."""

    margin: float = 1e-7
    """Spectral radius at most 1 - margin in all closed domains."""
    gain: float = 1.0 + 1e-6
    """Largest reflected amplitude at any frequency: at most 1 keeps it stable with whatever else reflects inside."""
    nodes: tuple[int, ...] = (12, 25, 38, 61)
    """Sizes of the closed domains."""


SWEEP, DEMANDS = Sweep(), Demands()


class Candidate(NamedTuple):
    """A boundary with its figures.

    Attributes:
        boundary: its coefficients.
        reflection: largest weighted |R| in the band, or of the local field of evanescent waves times `EVANESCENT`.
        gain: largest |R| at any frequency, N_x nodes away from the boundary.
        tikhonov: of the problem that it solves.
        outside: as in `Sweep`.
        leak: as in `Sweep`.
        iteration: 0 is the one-step solution.
    """

    boundary: BoundaryStencil
    reflection: float
    gain: float
    tikhonov: float
    outside: float
    leak: float
    iteration: int


@dataclass(frozen=True, eq=False)
class Design:
    """A boundary that fulfils its demands.

    Attributes:
        stencil: of the interior.
        boundary: the absorbing one.
        weighting: that it was designed for.
        reflection: largest weighted reflected amplitude in the band, evanescent waves included with less weight.
        gain: largest reflected amplitude at any frequency.
        radius: largest spectral radius of the closed domains that were checked.
        origin: how it was found.
    """

    stencil: Stencil
    boundary: BoundaryStencil
    weighting: Weighting
    reflection: float
    gain: float
    radius: float
    origin: tuple[tuple[str, float], ...]

    def write(self, path: Path, **info: Any) -> None:
        """Write the coefficients with the PDE, the grid, the weighting and what was reached."""
        reached = {"reflection": self.reflection, "gain": self.gain, "radius": self.radius}
        table = {"band": self.weighting.band, "f": self.weighting.frequencies, "weights": self.weighting.weights}
        told = {"weighting": table, "origin": dict(self.origin), **info}
        write_file(path, self.stencil, self.boundary, **reached, **told)


def read_design(path: Path) -> Design:
    """Read what `Design.write` wrote.

    Raises:
        ValueError: the file holds no design.
    """
    stencil, boundaries, info = read_file(path)
    try:
        table = info["weighting"]
        weighting = Weighting(tuple(table["f"]), tuple(table["weights"]), (table["band"][0], table["band"][1]))
        reflected, gain, radius = (float(info[name]) for name in ("reflection", "gain", "radius"))
        return Design(stencil, boundaries[0], weighting, reflected, gain, radius, tuple(info["origin"].items()))
    except (KeyError, IndexError, TypeError, AttributeError) as error:
        raise ValueError(f"{path} holds boundaries but no design: {error}") from error


def candidates(
    stencil: Stencil, side: str, n_x: int, n_t: int, weighting: Weighting, sweep: Sweep = SWEEP
) -> Iterator[Candidate]:
    """Yield the solutions of all least-squares problems of a sweep with their figures; stability is not looked at.

    Args:
        stencil: of the interior, one space dimension.
        side: "left" or "right".
        n_x: nodes that every boundary node's update reads.
        n_t: old time levels that it reads.
        weighting: over frequency.
        sweep: what is varied.

    Raises:
        ValueError: sizes below 1, or as `judge`.
    """
    nodes = stencil.nodes_at(side)
    if nodes == 0:
        raise ValueError(f"{stencil.name} reads no node to the {side}: there is nothing to be designed")
    if n_x < nodes or n_t < 1:
        raise ValueError(f"a boundary of {nodes} nodes needs N_x >= {nodes} and N_t >= 1, not {n_x} and {n_t}")
    bench = judge(stencil, weighting, side)
    shape = (nodes, 1 + n_t, n_x)
    leaks = sweep.leak if passes_constant(stencil) else (0.0,)
    for outside, tikhonov, leak in product(sweep.outside, sweep.tikhonov, leaks):
        static = 1.0 - leak if passes_constant(stencil) else None
        weights = np.maximum(bench.weights, outside)
        found = iterates(bench.modes, shape, side, weights, tikhonov, static, sweep.iterations)
        for iteration, boundary in enumerate(found):
            reflected, gain = bench.figures(boundary)
            if np.isfinite(reflected):
                yield Candidate(boundary, reflected, gain, tikhonov, outside, leak, iteration)


def is_symmetric(stencil: Stencil) -> bool:
    """Whether left and right are the same for the PDE, so that one design serves both sides."""
    other = stencil.mirrored()
    return np.array_equal(other.offsets, stencil.offsets) and np.allclose(
        other.coefficients, stencil.coefficients, rtol=1e-12, atol=0.0
    )


def worst_radius(
    stencil: Stencil,
    left: BoundaryStencil | None,
    right: BoundaryStencil | None,
    sizes: Sequence[int],
    stop_above: float = np.inf,
) -> float:
    """Largest spectral radius over closed domains of several sizes; stops early above a limit.

    Sizes that the boundaries do not fit into are replaced by the smallest one that they do.
    """
    ends = (left or clamped(stencil, "left"), right or clamped(stencil, "right"))
    worst = 0.0
    for nodes in sizes:
        worst = max(worst, stability.radius(stencil, *ends, max(nodes, stability.smallest(*ends))))
        if worst > stop_above:
            break
    return worst


def design(
    stencil: Stencil,
    side: str = "left",
    n_x: int = 4,
    n_t: int = 3,
    weighting: Weighting | None = None,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    opposite: BoundaryStencil | None = None,
    progress: Progress | None = None,
) -> Design:
    """Find the absorbing boundary with the least reflection among those that fulfil the demands.

    The closed domains are: this boundary against a clamped end, against its own mirror image where the PDE is
    symmetric, and against `opposite` if it is given.

    Args:
        stencil: of the interior, one space dimension.
        side: "left" or "right".
        n_x: nodes that every boundary node's update reads.
        n_t: old time levels that it reads.
        weighting: over frequency; weight 1 from 1/500 to 1/8 of half the rate of the steps if not given.
        demands: on stability.
        sweep: of the least-squares problems.
        opposite: boundary of the other side, if one is known already.
        progress: called while the work goes on.

    Raises:
        ValueError: nothing fulfils the demands, or as `candidates`.
    """
    weighting = weighting or default_weighting(stencil)
    found = sorted(candidates(stencil, side, n_x, n_t, weighting, sweep), key=lambda c: c.reflection)
    for done, candidate in enumerate(found):
        worst = closed_radius(stencil, candidate, demands, opposite)
        if progress:
            progress(done + 1, len(found), f"|R| {candidate.reflection:.2e}, radius - 1 {worst - 1.0:.1e}")
        if worst <= 1.0 - demands.margin:
            return as_design(stencil, candidate, weighting, worst)
    raise ValueError(
        f"none of {len(found)} least-squares solutions of N_x = {n_x}, N_t = {n_t} is stable with margin "
        f"{demands.margin:g} and gain {demands.gain:g}: try another size, more regularisation, or smaller demands"
    )


def design_pair(
    stencil: Stencil,
    n_x: int = 4,
    n_t: int = 3,
    weighting: Weighting | None = None,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    tries: int = 40,
) -> tuple[Design, Design]:
    """Find a left and a right boundary that are stable together, for a PDE with different waves to both sides.

    Args:
        stencil: of the interior, one space dimension.
        n_x: nodes that every boundary node's update reads.
        n_t: old time levels that it reads.
        weighting: over frequency, for both sides.
        demands: on stability.
        sweep: of the least-squares problems.
        tries: best candidates of each side that are combined.

    Raises:
        ValueError: no pair fulfils the demands, or as `candidates`.
    """
    weighting = weighting or default_weighting(stencil)
    sides: list[list[Candidate]] = []
    for side in ("left", "right"):
        found = sorted(candidates(stencil, side, n_x, n_t, weighting, sweep), key=lambda c: c.reflection)
        alone: list[Candidate] = []
        for candidate in found:
            if len(alone) < tries and closed_radius(stencil, candidate, demands, None) <= 1.0 - demands.margin:
                alone.append(candidate)
        if not alone:
            raise ValueError(f"no boundary of N_x = {n_x}, N_t = {n_t} is stable at the {side} end alone")
        sides.append(alone)
    limit = 1.0 - demands.margin
    for left, right in sorted(product(*sides), key=lambda pair: max(c.reflection for c in pair)):
        worst = worst_radius(stencil, left.boundary, right.boundary, demands.nodes, limit)
        if worst <= limit:
            return as_design(stencil, left, weighting, worst), as_design(stencil, right, weighting, worst)
    raise ValueError(f"no pair among the best {tries} boundaries of each side is stable together")


def closed_radius(stencil: Stencil, candidate: Candidate, demands: Demands, opposite: BoundaryStencil | None) -> float:
    """Largest spectral radius of a candidate in its closed domains (see `design`); infinite where its gain is too high.

    The value is a lower bound as soon as one domain breaks the demand.
    """
    if candidate.gain > demands.gain:
        return np.inf
    limit, worst = 1.0 - demands.margin, 0.0
    for left, right in closings(stencil, candidate.boundary, opposite):
        worst = max(worst, worst_radius(stencil, left, right, demands.nodes, limit))
        if worst > limit:
            break
    return worst


def closings(
    stencil: Stencil, boundary: BoundaryStencil, opposite: BoundaryStencil | None = None
) -> list[tuple[BoundaryStencil, BoundaryStencil]]:
    """List the closed domains of `design` as pairs (left, right)."""
    others = [clamped(stencil, "right" if boundary.side == "left" else "left")]
    if is_symmetric(stencil):
        others.append(boundary.mirrored())
    if opposite is not None:
        others.append(opposite)
    return [(boundary, other) if boundary.side == "left" else (other, boundary) for other in others]


def default_weighting(stencil: Stencil) -> Weighting:
    """Weight 1 from 1/500 to 1/8 of half the rate of the steps, where a second-order scheme is accurate."""
    nyquist = 0.5 / stencil.dt
    low, high = nyquist / 500.0, nyquist / 8.0
    return Weighting((0.8 * low, low, high, 1.25 * high), (1e-3, 1.0, 1.0, 1e-3), (low, high))


def as_design(stencil: Stencil, candidate: Candidate, weighting: Weighting, worst: float) -> Design:
    """Attach a verdict on stability to a candidate."""
    origin = {name: float(getattr(candidate, name)) for name in ("tikhonov", "outside", "leak", "iteration")}
    return Design(
        stencil,
        candidate.boundary,
        weighting,
        candidate.reflection,
        candidate.gain,
        worst,
        tuple(origin.items()),
    )
