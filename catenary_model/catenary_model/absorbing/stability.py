"""Stability of an interior scheme with boundary stencils: eigenvalues of a small closed domain (3.1.5.2)."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from catenary_model.absorbing.boundary import BoundaryStencil, clamped, unknowns
from catenary_model.absorbing.stencil import Array, ComplexArray, IntArray, Stencil

EIGENVALUES = 8
"""How many of the largest eigenvalues `moduli_with_derivative` looks at."""


def edge_rows(stencil: Stencil, boundary: BoundaryStencil) -> Array:
    """Update of the boundary nodes by old values only: new values that it reads are replaced by their own update.

    Args:
        stencil: of the interior, one space dimension.
        boundary: of one side.

    Returns:
        Shape (nodes, levels, width): entry [p, l, k] multiplies w[k, n - l], k from the boundary inwards.
    """
    scheme = stencil if boundary.side == "left" else stencil.mirrored()
    (low, high), weights = scheme.reach[0], scheme.weights()
    size, levels = max(boundary.n_x, boundary.nodes), max(scheme.levels, boundary.n_t)
    rows = np.zeros((size, levels, size + high))
    for k in range(boundary.nodes, size):
        rows[k, : scheme.levels, k - low : k + high + 1] = weights
    rows[: boundary.nodes, : boundary.n_t, : boundary.n_x] = boundary.coefficients[:, 1:]
    for p in range(boundary.nodes - 1, -1, -1):
        rows[p] += np.tensordot(boundary.coefficients[p, 0, p + 1 :], rows[p + 1 : boundary.n_x], 1)
    return rows[: boundary.nodes]


def sparse_update(
    stencil: Stencil, left: BoundaryStencil | None, right: BoundaryStencil | None, nodes: int
) -> sparse.csr_array:
    """Matrix from the displacements of all old time levels, newest first, to the new ones: one step of the scheme.

    Args:
        stencil: of the interior, one space dimension.
        left: boundary there; clamped if None.
        right: boundary there; clamped if None.
        nodes: of the whole grid, boundary nodes included.

    Returns:
        Shape (nodes, M nodes) with M the largest number of old levels.

    Raises:
        ValueError: a boundary does not fit the stencil or the grid.
    """
    left = clamped(stencil, "left") if left is None else left
    right = clamped(stencil, "right") if right is None else right
    check(stencil, left, right, nodes)
    levels = max(stencil.levels, left.n_t, right.n_t)
    inner = np.arange(left.nodes, nodes - right.nodes)
    low = stencil.reach[0][0]
    parts: list[tuple[Array, IntArray, IntArray]] = []
    for (level, k), weight in np.ndenumerate(stencil.weights()):
        if weight:
            parts.append((np.full(len(inner), weight), inner, level * nodes + inner - low + k))
    for boundary in (left, right):
        rows = edge_rows(stencil, boundary)
        p, level, k = np.nonzero(rows)
        row, column = (p, k) if boundary.side == "left" else (nodes - 1 - p, nodes - 1 - k)
        parts.append((rows[p, level, k], row, level * nodes + column))
    values, i, j = (np.concatenate([part[axis] for part in parts]) for axis in range(3))
    return sparse.csr_array((values, (i, j)), shape=(nodes, levels * nodes))


def transition(stencil: Stencil, left: BoundaryStencil | None, right: BoundaryStencil | None, nodes: int) -> Array:
    """Matrix that takes all displacements of the last time levels one step further, shape (M nodes, M nodes).

    Arguments and errors as for `sparse_update`, which is its upper part.
    """
    update = sparse_update(stencil, left, right, nodes)
    size = update.shape[1]
    matrix = np.zeros((size, size))
    matrix[:nodes] = update.toarray()
    matrix[nodes:, :-nodes] = np.eye(size - nodes)
    return matrix


def eigenvalues(
    stencil: Stencil, left: BoundaryStencil | None = None, right: BoundaryStencil | None = None, nodes: int = 24
) -> ComplexArray:
    """Eigenvalues of `transition`, largest modulus first."""
    values = np.linalg.eigvals(transition(stencil, left, right, nodes)).astype(np.complex128)
    return values[np.argsort(-np.abs(values))]


def radius(
    stencil: Stencil, left: BoundaryStencil | None = None, right: BoundaryStencil | None = None, nodes: int = 24
) -> float:
    """Spectral radius of a small closed domain: below 1 if and only if the scheme is asymptotically stable there.

    Args:
        stencil: of the interior, one space dimension.
        left: boundary there; clamped if None, which makes the verdict one on the other side alone.
        right: boundary there; clamped if None.
        nodes: of the whole grid. A domain can be stable at one size and unstable at another: check several.

    Raises:
        ValueError: a boundary does not fit the stencil or the grid.
    """
    return float(np.abs(eigenvalues(stencil, left, right, nodes)[0]))


def smallest(left: BoundaryStencil, right: BoundaryStencil) -> int:
    """Nodes of the smallest grid on which two boundaries read neither each other nor beyond it."""
    return max(left.nodes + right.nodes + 1, left.n_x + right.nodes, right.n_x + left.nodes)


def check(stencil: Stencil, left: BoundaryStencil, right: BoundaryStencil, nodes: int) -> None:
    """Refuse boundaries that do not fit the stencil or the grid.

    Raises:
        ValueError: saying which one and why.
    """
    if stencil.dims != 1:
        raise ValueError(f"{stencil.name} has {stencil.dims} space dimensions; this function is for one")
    for boundary, side in ((left, "left"), (right, "right")):
        if boundary.side != side:
            raise ValueError(f"the {side} boundary was made for the {boundary.side} side: use mirrored()")
        if boundary.coefficients.ndim != 3:
            raise ValueError(f"the {side} boundary has coefficients for more than one dimension")
        if boundary.nodes < stencil.nodes_at(side):
            raise ValueError(
                f"the {side} boundary updates {boundary.nodes} nodes, the interior stencil cannot reach "
                f"{stencil.nodes_at(side)}"
            )
    needed = smallest(left, right)
    if nodes < needed:
        raise ValueError(f"a grid of {nodes} nodes is too small for these boundaries, which need {needed}")


def moduli_with_derivative(
    stencil: Stencil, left: BoundaryStencil, right: BoundaryStencil, nodes: int, side: str
) -> tuple[Array, Array]:
    """Largest eigenvalue moduli of a closed domain and their derivatives by the coefficients of one side's boundary.

    Where the other side holds the mirror image of the same coefficients, both ends contribute.

    Returns:
        Moduli (e,), and derivatives (e, unknowns) by perturbation theory: y^H dA x / (y^H x).
    """
    matrix = transition(stencil, left, right, nodes)
    values, right_vectors = np.linalg.eig(matrix)
    top = np.argsort(-np.abs(values))[:EIGENVALUES]
    try:
        left_vectors = np.linalg.inv(right_vectors)[top]
    except np.linalg.LinAlgError:
        left_vectors = np.linalg.pinv(right_vectors)[top]
    here = left if side == "left" else right
    mask = unknowns(here.coefficients.shape)
    total = np.zeros((len(top), int(mask.sum())), complex)
    levels = matrix.shape[0] // nodes
    x = right_vectors[:, top].T.reshape(len(top), levels, nodes)
    both = np.array_equal(left.coefficients, right.coefficients)
    for boundary in (left, right):
        if boundary is not here and not both:
            continue
        order = slice(None) if boundary.side == "left" else slice(None, None, -1)
        # A node's error reaches the outer ones through their new values: solve with the transposed implicit part.
        passed = np.eye(boundary.nodes) - boundary.coefficients[:, 0, : boundary.nodes]
        y = np.linalg.solve(passed.T, left_vectors[:, :nodes][:, order][:, : boundary.nodes].T).T
        field = np.concatenate([values[top, None, None] * x[:, :1], x], axis=1)[:, : 1 + boundary.n_t, order]
        field = field[:, :, : boundary.n_x]
        total += np.concatenate([y[:, p, None] * field[:, mask[p]] for p in range(boundary.nodes)], axis=1)
    moduli = np.abs(values[top])
    return moduli, np.real(np.conj(values[top])[:, None] * total) / np.maximum(moduli, 1e-300)[:, None]
