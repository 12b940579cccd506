"""Plane waves at a straight boundary of a 2-D scheme: reflection over the angle of incidence and the frequency."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.dispersion import OUTSIDE, spatial_roots, temporal_roots
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil


@dataclass(frozen=True)
class Band:
    """Wave lengths over which a boundary is judged, by the number of grid spacings that fit into them.

    The same band must be used for everything that is compared: what a scheme of second order in space does to a wave
    of four nodes has little to do with the boundary.

    Attributes:
        longest: longest wave, in grid spacings.
        shortest: shortest wave, in grid spacings.
        samples: number of wave numbers, evenly spaced between the two.
    """

    longest: float = 80.0
    shortest: float = 8.0
    samples: int = 24

    def __post_init__(self) -> None:
        """Check the limits."""
        if not 2.0 < self.shortest < self.longest or self.samples < 2:
            raise ValueError(
                f"a band of waves of {self.shortest} to {self.longest} grid spacings needs 2 < shortest < longest, and "
                f"at least two samples, not {self.samples}"
            )

    def wave_numbers(self, dx: float) -> Array:
        """Wave numbers |k|, rad/m, shape (samples,)."""
        return 2.0 * np.pi / dx * np.linspace(1.0 / self.longest, 1.0 / self.shortest, self.samples)


def oriented(stencil: Stencil, boundary: BoundaryStencil) -> tuple[Stencil, BoundaryStencil]:
    """Turn scheme and boundary so that the boundary is the left one along axis 0.

    Raises:
        ValueError: the scheme is not two-dimensional, or the boundary leaves nodes that nobody updates.
    """
    if stencil.dims != 2:
        raise ValueError(f"{stencil.name} has {stencil.dims} space dimensions; plane waves at an angle need two")
    if boundary.axis == 1:
        stencil = replace(stencil, offsets=stencil.offsets[:, [1, 0, 2]], dx=(stencil.dx[1], stencil.dx[0]))
    if boundary.side == "right":
        stencil = stencil.mirrored()
    needed = stencil.nodes_at("left")
    if boundary.nodes != needed:
        raise ValueError(f"the boundary updates {boundary.nodes} nodes, the interior of {stencil.name} needs {needed}")
    return stencil, replace(boundary, side="left", axis=0)


def time_factor(stencil: Stencil, k_x: Array, k_y: Array) -> ComplexArray:
    """Find e^{i omega_t dt} of the plane wave e^{i (k_x x + k_y y + omega_t t)} with omega_t > 0.

    Args:
        stencil: of the interior, two space dimensions.
        k_x: wave number along axis 0, rad/m; positive for a wave that travels to the left.
        k_y: wave number along axis 1, rad/m, of any sign.

    Returns:
        Shape of k_x and k_y broadcast.
    """
    xi, eta = np.exp(1j * np.asarray(k_x) * stencil.dx[0]), np.exp(1j * np.asarray(k_y) * stencil.dx[1])
    roots = temporal_roots(stencil, xi, eta)
    # Of the roots on (or next to) the unit circle the one with the smallest positive frequency is the physical one.
    angle = np.where(np.abs(roots) > 0.5, np.angle(roots), np.inf)
    angle = np.where(angle > 0.0, angle, np.inf)
    best = np.argmin(angle, axis=-1)[..., None]
    return np.take_along_axis(roots, best, axis=-1)[..., 0]


def reflected_roots(stencil: Stencil, z: ComplexArray, eta: ComplexArray) -> ComplexArray:
    """Find e^{i omega_x dx} of the waves that go from the left boundary inwards, |z| >= 1.

    They decay inwards where |z| > 1 (Kreiss), so they are sorted slightly outside the unit circle.

    Args:
        stencil: of the interior, two space dimensions, boundary at the left of axis 0.
        z: e^{i omega_t dt}, shape (m,).
        eta: e^{i omega_y dy}, shape (m,).

    Returns:
        Shape (m, nodes at the left), the propagating one first.
    """
    low = stencil.nodes_at("left")
    outside = spatial_roots(stencil, z * (1.0 + OUTSIDE), eta)[:, :low]
    on_circle = spatial_roots(stencil, z, eta)
    nearest = np.argmin(np.abs(on_circle[:, :, None] - outside[:, None, :]), axis=1)
    return np.take_along_axis(on_circle, nearest, axis=1)[:, ::-1]


def residual(boundary: BoundaryStencil, z: ComplexArray, xi: ComplexArray, eta: ComplexArray) -> ComplexArray:
    """Left-hand side minus right-hand side of the boundary's update for the wave xi^k eta^m z^n.

    Args:
        boundary: with (nodes, 1 + N_t, N_x[, N_y]) coefficients.
        z: e^{i omega_t dt}, shape (m,).
        xi: factor from node to node inwards, shape (m,).
        eta: factor from node to node along the boundary, shape (m,).

    Returns:
        Shape (m, nodes): zero if the wave satisfies the boundary's equation exactly.
    """
    c = boundary.coefficients
    c = c[..., None] if c.ndim == 3 else c
    powers = [
        base[:, None] ** exponent
        for base, exponent in (
            (z, -np.arange(c.shape[1])),
            (xi, np.arange(c.shape[2])),
            (eta, np.arange(c.shape[3]) - c.shape[3] // 2),
        )
    ]
    own = xi[:, None] ** np.arange(c.shape[0])
    return (own - np.einsum("plkm,ql,qk,qm->qp", c, *powers, optimize=True)).astype(np.complex128)


def reflection(stencil: Stencil, boundary: BoundaryStencil, k: Array, angle: Array) -> ComplexArray:
    """Reflection coefficient of a boundary for plane waves of the discrete scheme (3.27).

    The wave e^{i (k cos(angle) x + k sin(angle) y + omega_t t)} meets the left boundary; omega_t follows from the
    scheme's own dispersion relation, so the incident wave is exact. Evanescent waves that a wider interior stencil has
    are part of the balance; the amplitude returned is that of the propagating one.

    Args:
        stencil: of the interior, two space dimensions.
        boundary: at any side.
        k: wave number, rad/m; broadcast against `angle`.
        angle: of incidence, rad, 0 is normal, below pi / 2 in modulus.

    Returns:
        Complex amplitudes, in the shape of `k` and `angle` broadcast.
    """
    stencil, boundary = oriented(stencil, boundary)
    k, angle = np.broadcast_arrays(np.asarray(k, float), np.asarray(angle, float))
    k_x, k_y = (k * np.cos(angle)).ravel(), (k * np.sin(angle)).ravel()
    z = time_factor(stencil, k_x, k_y)
    eta = np.exp(1j * k_y * stencil.dx[1])
    incident = residual(boundary, z, np.exp(1j * k_x * stencil.dx[0]), eta)
    roots = reflected_roots(stencil, z, eta)
    balance = np.stack([residual(boundary, z, roots[:, i], eta) for i in range(roots.shape[1])], axis=-1)
    amplitudes = np.linalg.solve(balance, -incident[..., None])[:, 0, 0]
    return amplitudes.reshape(k.shape).astype(np.complex128)


def worst(stencil: Stencil, boundary: BoundaryStencil, degrees: Array, band: Band | None = None) -> Array:
    """Largest reflected amplitude over a band at every angle of incidence, shape of `degrees`."""
    k = (band or Band()).wave_numbers(stencil.dx[0])
    return np.abs(reflection(stencil, boundary, k[:, None], np.radians(degrees))).max(axis=0)


def rms(stencil: Stencil, boundary: BoundaryStencil, degrees: Array, band: Band | None = None) -> Array:
    """Root mean square of the reflected amplitude over a band at every angle of incidence, shape of `degrees`."""
    k = (band or Band()).wave_numbers(stencil.dx[0])
    return np.sqrt((np.abs(reflection(stencil, boundary, k[:, None], np.radians(degrees))) ** 2).mean(axis=0))
