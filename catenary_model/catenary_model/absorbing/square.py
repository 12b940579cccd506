"""A closed square of a 2-D scheme with four absorbing sides: corners, long runs, a source in the middle."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from catenary_model.absorbing import assembly
from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.stencil import Array, Stencil


def update(
    stencil: Stencil,
    side: BoundaryStencil,
    nodes: int,
    corner: Array,
    near_corner: BoundaryStencil | None = None,
) -> sp.csr_array:
    """One step of a square of nodes x nodes points, the same boundary at all four sides.

    Rule at the corners: the four corner nodes take `corner`, which reads nodes on the diagonal only (for example
    `higdon.diagonal`). Side nodes whose tangential neighbours would lie on another side take `near_corner`, which has
    no tangential neighbours. So no boundary node reads a new value of a node of another side: the step is explicit.

    Args:
        stencil: of the interior, five points or fewer nodes around (reach 1), alike along both dimensions.
        side: left boundary of axis 0, one node deep.
        nodes: along every side.
        corner: coefficients (1 + N_t, N_x) on the diagonal, entry [l, k] for the node (k, k) at level n + 1 - l.
        near_corner: like `side`, with N_y = 1; needed if `side` has more.

    Returns:
        Shape (nodes^2, levels * nodes^2), see `assembly`; node (i, j) is number i * nodes + j.

    Raises:
        ValueError: something does not fit.
    """
    if stencil.dims != 2 or stencil.reach != ((1, 1), (1, 1)) or stencil.dx[0] != stencil.dx[1]:
        raise ValueError("a square needs a scheme in two dimensions that reaches one node, with dx = dy")
    near = side if near_corner is None else near_corner
    if (side.nodes, side.side, side.axis) != (1, "left", 0) or (near.nodes, near.side, near.axis) != (1, "left", 0):
        raise ValueError("a square takes a left boundary of axis 0 that updates one node, for all of its sides")
    full, plain = _planes(side), _planes(near)
    if plain.shape[2] != 1:
        raise ValueError("beside a corner a boundary without tangential neighbours is needed: near_corner with N_y = 1")
    reach = full.shape[2] // 2
    if nodes < 2 + max(full.shape[1], plain.shape[1], corner.shape[1], full.shape[2]):
        raise ValueError(f"a square of {nodes} nodes is too small for its boundaries")
    levels = max(stencil.levels, full.shape[0] - 1, plain.shape[0] - 1, corner.shape[0] - 1)
    entries = assembly.Entries(nodes * nodes, levels)
    inside = np.arange(nodes * nodes).reshape(nodes, nodes)[1:-1, 1:-1]
    for (level, a, b), value in np.ndenumerate(stencil.weights()):
        entries.add(level + 1, inside, inside + (a - 1) * nodes + b - 1, value)
    for i, j in np.ndindex(nodes, nodes):
        row = i * nodes + j
        on_x, on_y = i in (0, nodes - 1), j in (0, nodes - 1)
        inwards = (1 if i == 0 else -1, 1 if j == 0 else -1)
        if on_x and on_y:
            for (level, k), value in np.ndenumerate(corner):
                entries.add(level, row, (i + inwards[0] * k) * nodes + j + inwards[1] * k, value)
        elif on_x or on_y:
            along = j if on_x else i
            chosen = full if reach < along < nodes - 1 - reach else plain
            half = chosen.shape[2] // 2
            for (level, k, m), value in np.ndenumerate(chosen):
                a, b = (i + inwards[0] * k, j + m - half) if on_x else (i + m - half, j + inwards[1] * k)
                entries.add(level, row, a * nodes + b, value)
    return entries.solve()


def _planes(boundary: BoundaryStencil) -> Array:
    c = boundary.coefficients[0]
    return c[..., None] if c.ndim == 2 else c


def bump(nodes: int, radius: float, centre: tuple[float, float] | None = None) -> Array:
    """Gaussian initial displacement of amplitude 1, shape (nodes^2,).

    Args:
        nodes: along every side.
        radius: standard deviation, in grid spacings.
        centre: in grid spacings from node (0, 0); the middle of the square if None.
    """
    a, b = ((nodes - 1) / 2.0, (nodes - 1) / 2.0) if centre is None else centre
    i, j = np.meshgrid(np.arange(nodes), np.arange(nodes), indexing="ij")
    return np.exp(-((i - a) ** 2 + (j - b) ** 2) / (2.0 * radius**2)).ravel()


def history(step: sp.csr_array, initial: Array, steps: int) -> Array:
    """Displacements of a square that starts at rest with the initial ones, shape (steps + 1, nodes, nodes)."""
    nodes = round(len(initial) ** 0.5)
    levels = assembly.march(step, [initial])
    return np.array([initial, *(next(levels) for _ in range(steps))]).reshape(-1, nodes, nodes)
