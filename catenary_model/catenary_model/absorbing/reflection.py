"""Reflection coefficient of a boundary stencil from the discrete dispersion relation, evanescent branch included."""

from __future__ import annotations

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil, unknowns
from catenary_model.absorbing.dispersion import Waves, waves
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil


def equations(z: ComplexArray, factor: ComplexArray, shape: tuple[int, ...]) -> tuple[ComplexArray, ComplexArray]:
    """Boundary update applied to the wave factor^k z^n: the error is `target - terms . coefficients`, linear in them.

    Args:
        z: e^{i omega_t dt}, shape (m,).
        factor: from one node to the next one inwards, shape (m,).
        shape: of the coefficients, (nodes, 1 + N_t, N_x).

    Returns:
        terms (m, 1 + N_t, N_x) = factor^k z^{1-l} and target (m, nodes) = factor^p z.
    """
    nodes, levels, n_x = shape
    space = factor[:, None] ** np.arange(max(n_x, nodes))
    time = z[:, None] ** (1 - np.arange(levels))
    return time[:, :, None] * space[:, None, :n_x], space[:, :nodes] * z[:, None]


def residuals(boundary: BoundaryStencil, z: ComplexArray, factor: ComplexArray) -> ComplexArray:
    """Error of every boundary node on the wave factor^k z^n after one step, shape (m, nodes): 0 if it passes."""
    terms, target = equations(z, factor, boundary.coefficients.shape)
    return target - np.einsum("mlk,plk->mp", terms, boundary.coefficients)


def amplitudes(boundary: BoundaryStencil, modes: Waves, incident: int = 0) -> ComplexArray:
    """Amplitudes of the reflected waves, for an incident one of amplitude 1 at the outermost node.

    A boundary of several nodes has as many equations; as many waves go inwards, one of them propagating and the others
    evanescent, and together they meet the equations.

    Args:
        boundary: its side is that of `modes`.
        modes: from `waves`.
        incident: column of the incident wave; 0 is the propagating one.

    Returns:
        Shape (m, nodes), the propagating one first.
    """
    incoming = residuals(boundary, modes.z, modes.incident[:, incident])
    matrix = reflected_matrix(boundary, modes)
    return np.linalg.solve(matrix, -incoming[..., None])[..., 0].astype(np.complex128)


def amplitudes_with_derivative(boundary: BoundaryStencil, modes: Waves) -> tuple[ComplexArray, ComplexArray]:
    """Amplitudes of the reflected waves (m, nodes) and their derivatives by the unknowns (m, nodes, unknowns)."""
    shape = boundary.coefficients.shape
    mask = unknowns(shape)
    inverse = np.linalg.inv(reflected_matrix(boundary, modes))
    a = amplitudes(boundary, modes)
    field = equations(modes.z, modes.incident[:, 0], shape)[0]
    for j in range(shape[0]):
        field = field + a[:, j, None, None] * equations(modes.z, modes.reflected[:, j], shape)[0]
    slopes = [inverse[:, :, p, None] * field[:, mask[p]][:, None, :] for p in range(shape[0])]
    return a, np.concatenate(slopes, axis=2).astype(np.complex128)


def echo_matrix(modes: Waves) -> ComplexArray:
    """Matrix from reflected amplitudes to what is seen: the propagating one, then the local field of all the others.

    Many evanescent waves can have large amplitudes that cancel. Row 1 + k of the result is their sum at node k, so
    nothing is counted that is not there.

    Returns:
        Shape (m, nodes, nodes).
    """
    m, nodes = modes.reflected.shape
    matrix = np.zeros((m, nodes, nodes), complex)
    matrix[:, 0, 0] = 1.0
    matrix[:, 1:, 1:] = modes.reflected[:, None, 1:] ** np.arange(nodes - 1)[:, None]
    return matrix


def reflected_matrix(boundary: BoundaryStencil, modes: Waves) -> ComplexArray:
    """Residuals of the reflected waves, shape (m, nodes, nodes): singular where the half space has an eigenvalue.

    Raises:
        ValueError: the boundary has another number of nodes than there are waves.
    """
    if boundary.nodes != modes.reflected.shape[1]:
        raise ValueError(f"{boundary.nodes} boundary nodes cannot determine {modes.reflected.shape[1]} reflected waves")
    columns = [residuals(boundary, modes.z, modes.reflected[:, j]) for j in range(boundary.nodes)]
    return np.stack(columns, axis=-1)


def reflection(stencil: Stencil, boundary: BoundaryStencil, frequencies: Array) -> ComplexArray:
    """Reflection coefficient of the propagating wave at frequencies in Hz: reflected over incident amplitude.

    Amplitudes are those at the outermost node; with damping they differ along the way.

    Args:
        stencil: of the interior, one space dimension.
        boundary: of one side.
        frequencies: Hz, above 0 and at most 1 / (2 dt), shape (m,).

    Returns:
        Shape (m,), complex.

    Raises:
        ValueError: frequencies out of range, or the boundary does not fit the stencil.
    """
    f = np.asarray(frequencies, float)
    if np.any(f <= 0.0) or np.any(f > 0.5 / stencil.dt * (1.0 + 1e-12)):
        raise ValueError(f"frequencies must lie above 0 and up to {0.5 / stencil.dt:g} Hz, half the rate of the steps")
    modes = waves(stencil, np.exp(2j * np.pi * f * stencil.dt), boundary.side)
    return amplitudes(boundary, modes)[:, 0]
