"""Reflection over the angle of incidence: optimised boundaries of the 2-D wave equation beside Engquist and Majda."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from catenary_model.absorbing import assembly, periodic_strip, square
from catenary_model.absorbing.boundary import BoundaryStencil, write_file
from catenary_model.absorbing.engquist_majda import first_order, second_order
from catenary_model.absorbing.equations import wave_2d
from catenary_model.absorbing.higdon import courant, diagonal
from catenary_model.absorbing.incidence_design import Progress, Tuning, design_product
from catenary_model.absorbing.incidence_refinement import closed_radius, refine
from catenary_model.absorbing.plane_waves import Band, reflection, rms, worst
from catenary_model.absorbing.stencil import Array, Stencil

NORMAL = Tuning(0.0, width=20.0, floor=3e-4)
"""Tuned for normal incidence."""
SIXTY = Tuning(60.0, width=7.0, floor=0.2)
"""Tuned for 60 degrees, with what is left given to the angles below."""
SHAPE = (3, 4, 3)
"""New and two old levels, four nodes inwards, one neighbour to either side: the size of the chosen boundaries."""
CHOSEN = {"tuned for 0": (NORMAL, 3e-4), "tuned for 60": (SIXTY, 1e-3)}
"""Tuning and least damping of a factor of the chosen boundaries: the smallest damping, and so the least reflection of
waves longer than the band, with which disturbances are amplified no more than by Engquist and Majda's second one
within 8192 steps (which goes on growing, linearly, where k_y = 0)."""
ENGQUIST_MAJDA = ("EM 1", "EM 2", "EM 2 centred")
GOAL = "tuned for 0"


class Design(NamedTuple):
    """One optimised boundary and what it reaches; a point of a front."""

    boundary: BoundaryStencil
    near_corner: BoundaryStencil
    """The product that it was refined from: beside corners, where it has no tangential neighbours."""
    damping: float
    objective: float
    """Weighted rms of the reflected amplitude for its tuning."""
    radius: float
    """Largest spectral radius of two strips over all k_y and of a closed square."""
    amplification: float
    """Largest amplification of a state of a strip on the way, see `periodic_strip.amplification`."""

    @property
    def size(self) -> int:
        """Number of old values and new neighbours that one update reads."""
        return int(np.count_nonzero(self.boundary.coefficients))


def design(
    stencil: Stencil,
    tuning: Tuning,
    damping: float = 1e-3,
    order: int = 2,
    shape: tuple[int, int, int] | None = SHAPE,
    radius_limit: float | None = None,
    progress: Progress | None = None,
) -> Design:
    """Stable boundary for a tuning: a product of factors, then all coefficients of a shape.

    Args:
        stencil: of the 2-D wave equation, dx = dy.
        tuning: what is wanted.
        damping: least damping of every factor of the product.
        order: number of factors.
        shape: (1 + N_t, N_x, N_y) of the refined boundary; None keeps the product.
        radius_limit: of the refinement; a fifth of the product's margin if None.
        progress: receives lines.
    """
    start = design_product(stencil, tuning, (damping,) * order, progress=progress)
    corner = diagonal(stencil, damping=damping)
    radius = closed_radius(stencil, start.boundary, None, corner)
    if shape is None:
        gain = periodic_strip.amplification(stencil, start.boundary)
        return Design(start.boundary, start.boundary, damping, start.objective, radius, gain)
    limit = 1.0 - 0.2 * (1.0 - radius) if radius_limit is None else radius_limit
    found = refine(stencil, start.boundary, shape, tuning, corner, limit, progress=progress)
    gain = periodic_strip.amplification(stencil, found.boundary)
    return Design(found.boundary, start.boundary, damping, found.objective, found.radius, gain)


class Figures(NamedTuple):
    """What one boundary does, stability and simulations."""

    strip_radius: float
    """Largest spectral radius of a strip of 12 nodes over all k_y."""
    square_radius: float
    """Largest spectral radius of closed squares of 10 and 13 nodes with the corner rule."""
    growth: float
    """Largest amplification of a state of the square of 10 nodes after 131072 steps."""
    amplification: float
    """Largest amplification of a state of a strip on the way, over 8192 steps."""
    point_source: float
    """Largest difference to a domain too large to notice, of a bump that starts in a square: over its norm."""
    packet: float
    """Largest difference between the reflection of wave packets in time and the analysis, at 20, 45 and 60 degrees."""


def figures(
    stencil: Stencil, boundary: BoundaryStencil, near_corner: BoundaryStencil | None, damping: float, free: Array
) -> Figures:
    """Stability and simulations of one boundary.

    Args:
        stencil: of the interior.
        boundary: at all sides.
        near_corner: beside the corners.
        damping: of the corner rule, of one factor along the diagonal.
        free: run of the same bump without boundaries, from `free_run`.
    """
    corner = diagonal(stencil, damping=damping)
    strip = periodic_strip.stability(stencil, boundary).radius
    small = [square.update(stencil, boundary, n, corner, near_corner) for n in (10, 13)]
    nodes = free.shape[1]
    run = square.history(
        square.update(stencil, boundary, nodes, corner, near_corner), square.bump(nodes, 2.0), len(free) - 1
    )
    errors = np.linalg.norm((run - free).reshape(len(free), -1), axis=1) / np.linalg.norm(free[0])
    differences = []
    for degrees in (20.0, 45.0, 60.0):
        echo = periodic_strip.measure(stencil, boundary, 2.0 * np.pi / (12.0 * stencil.dx[0]), np.radians(degrees))
        expected = np.abs(reflection(stencil, boundary, echo.k, echo.angle))
        differences.append(float(np.abs(echo.amplitude - expected).max()))
    return Figures(
        strip,
        max(assembly.radius(u) for u in small),
        assembly.growth_after(small[0], 17),
        periodic_strip.amplification(stencil, boundary),
        float(errors.max()),
        max(differences),
    )


def free_run(stencil: Stencil, nodes: int = 61, travel: int = 200, margin: int = 100) -> Array:
    """Bump in the middle of a domain so large that nothing comes back, cut to the square: (steps + 1, nodes, nodes).

    Args:
        stencil: of the 2-D wave equation.
        nodes: of the square along every side.
        travel: number of grid spacings that a wave travels in the run.
        margin: nodes around the square. To the boundary of the large domain and back to the square a wave travels
            nodes / 2 + 2 margin, more than `travel`.
    """
    large = nodes + 2 * margin
    step = square.update(stencil, first_order(stencil), large, diagonal(stencil))
    run = square.history(step, square.bump(large, 2.0), round(travel / courant(stencil)))
    return run[:, margin:-margin, margin:-margin].copy()


class Incidence(NamedTuple):
    """Result over the angle of incidence; amplitudes in percent."""

    stencil: Stencil
    band: Band
    degrees: Array
    """Angles of incidence, shape (n,)."""
    worst: dict[str, Array]
    """Largest reflected amplitude over the band by name of the boundary, %, shape (n,)."""
    rms: dict[str, Array]
    """Its root mean square over the band, %, shape (n,)."""
    figures: dict[str, Figures]
    designs: dict[str, Design]
    stability_fronts: dict[str, tuple[Design, ...]]
    """Performance against margin of stability: designs over the damping."""
    size_fronts: dict[str, tuple[Design, ...]]
    """Performance against size of the stencil."""
    free: Array
    """Bump in a domain too large to notice, shape (steps + 1, nodes, nodes)."""
    ratio: float
    """Largest reflected amplitude of the chosen boundary over that of EM 2 (either form, worst and rms), 0 to 60."""

    @property
    def goal(self) -> bool:
        """Whether the chosen boundary is stable and below EM 2 everywhere from 0 to 60 degrees."""
        chosen = self.figures[GOAL]
        stable = max(chosen.strip_radius, chosen.square_radius) < 1.0 and chosen.growth < 1.0
        return bool(stable and self.ratio < 1.0)


DAMPINGS = (1e-4, 3e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 4e-2)
SIZES: tuple[tuple[int, tuple[int, int, int] | None], ...] = (
    (1, None),
    (1, (2, 2, 3)),
    (2, None),
    (2, (3, 3, 3)),
    (2, (3, 4, 3)),
    (3, None),
    (3, (4, 4, 3)),
)


def incidence(
    courant_number: float = 0.5,
    band: Band | None = None,
    step_degrees: float = 1.0,
    fronts: bool = True,
    progress: Progress | None = None,
) -> Incidence:
    """Design the boundaries, judge them beside Engquist and Majda's, and draw up the fronts. Deterministic.

    Args:
        courant_number: c dt / dx, below 1 / sqrt(2).
        band: over which reflections are judged.
        step_degrees: between angles of incidence, from 0 to 85.
        fronts: whether to compute the fronts too, most of the time.
        progress: receives lines.
    """
    say = progress or (lambda line: None)
    band = band or Band()
    stencil = wave_2d(1.0, 1.0, courant_number)
    designs: dict[str, Design] = {}
    for name, (tuning, damping) in CHOSEN.items():
        say(f"boundary {name} degrees")
        designs[name] = design(stencil, tuning, damping)
    first = first_order(stencil)
    cases: dict[str, tuple[BoundaryStencil, BoundaryStencil | None, float]] = {
        "EM 1": (first, None, 0.0),
        "EM 2": (second_order(stencil), first, 0.0),
        "EM 2 centred": (second_order(stencil, "centred"), first, 0.0),
        **{name: (d.boundary, d.near_corner, d.damping) for name, d in designs.items()},
    }
    degrees = np.arange(0.0, 85.0 + 1e-9, step_degrees)
    most = {name: 100.0 * worst(stencil, case[0], degrees, band) for name, case in cases.items()}
    mean = {name: 100.0 * rms(stencil, case[0], degrees, band) for name, case in cases.items()}
    say("bump in a domain too large to notice")
    free = free_run(stencil)
    found: dict[str, Figures] = {}
    for name, case in cases.items():
        say(f"stability and simulations: {name}")
        found[name] = figures(stencil, *case, free)
    inside = degrees <= 60.0
    ratio = max(
        float((values[GOAL] / values[name])[inside].max()) for values in (most, mean) for name in ENGQUIST_MAJDA[1:]
    )
    stability_fronts: dict[str, tuple[Design, ...]] = {}
    size_fronts: dict[str, tuple[Design, ...]] = {}
    for name, (tuning, damping) in CHOSEN.items() if fronts else ():
        say(f"front against stability, {name} degrees")
        stability_fronts[name] = tuple(design(stencil, tuning, d) for d in DAMPINGS)
        say(f"front against size, {name} degrees")
        size_fronts[name] = tuple(design(stencil, tuning, damping, order, shape) for order, shape in SIZES)
    return Incidence(stencil, band, degrees, most, mean, found, designs, stability_fronts, size_fronts, free, ratio)


def table(result: Incidence, degrees: tuple[float, ...] = (0, 10, 20, 30, 40, 45, 50, 60, 70, 80)) -> list[list[Any]]:
    """Rows of angle and worst reflected amplitude in percent, one column a boundary in the order of `result.worst`."""
    nearest = [int(np.argmin(np.abs(result.degrees - d))) for d in degrees]
    return [[float(result.degrees[i]), *(float(v[i]) for v in result.worst.values())] for i in nearest]


def write(result: Incidence, folder: Path) -> list[Path]:
    """Write the coefficients of the chosen boundaries, each with the boundary that stands beside the corners.

    Returns:
        Paths of the files.
    """
    paths = []
    for name, d in result.designs.items():
        path = folder / f"wave_2d_{name.replace(' ', '_')}.json"
        write_file(
            path,
            result.stencil,
            d.boundary,
            d.near_corner,
            objective=d.objective,
            radius=d.radius,
            degrees=result.degrees[::5].tolist(),
            reflection_percent=result.worst[name][::5].tolist(),
        )
        paths.append(path)
    return paths
