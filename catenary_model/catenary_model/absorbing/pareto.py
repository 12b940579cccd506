"""Pareto fronts of boundary designs: performance against stability, and against the size of the stencil."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from catenary_model.absorbing.boundary import BoundaryStencil, unknowns, write_file
from catenary_model.absorbing.design import (
    DEMANDS,
    SWEEP,
    Demands,
    Design,
    Progress,
    Sweep,
    as_design,
    candidates,
    closed_radius,
    design,
)
from catenary_model.absorbing.refine import Settings, refine
from catenary_model.absorbing.stencil import Array, Stencil
from catenary_model.absorbing.weighting import Weighting


class Point(NamedTuple):
    """One design on the plane of a front.

    Attributes:
        boundary: its coefficients.
        reflection: largest weighted |R| in the band.
        radius: largest spectral radius of its closed domains.
        gain: largest |R| at any frequency.
        size: number of coefficients.
    """

    boundary: BoundaryStencil
    reflection: float
    radius: float
    gain: float
    size: int

    @staticmethod
    def of(found: Design) -> Point:
        """Take the figures of a design."""
        size = int(unknowns(found.boundary.coefficients.shape).sum())
        return Point(found.boundary, found.reflection, found.radius, found.gain, size)


def nondominated(costs: Array) -> npt.NDArray[np.bool_]:
    """Mark the rows that no other row beats in one column without losing in another.

    Args:
        costs: all to be small, shape (points, objectives). Of equal rows, all are marked.
    """
    c = np.asarray(costs, float)
    no_worse = np.all(c[:, None, :] <= c[None, :, :], axis=2)
    better = np.any(c[:, None, :] < c[None, :, :], axis=2)
    return ~np.any(no_worse & better, axis=0)


def stability_points(
    stencil: Stencil,
    side: str,
    n_x: int,
    n_t: int,
    weighting: Weighting,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    progress: Progress | None = None,
) -> list[Point]:
    """Judge all least-squares solutions of one size, the unstable ones too; arguments as for `design`."""
    found = list(candidates(stencil, side, n_x, n_t, weighting, sweep))
    # Every candidate gets a number: no limit, so that no domain is left out.
    unlimited = Demands(-np.inf, np.inf, demands.nodes[:1])
    points = []
    for done, candidate in enumerate(found):
        worst = closed_radius(stencil, candidate, unlimited, None)
        points.append(Point.of(as_design(stencil, candidate, weighting, worst)))
        if progress:
            progress(done + 1, len(found), f"|R| {candidate.reflection:.1e}, radius - 1 {worst - 1.0:.1e}")
    return points


def size_points(
    stencil: Stencil,
    side: str,
    n_x: Sequence[int],
    n_t: Sequence[int],
    weighting: Weighting,
    *,
    demands: Demands = DEMANDS,
    sweep: Sweep = SWEEP,
    settings: Settings | None = None,
    progress: Progress | None = None,
) -> list[Design]:
    """Design a stable boundary of every size; sizes without one are left out.

    Args:
        stencil: of the interior, one space dimension.
        side: "left" or "right".
        n_x: numbers of nodes to try.
        n_t: numbers of old time levels to try.
        weighting: over frequency.
        demands: on stability.
        sweep: of the least-squares problems.
        settings: of a nonlinear refinement of every size; none if None.
        progress: called after every size.
    """
    found: list[Design] = []
    sizes = [(x, t) for x in n_x for t in n_t if x >= stencil.nodes_at(side)]
    for done, (x, t) in enumerate(sizes):
        try:
            made = design(stencil, side, x, t, weighting, demands=demands, sweep=sweep)
        except ValueError as error:
            note = str(error)
        else:
            made = refine(made, demands, settings) if settings else made
            note = f"N_x {x}, N_t {t}: |R| {made.reflection:.2e}"
            found.append(replace(made, origin=(*made.origin, ("n_x", float(x)), ("n_t", float(t)))))
        if progress:
            progress(done + 1, len(sizes), note)
    return found


def choose(designs: Sequence[Design], enough: float) -> Design:
    """Choose the smallest stencil whose reflection is good enough, the best one of that size.

    Args:
        designs: of several sizes.
        enough: largest reflection that is acceptable.

    Raises:
        ValueError: there is none.
    """
    good = [d for d in designs if d.reflection <= enough]
    if not good:
        raise ValueError(f"no design reflects at most {enough:g}")
    return min(good, key=lambda d: (Point.of(d).size, d.reflection))


def write_front(path: Path, designs: Sequence[Design], chosen: Design) -> None:
    """Write the coefficients of the designs that are on the front of size against reflection, the chosen one first."""
    points = [Point.of(d) for d in designs]
    marked = nondominated(np.array([[p.size, p.reflection] for p in points]))
    kept = [chosen, *(d for d, on in zip(designs, marked, strict=True) if on and d is not chosen)]
    rows = [{"reflection": d.reflection, "gain": d.gain, "radius": d.radius, **dict(d.origin)} for d in kept]
    write_file(path, chosen.stencil, *(d.boundary for d in kept), front=rows)
