"""Boundaries for the 2-D wave equation tuned to angles of incidence: products of factors within their stable set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.higdon import LOWER, UPPER, Factor, box, courant, product
from catenary_model.absorbing.plane_waves import Band, reflected_roots, time_factor
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

Progress = Callable[[str], None]
ANGLES = np.arange(0.0, 86.0, 2.5)
"""Angles of incidence at which the objective is sampled, degrees."""


class Tuning(NamedTuple):
    """What a boundary is wanted for: weight over the angle of incidence, and the band of wave lengths."""

    degrees: float | None = None
    """Angle of incidence that matters most; None weighs all angles up to `limit` alike."""
    width: float = 15.0
    """The weight falls to 1/e within this many degrees."""
    floor: float = 1e-3
    """Weight of the other angles up to `limit`."""
    limit: float = 60.0
    """Largest angle of incidence that counts, degrees; those above have a weight of 1e-6 only."""
    band: Band = Band(samples=16)

    def weight(self, degrees: Array) -> Array:
        """Weight of the squared reflected amplitude, shape of `degrees`."""
        inside = np.asarray(degrees) <= self.limit
        if self.degrees is None:
            return np.where(inside, 1.0, 1e-6)
        peak = np.exp(-(((degrees - self.degrees) / self.width) ** 2))
        return np.asarray(peak + np.where(inside, self.floor, 1e-6))


class Samples(NamedTuple):
    """Plane waves of the discrete scheme over angles and wave numbers, as factors of (3.27); all of shape (m,)."""

    z: ComplexArray
    """e^{i omega_t dt}."""
    incident: ComplexArray
    """e^{i omega_x dx} of the incident wave, from node to node inwards."""
    reflected: ComplexArray
    """The same of the reflected wave."""
    eta: ComplexArray
    """e^{i omega_y dy}."""
    weight: Array
    """Square root of the normalised weight: sum of squares is 1."""


def samples(stencil: Stencil, tuning: Tuning) -> Samples:
    """Plane waves that the objective of a tuning is made of.

    Raises:
        ValueError: the interior reaches more than one node, so that there is no single reflected wave.
    """
    if stencil.dims != 2 or stencil.reach[0] != (1, 1):
        raise ValueError(f"{stencil.name}: this design is for two dimensions and a scheme that reaches one node")
    k = tuning.band.wave_numbers(stencil.dx[0])[:, None]
    angle = np.radians(ANGLES)
    k_x, k_y = (k * np.cos(angle)).ravel(), (k * np.sin(angle)).ravel()
    z, eta = time_factor(stencil, k_x, k_y), np.exp(1j * k_y * stencil.dx[1])
    weight = np.broadcast_to(tuning.weight(ANGLES), (len(k), len(ANGLES))).ravel()
    return Samples(
        z,
        np.exp(1j * k_x * stencil.dx[0]),
        reflected_roots(stencil, z, eta)[:, 0],
        eta,
        np.sqrt(weight / weight.sum()),
    )


def factor_reflection(factor: Factor, courant_number: float, waves: Samples) -> ComplexArray:
    """Reflection of one factor alone; that of a product is minus one to the order - 1 times the product of them."""
    f = box(factor, courant_number)
    late = f[0] + f[1] / waves.z[:, None]
    return np.asarray(
        -(late[:, 0] + late[:, 1] * waves.incident) / (late[:, 0] + late[:, 1] * waves.reflected), complex
    )


class ProductDesign(NamedTuple):
    """A product of first-order factors and the weighted rms of its reflected amplitude."""

    factors: tuple[Factor, ...]
    boundary: BoundaryStencil
    objective: float


def design_product(
    stencil: Stencil,
    tuning: Tuning,
    damping: Sequence[float] = (1e-3, 1e-3),
    starts: int = 4,
    progress: Progress | None = None,
) -> ProductDesign:
    """Best product of first-order factors for a tuning, by bounded nonlinear least squares from several starts.

    The bounds keep every factor in the set where it is stable, so every iterate is a stable boundary (Higdon 1987):
    the stability constraint of the thesis (3.1.5.2) is met by the parametrisation.

    Args:
        stencil: of the 2-D wave equation.
        tuning: what is wanted.
        damping: least damping of every factor; their number is the order p, the stencil has p + 1 nodes and p old
            levels. It trades the reflection of long waves for the margin of stability.
        starts: number of starting points, drawn with fixed seeds.
        progress: receives a line a start.
    """
    if not damping:
        raise ValueError("a product needs at least one factor")
    order, r, waves = len(damping), courant(stencil), samples(stencil, tuning)
    low = np.array([[*LOWER[:3], d] for d in damping]).ravel()
    high = np.array([UPPER] * order).ravel()

    def residuals(x: Array) -> Array:
        total = waves.weight.astype(complex)
        for row in x.reshape(order, 4):
            total = total * factor_reflection(Factor(*row), r, waves)
        return np.concatenate([total.real, total.imag])

    best: tuple[float, Array] | None = None
    for seed in range(starts):
        cosines = np.random.default_rng(seed).uniform(0.4, 1.0, order)
        start = np.array([[c, 0.45, 0.45, 1.1 * d + 1e-5] for c, d in zip(cosines, damping, strict=True)]).ravel()
        scale = np.tile([0.1, 0.1, 0.1, 0.02], order)
        found = least_squares(
            residuals, np.clip(start, low + 1e-9, high - 1e-9), bounds=(low, high), x_scale=scale, max_nfev=200
        )
        if progress:
            progress(f"product of order {order}, start {seed + 1} of {starts}: {np.sqrt(2.0 * found.cost):.2e}")
        if best is None or found.cost < best[0]:
            best = found.cost, found.x
    assert best is not None
    factors = tuple(Factor(*(float(v) for v in row)) for row in best[1].reshape(order, 4))
    return ProductDesign(factors, product(factors, r), float(np.sqrt(2.0 * best[0])))
