"""Absorbing boundary of a beam under tension: reflection, stability, snapshots in the manner of Figure 3.7."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model import absorbing
from catenary_model.absorbing import measure, pareto, simulate
from catenary_model.absorbing.design import worst_radius
from catenary_model.absorbing.refine import Settings, refine
from catenary_model.line import CONTACT_3_1

Array = NDArray[np.float64]
Say = Callable[[str], None]

DX, DT, LENGTH = 0.25, 1e-3, 100.0
"""Grid spacing (m), time step (s), length of the beam (m)."""
NODES = round(LENGTH / DX) + 1
LOW, HIGH = 0.5, 30.0
"""Band, Hz."""
WEIGHTING = absorbing.band(LOW, HIGH)
ENOUGH = 5e-4
"""Chosen is the smallest stencil that reflects at most this in the band: a tenth of what is asked for."""
SIZES_X, SIZES_T = (3, 4, 5), (1, 2, 3)
"""Sizes of the front: nodes and old levels."""
SMALL = (12, 25, 60)
"""Nodes of the small closed domains."""
DEMANDS = absorbing.Demands(nodes=SMALL)
MARGIN = 1e-9
"""Least distance of a spectral radius from 1; of the small domains the design itself demands more."""
MARGINS = (3e-7, 1e-6, 3e-6, 1e-5, 3e-5)
"""Margins that the front of performance against stability demands beyond that of the designs."""
DEFLECTION, WIDTH = 0.5, 0.6
"""Height and width (standard deviation) of the initial bump in the middle, m."""
TIMES = (0.0, 0.1, 0.25, 0.4, 0.55, 0.85, 1.2, 1.6)
"""T1 to T8, s."""
BEYOND = round(400.0 / DX)
"""Nodes that the long beam has more, to the left: the scheme takes two a step at most, so nothing is back by T8."""
LONG_RUN, SHORT_RUN, BLOCKS = 1_000_000, 20_000, 20
"""Steps without growth, those of a quick run, and parts whose largest displacements are compared."""
SEED = 3


def beam(damping: float) -> absorbing.Stencil:
    """Return the contact wire of Table 3.1 at rest with this damping (N s/m^2)."""
    wire = CONTACT_3_1
    return absorbing.beam(wire.mass_per_length, damping, wire.bending_stiffness, wire.tension, DX, DT)


def one_way(stencil: absorbing.Stencil) -> absorbing.BoundaryStencil:
    """Return what a string would take, w_t = c w_x in a box of two nodes and two levels, at both nodes of the end."""
    told = dict(stencil.parameters)
    r = np.sqrt(told["T"] / told["rhoA"]) * stencil.dt / stencil.dx[0]
    c = np.zeros((2, 2, 3))
    for p in range(2):
        c[p, 0, p + 1], c[p, 1, p], c[p, 1, p + 1] = (r - 1.0) / (1.0 + r), (1.0 - r) / (1.0 + r), 1.0
    return absorbing.BoundaryStencil(c)


@dataclass(frozen=True)
class Fronts:
    """Candidates and designs among which one was chosen."""

    candidates: list[pareto.Point]
    """Least-squares solutions of the chosen size, stable or not."""
    margins: list[absorbing.Design]
    """Refined ones of that size for larger margins of stability."""
    designs: list[absorbing.Design]
    """Stable, of several sizes."""
    chosen: absorbing.Design


def fronts(stencil: absorbing.Stencil, quick: bool, say: Say) -> Fronts:
    """Design boundaries of several sizes, choose the smallest that reflects little enough."""

    def told(done: int, whole: int, what: str) -> None:
        say(f"beam, sizes {done} of {whole}: {what}")

    sizes = ((4,), (1,)) if quick else (SIZES_X, SIZES_T)
    n_x, n_t = sizes
    made = pareto.size_points(stencil, "left", n_x, n_t, WEIGHTING, demands=DEMANDS, settings=Settings(), progress=told)
    # A scheme may be stable in every small domain and not in the large one: look there too.
    chosen = pareto.choose([d for d in made if radii(stencil, d.boundary).whole <= 1.0 - MARGIN], ENOUGH)
    if quick:
        return Fronts([], [], made, chosen)
    c = chosen.boundary
    say("beam, least-squares solutions against stability")
    points = pareto.stability_points(stencil, "left", c.n_x, c.n_t, WEIGHTING)
    margins = []
    for margin in MARGINS:
        say(f"beam, margin {margin:g}")
        try:
            margins.append(designed(stencil, c.n_x, c.n_t, margin))
        except ValueError:
            break
    return Fronts(points, margins, made, chosen)


def designed(stencil: absorbing.Stencil, n_x: int, n_t: int, margin: float = DEMANDS.margin) -> absorbing.Design:
    """Return the boundary of one size whose spectral radius is below 1 by a margin.

    Raises:
        ValueError: there is none.
    """
    demands = DEMANDS._replace(margin=margin)
    return refine(absorbing.design(stencil, "left", n_x, n_t, WEIGHTING, demands=demands), demands)


class Reflected(NamedTuple):
    """Reflected over incident amplitude of one boundary, all for frequencies in Hz."""

    f: Array
    waves: Array
    """From the dispersion relation, at f."""
    f_pulse: Array
    pulse: Array
    """Of a short pulse in time, by its spectrum, at f_pulse."""
    f_packets: Array
    packets: Array
    """Of wave packets in time, at f_packets."""


def reflected(stencil: absorbing.Stencil, end: absorbing.BoundaryStencil, quick: bool) -> Reflected:
    """Measure what comes back, by waves and in time."""
    f = np.geomspace(LOW, HIGH, 60 if quick else 400)
    f_pulse = np.geomspace(2.0 if quick else LOW, HIGH, 12 if quick else 40)
    f_packets = np.array([10.0, 30.0] if quick else [0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 30.0])
    packets = np.array([measure.packet(stencil, end, float(frequency))[0] for frequency in f_packets])
    waves = np.abs(absorbing.reflection(stencil, end, f))
    return Reflected(f, waves, f_pulse, measure.broadband(stencil, end, f_pulse), f_packets, packets)


class Radii(NamedTuple):
    """Largest spectral radii: other end clamped, or the same boundary mirrored."""

    small: float
    """Over the small domains."""
    whole: float
    """Of the beam of 100 m."""


def radii(stencil: absorbing.Stencil, end: absorbing.BoundaryStencil) -> Radii:
    """Look at closed domains with the boundary at one end and at both."""
    others = (None, end.mirrored())
    return Radii(
        max(worst_radius(stencil, end, other, SMALL) for other in others),
        max(worst_radius(stencil, end, other, (NODES,)) for other in others),
    )


class Snapshots(NamedTuple):
    """The beam and the same nodes of one too long to notice."""

    x: Array
    times: Array
    frames: Array
    """Shape (times, nodes)."""
    exact: Array
    difference: float
    """Largest at any time and node, m."""


def snapshots(stencil: absorbing.Stencil, end: absorbing.BoundaryStencil) -> Snapshots:
    """Let the initial bump go: absorbed on the left, clamped on the right."""
    x: Array = DX * np.arange(NODES, dtype=np.float64)
    start = DEFLECTION * np.exp(-0.5 * ((x - 0.5 * LENGTH) / WIDTH) ** 2)
    count = round(TIMES[-1] / DT)
    here = simulate.run(stencil, end, None, start, count)
    there = simulate.run(stencil, None, None, np.concatenate([np.zeros(BEYOND), start]), count)[:, BEYOND:]
    rows = [round(time / DT) for time in TIMES]
    return Snapshots(x, np.array(TIMES), here[rows], there[rows], float(np.abs(here - there).max()))


def long_run(stencil: absorbing.Stencil, end: absorbing.BoundaryStencil, count: int) -> Array:
    """Start the beam of 100 m from noise, which excites everything that the grid has.

    Returns:
        Largest displacement of every part of the run over that of the first part, shape (parts,).
    """
    start = np.random.default_rng(SEED).uniform(-1.0, 1.0, NODES)
    peaks = simulate.growth_of(stencil, end, None, start, count, BLOCKS)
    return np.asarray(peaks / peaks[0])


class Case(NamedTuple):
    """All that was measured of one beam."""

    name: str
    stencil: absorbing.Stencil
    design: absorbing.Design
    reflected: Reflected
    radii: Radii
    snapshots: Snapshots
    long_run: Array
    steps: int


def measured(name: str, stencil: absorbing.Stencil, design: absorbing.Design, quick: bool, say: Say) -> Case:
    """Measure one beam with a boundary."""
    end = design.boundary
    say(f"{name}: pulse and packets")
    back = reflected(stencil, end, quick)
    say(f"{name}: eigenvalues")
    found = radii(stencil, end)
    shot = snapshots(stencil, end)
    count = SHORT_RUN if quick else LONG_RUN
    say(f"{name}: {count} steps")
    return Case(name, stencil, design, back, found, shot, long_run(stencil, end, count), count)
