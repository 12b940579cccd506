"""Discrete dispersion relation of a stencil (3.27): its roots in time and in space, and which way the waves go."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

OUTSIDE = 1e-7
"""How far outside the unit circle e^{i omega_t dt} is moved to tell the waves of a lossless scheme apart."""


def temporal_roots(stencil: Stencil, *space: ComplexArray | complex) -> ComplexArray:
    """Find z = e^{i omega_t dt} of the waves (3.27) with given spatial factors e^{i omega_x dx}.

    Args:
        stencil: of the interior.
        space: one factor a dimension, broadcast against each other to shape (...).

    Returns:
        Shape (..., levels), in no particular order.
    """
    factors = np.broadcast_arrays(*(np.asarray(x, complex) for x in space))
    lowest = int(stencil.offsets[:, -1].min())
    polynomial = np.zeros((*factors[0].shape, 2 - lowest), complex)
    for offset, coefficient in zip(stencil.offsets, stencil.coefficients, strict=True):
        wave = np.full(factors[0].shape, complex(coefficient))
        for factor, power in zip(factors, offset[:-1], strict=True):
            wave = wave * factor ** int(power)
        polynomial[..., 1 - offset[-1]] += wave
    return _roots(polynomial)


def growth(stencil: Stencil, points: int = 257) -> float:
    """Largest |e^{i omega_t dt}| over all real spatial frequencies: von Neumann's stability of the interior.

    At most 1 (to rounding) for a stable scheme; a wave grows by this factor every step.

    Args:
        stencil: of the interior.
        points: of spatial frequency from 0 to 2 pi / dx along each dimension (fewer where there are more dimensions).
    """
    per_axis = points if stencil.dims == 1 else 65
    axis = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, per_axis))
    factors = np.meshgrid(*(axis,) * stencil.dims, indexing="ij")
    return float(np.abs(temporal_roots(stencil, *factors)).max())


def spatial_roots(
    stencil: Stencil, z: ComplexArray, *tangential: ComplexArray | complex, axis: int = 0
) -> ComplexArray:
    """Find e^{i omega_x dx} along one axis for given z = e^{i omega_t dt} and tangential factors.

    Args:
        stencil: of the interior.
        z: shape (m,).
        tangential: factors e^{i omega_y dy} of the other dimensions, in order; broadcast to (m,).
        axis: of the normal.

    Returns:
        Shape (m, low + high), sorted by modulus.
    """
    others = [d for d in range(stencil.dims) if d != axis]
    if len(tangential) != len(others):
        raise ValueError(f"a stencil in {stencil.dims} dimensions needs {len(others)} tangential factors")
    z = np.asarray(z, complex)
    low, high = stencil.reach[axis]
    polynomial = np.zeros((*z.shape, low + high + 1), complex)
    for offset, coefficient in zip(stencil.offsets, stencil.coefficients, strict=True):
        wave = coefficient * z ** int(offset[-1])
        for d, factor in zip(others, tangential, strict=True):
            wave = wave * np.asarray(factor, complex) ** int(offset[d])
        polynomial[..., high - offset[axis]] += wave
    roots = _roots(polynomial)
    order = np.argsort(np.abs(roots), axis=-1)
    return np.take_along_axis(roots, order, axis=-1)


class Waves(NamedTuple):
    """Waves at the left end of a domain x >= 0 for given z, as factors from one node to the next one inwards.

    Attributes:
        z: e^{i omega_t dt}, shape (m,).
        incident: shape (m, high): the waves that come from inside; column 0 propagates, the others are evanescent.
        reflected: shape (m, low): those that go inwards, again the propagating one first.
    """

    z: ComplexArray
    incident: ComplexArray
    reflected: ComplexArray


def waves(stencil: Stencil, z: ComplexArray, side: str = "left") -> Waves:
    """Sort the spatial roots at a side of a 1-D domain into incident and reflected waves.

    A wave goes inwards if it decays inwards where |z| > 1 (Kreiss); for a propagating wave that is the sign of its
    group velocity. Where |z| = 1, roots are sorted slightly outside the unit circle and then taken on it.

    Args:
        stencil: of the interior, one space dimension.
        z: e^{i omega_t dt}, |z| >= 1, shape (m,).
        side: "left", or "right": then factors go from the boundary to the left.

    Raises:
        ValueError: the numbers of waves do not fit the stencil, because the interior is not stable.
    """
    if side == "right":
        stencil = stencil.mirrored()
    z = np.atleast_1d(np.asarray(z, complex))
    (low, high) = stencil.reach[0]
    outside = spatial_roots(stencil, z * (1.0 + OUTSIDE))
    if np.any(np.abs(outside[:, :low]) >= 1.0) or np.any(np.abs(outside[:, low:]) <= 1.0):
        raise ValueError(
            f"{stencil.name}: expected {low} waves away from the boundary and {high} towards it at every frequency; "
            f"is the interior stable (growth {growth(stencil):.6f})?"
        )
    roots = _polish(stencil, z, outside)
    return Waves(z, roots[:, low:], roots[:, :low][:, ::-1])


def group_velocity(stencil: Stencil, *wave: ComplexArray | complex) -> Array:
    """Group velocity d omega_t / d omega_x of a wave of the scheme, m/s, positive to the right (one dimension).

    With e^{i(omega_x x + omega_t t)} as in (3.26) the energy goes with -d omega_t / d omega_x.

    Args:
        stencil: of the interior.
        wave: e^{i omega_x dx}, e^{i omega_t dt}: a root of the dispersion relation.
    """
    xi, z = (np.asarray(f, complex) for f in wave)
    by_space = np.zeros(np.broadcast_shapes(xi.shape, z.shape), complex)
    by_time = by_space.copy()
    for (m, n), coefficient in zip(stencil.offsets, stencil.coefficients, strict=True):
        term = coefficient * xi ** int(m) * z ** int(n)
        by_space += m * stencil.dx[0] * term
        by_time += n * stencil.dt * term
    return np.real(by_space / by_time)


def _roots(polynomial: ComplexArray) -> ComplexArray:
    """Roots of polynomials, highest power first, shape (..., degree + 1) -> (..., degree)."""
    degree = polynomial.shape[-1] - 1
    if degree == 2:
        a, b, c = (polynomial[..., i] for i in range(3))
        s = np.sqrt(b * b - 4.0 * a * c)
        q = -0.5 * np.where(np.real(np.conj(b) * s) >= 0.0, b + s, b - s)
        safe = np.where(q == 0.0, 1.0, q)
        return np.stack([q / a, np.where(q == 0.0, 0.0, c / safe)], axis=-1)
    companion = np.zeros((*polynomial.shape[:-1], degree, degree), complex)
    companion[..., 0, :] = -polynomial[..., 1:] / polynomial[..., :1]
    for i in range(1, degree):
        companion[..., i, i - 1] = 1.0
    return np.linalg.eigvals(companion).astype(np.complex128)


def _polish(stencil: Stencil, z: ComplexArray, start: ComplexArray) -> ComplexArray:
    """Roots on the unit circle itself, in the order of those found slightly outside it."""
    roots = spatial_roots(stencil, z)
    ordered = np.empty_like(roots)
    free = np.ones(roots.shape, bool)
    rows = np.arange(len(z))
    for column in range(roots.shape[1]):
        distance = np.where(free, np.abs(roots - start[:, column : column + 1]), np.inf)
        best = np.argmin(distance, axis=1)
        ordered[:, column] = roots[rows, best]
        free[rows, best] = False
    return ordered
