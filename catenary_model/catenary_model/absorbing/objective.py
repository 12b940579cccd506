"""Output error J_OE of a boundary: a harmonic wave on a small domain against its continuation (3.28), (3.29)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil, unknowns
from catenary_model.absorbing.dispersion import temporal_roots, waves
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil
from catenary_model.absorbing.weighting import Weighting

STEPS = 12
"""Time steps of the small simulation, N_t of (3.28)."""


def outgoing(stencil: Stencil, omega_x: Array, side: str = "left") -> ComplexArray:
    """Find z = e^{i omega_t dt} of the wave with a real spatial frequency that runs towards a side.

    Args:
        stencil: of the interior, one space dimension.
        omega_x: rad/m, between 0 and pi / dx, shape (m,).
        side: "left" or "right".

    Returns:
        Shape (m,): of the physical roots the one with omega_t of the sign that this direction asks for. With more than
        two time levels further roots exist, which the scheme only has on the grid: the two largest |z| are physical.
    """
    xi = np.exp(1j * np.asarray(omega_x, float) * stencil.dx[0])
    roots = temporal_roots(stencil, xi)
    order = np.argsort(-np.abs(roots), axis=-1, kind="stable")[:, :2]
    pair = np.take_along_axis(roots, order, axis=-1)
    angle = np.angle(pair)
    # (3.26): omega_t > 0 runs to the left for omega_x > 0.
    chosen = np.argmax(angle if side == "left" else -angle, axis=-1)
    return pair[np.arange(len(xi)), chosen]


def output_error(
    stencil: Stencil, boundary: BoundaryStencil, omega_x: Array, steps: int = STEPS, nodes: int | None = None
) -> Array:
    """Output error e_OE of (3.28) at every spatial frequency.

    The domain starts as the harmonic wave that runs towards the boundary, at all time levels that are read; beyond the
    far end the wave is continued, so that all of the error is the boundary's.

    Args:
        stencil: of the interior, one space dimension.
        boundary: of one side.
        omega_x: rad/m, shape (m,).
        steps: N_t of (3.28).
        nodes: N_x of (3.28), those whose error counts, from the boundary inwards; twice the boundary's size if None.

    Returns:
        Shape (m,): sum over steps and nodes of |w - exact|.
    """
    return np.abs(errors(stencil, boundary, omega_x, steps, nodes)).sum(axis=(1, 2))


def errors(
    stencil: Stencil, boundary: BoundaryStencil, omega_x: Array, steps: int = STEPS, nodes: int | None = None
) -> ComplexArray:
    """Differences w - exact of the small simulation, shape (m, steps, nodes); see `output_error`."""
    return _errors(_Domain.of(stencil, boundary, omega_x, steps, nodes), derivative=False)[0]


def errors_with_derivative(
    stencil: Stencil, boundary: BoundaryStencil, omega_x: Array, steps: int = STEPS, nodes: int | None = None
) -> tuple[ComplexArray, ComplexArray]:
    """Differences w - exact, and their derivatives by the unknown coefficients, (m, steps, nodes, unknowns)."""
    return _errors(_Domain.of(stencil, boundary, omega_x, steps, nodes), derivative=True)


def J_OE(
    stencil: Stencil, boundary: BoundaryStencil, weighting: Weighting, steps: int = STEPS, points: int = 120
) -> float:
    """Output-error objective (3.29): the weighted integral of e_OE over spatial frequency.

    Args:
        stencil: of the interior, one space dimension.
        boundary: of one side.
        weighting: over frequency; the weight of omega_x is that of its omega_t.
        steps: of the small simulation.
        points: of the integral, which runs over log omega_x as low frequencies matter as much as high ones.

    Returns:
        Normalised by the weights' integral, so that it is a mean error: 0 is a perfect boundary.
    """
    omega_x, weights = spatial_weights(stencil, weighting, points)
    return float(quadrature(omega_x, weights) @ output_error(stencil, boundary, omega_x, steps))


def quadrature(omega_x: Array, weights: Array) -> Array:
    """Weights of the sum that stands for the integral (3.29) over log omega_x, with total 1, shape (m,)."""
    step = np.gradient(np.log(omega_x))
    step[[0, -1]] *= 0.5
    return weights * step / float(weights @ step)


def spatial_weights(stencil: Stencil, weighting: Weighting, points: int = 120) -> tuple[Array, Array]:
    """Spatial frequencies in rad/m up to pi / dx, and the weights that a weighting over Hz gives them."""
    lowest = np.exp(2j * np.pi * 0.1 * weighting.band[0] * stencil.dt)
    least = abs(float(np.angle(waves(stencil, np.array([lowest])).incident[0, 0]))) / stencil.dx[0]
    omega_x = np.geomspace(max(least, 1e-6 / stencil.dx[0]), 0.999 * np.pi / stencil.dx[0], points)
    f = np.abs(np.angle(outgoing(stencil, omega_x))) / (2.0 * np.pi * stencil.dt)
    return omega_x, weighting(np.maximum(f, 1e-9))


class _Domain(NamedTuple):
    """Small domain with the boundary at its left, and the wave in it."""

    scheme: Stencil
    boundary: BoundaryStencil
    xi: ComplexArray
    z: ComplexArray
    counted: int
    size: int
    steps: int

    @staticmethod
    def of(stencil: Stencil, boundary: BoundaryStencil, omega_x: Array, steps: int, nodes: int | None) -> _Domain:
        scheme, sign = (stencil, 1) if boundary.side == "left" else (stencil.mirrored(), -1)
        if scheme.dims != 1:
            raise ValueError(f"{stencil.name} has {stencil.dims} space dimensions; this objective is for one")
        if boundary.nodes < scheme.nodes_at("left"):
            raise ValueError(f"the boundary updates {boundary.nodes} nodes of {scheme.nodes_at('left')}")
        counted = nodes or 2 * max(boundary.n_x, boundary.nodes)
        # So far away that what the error does at the far end cannot come back in time.
        size = max(counted, boundary.n_x, boundary.nodes) + 1 + steps * max(scheme.reach[0]) // 2
        xi = np.exp(1j * np.asarray(omega_x, float) * stencil.dx[0] * sign)
        return _Domain(scheme, boundary, xi, outgoing(stencil, omega_x, boundary.side), counted, size, steps)

    def advance(self, past: list[ComplexArray], drive: ComplexArray) -> ComplexArray:
        """One step of fields (..., size + high), with `drive` (..., nodes) added at the boundary."""
        low, weights, boundary = self.scheme.reach[0][0], self.scheme.weights(), self.boundary
        new = np.zeros(past[0].shape, complex)
        target = np.arange(boundary.nodes, self.size)
        for (level, k), weight in np.ndenumerate(weights):
            if weight:
                new[..., target] += weight * past[level][..., target - low + k]
        for p in range(boundary.nodes - 1, -1, -1):
            value = drive[..., p] + new[..., : boundary.n_x] @ boundary.coefficients[p, 0]
            for level in range(boundary.n_t):
                value = value + past[level][..., : boundary.n_x] @ boundary.coefficients[p, 1 + level]
            new[..., p] = value
        return new


def _errors(domain: _Domain, derivative: bool) -> tuple[ComplexArray, ComplexArray]:
    """March the error, which is zero at first and obeys the same recursion, driven by the boundary's own error."""
    boundary, z = domain.boundary, domain.z
    shape = boundary.coefficients.shape
    width = domain.size + domain.scheme.reach[0][1]
    levels = max(domain.scheme.levels, boundary.n_t)
    space = domain.xi[:, None] ** np.arange(max(boundary.n_x, boundary.nodes))
    wave = z[:, None, None] ** (1 - np.arange(shape[1]))[:, None] * space[:, None, : boundary.n_x]
    drive = np.einsum("mlk,plk->mp", wave, boundary.coefficients) - space[:, : boundary.nodes] * z[:, None]
    node, level, k = np.nonzero(unknowns(shape)) if derivative else (np.zeros(0, int),) * 3
    past = [np.zeros((len(z), width), complex)] * levels
    slopes = [np.zeros((len(z), len(node), width), complex)] * levels
    out = np.empty((len(z), domain.steps, domain.counted), complex)
    by = np.empty((len(z), domain.steps, domain.counted, len(node)), complex)
    for step in range(domain.steps):
        new = domain.advance(past, drive * z[:, None] ** step)
        if derivative:
            field = wave * z[:, None, None] ** step
            field = field + np.stack([e[:, : boundary.n_x] for e in (new, *past)], axis=1)[:, : shape[1]]
            push = np.zeros((len(z), len(node), boundary.nodes), complex)
            push[:, np.arange(len(node)), node] = field[:, level, k]
            slopes = [domain.advance(slopes, push), *slopes[:-1]]
            by[:, step] = np.moveaxis(slopes[0][..., : domain.counted], 1, 2)
        past = [new, *past[:-1]]
        out[:, step] = new[:, : domain.counted]
    return out, by
