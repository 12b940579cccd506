"""Boundary coefficients by linear least squares on the harmonic waves (3.27).

One step with the boundary in place has an error that is linear in the coefficients: (3.28) with a single step. Weighted
with the inverse of the matrix that turns errors into reflected amplitudes, the same rows give the reflection
coefficient itself; that matrix depends on the coefficients, so it is taken from the previous iterate (Sanathanan and
Koerner, IEEE Trans. Autom. Control 8, 1963).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.linalg import qr

from catenary_model.absorbing.boundary import BoundaryStencil, unknowns
from catenary_model.absorbing.dispersion import Waves
from catenary_model.absorbing.reflection import echo_matrix, equations, reflected_matrix
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

EVANESCENT = 0.3
"""Weight of the local field of reflected evanescent waves beside the propagating one: it dies out in a few nodes."""


def mode_weights(nodes: int) -> Array:
    """Weights of the rows of `echo_matrix`, shape (nodes,)."""
    return np.array([1.0] + [EVANESCENT] * (nodes - 1))


def rows(modes: Waves, shape: tuple[int, ...], to_amplitudes: ComplexArray, weights: Array) -> tuple[Array, Array]:
    """Real rows of the least-squares problem: A x ~ b for the unknown coefficients x in the order of `unknowns`.

    Args:
        modes: incident and reflected waves, m frequencies.
        shape: of the coefficients, (nodes, 1 + N_t, N_x).
        to_amplitudes: shape (m, nodes, nodes), from errors of the nodes to amplitudes.
        weights: shape (m, nodes): of every amplitude.

    Returns:
        A (2 m nodes, unknowns) and b (2 m nodes,).
    """
    mask = unknowns(shape)
    terms, target = equations(modes.z, modes.incident[:, 0], shape)
    scaled = to_amplitudes * weights[:, :, None]
    A = np.concatenate([scaled[:, :, p, None] * terms[:, mask[p]][:, None, :] for p in range(shape[0])], axis=-1)
    A = A.reshape(-1, A.shape[-1])
    b = np.einsum("mjp,mp->mj", scaled, target).reshape(-1)
    return np.concatenate([A.real, A.imag]), np.concatenate([b.real, b.imag])


def passes_constant(stencil: Stencil) -> bool:
    """Whether a constant displacement is a solution, so that absorbing it exactly leaves an eigenvalue at 1."""
    return bool(abs(stencil.symbol(*(1.0,) * (stencil.dims + 1))) < 1e-9 * np.abs(stencil.coefficients).max())


def solve(
    A: Array, b: Array, shape: tuple[int, ...], side: str, tikhonov: float, static: float | None
) -> BoundaryStencil:
    """Solve the rows for the coefficients, with Tikhonov's regularisation and a fixed sum for every node.

    Args:
        A: rows.
        b: right-hand side.
        shape: of the coefficients.
        side: of the boundary.
        tikhonov: weight of the coefficients themselves.
        static: what every node keeps of a constant displacement in one step: below 1 it dies out; None leaves it free.
    """
    mask = unknowns(shape)
    n = int(mask.sum())
    start, free = np.zeros(n), np.eye(n)
    if static is not None:
        sums = np.zeros((shape[0], n))
        sums[np.argwhere(mask)[:, 0], np.arange(n)] = 1.0
        start = np.linalg.pinv(sums) @ np.full(shape[0], static)
        free = np.linalg.svd(sums)[2][shape[0] :].T
    # Triangular first: far fewer rows for the singular values of lstsq.
    triangle = qr(np.column_stack([A, b]), mode="r", check_finite=False)[0][: n + 1]
    # `start` is orthogonal to the free directions, which are orthonormal: only these are regularised.
    regular = np.concatenate([triangle[:, :n] @ free, tikhonov * np.eye(free.shape[1])])
    wanted = np.concatenate([triangle[:, n] - triangle[:, :n] @ start, np.zeros(free.shape[1])])
    coefficients = np.zeros(shape)
    coefficients[mask] = start + free @ np.linalg.lstsq(regular, wanted, rcond=None)[0]
    return BoundaryStencil(coefficients, side)


def iterates(
    modes: Waves,
    shape: tuple[int, ...],
    side: str,
    weights: Array,
    tikhonov: float,
    static: float | None,
    iterations: int,
) -> Iterator[BoundaryStencil]:
    """Yield the one-step solution, then those weighted towards the reflection coefficient.

    The first weighting is the inverse of how far the incident and the reflected wave differ: where they hardly do, at
    low frequency, a small error of the step makes a large reflection.
    """
    nodes = shape[0]
    seen = echo_matrix(modes)
    each = weights[:, None] * mode_weights(nodes)
    apart = np.abs(modes.incident[:, 0] - modes.reflected[:, 0])
    matrix: ComplexArray = (np.eye(nodes) / np.maximum(apart, 1e-12)[:, None, None]).astype(np.complex128)
    for _ in range(1 + iterations):
        boundary = solve(*rows(modes, shape, matrix, each), shape, side, tikhonov, static)
        yield boundary
        try:
            matrix = (seen @ np.linalg.inv(reflected_matrix(boundary, modes))).astype(np.complex128)
        except np.linalg.LinAlgError:
            return
