"""Time run of an interior scheme between two boundaries, in one space dimension."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.stability import sparse_update
from catenary_model.absorbing.stencil import Array, Stencil

Load = Callable[[int], Array]
"""Load at time n on every node, such that the PDE's right-hand side is its value; shape (nodes,)."""


def steps(
    stencil: Stencil,
    left: BoundaryStencil | None,
    right: BoundaryStencil | None,
    start: Array,
    load: Load | None = None,
) -> Iterator[Array]:
    """Yield the displacements step by step, without end, the first one at n = 1.

    Args:
        stencil: of the interior.
        left: boundary there; clamped if None.
        right: boundary there; clamped if None.
        start: displacements at n = 0, shape (nodes,), from rest, or those of old levels, newest first, (levels, nodes);
            missing levels repeat the oldest one given.
        load: on the right-hand side of the PDE.

    Raises:
        ValueError: a boundary does not fit the stencil or the grid.
    """
    given = np.atleast_2d(np.asarray(start, float))
    nodes = given.shape[1]
    update = sparse_update(stencil, left, right, nodes)
    levels = update.shape[1] // nodes
    rest = np.repeat(given[-1:], max(levels - len(given), 0), axis=0)
    state = np.concatenate([given, rest])[:levels].ravel()
    first = stencil.nodes_at("left") if left is None else left.nodes
    last = nodes - (stencil.nodes_at("right") if right is None else right.nodes)
    n = 0
    while True:
        new = update @ state
        if load is not None:
            new[first:last] += load(n)[first:last] / stencil.new_coefficient
        state = np.concatenate([new, state[:-nodes]])
        n += 1
        yield new


def run(
    stencil: Stencil,
    left: BoundaryStencil | None,
    right: BoundaryStencil | None,
    start: Array,
    count: int,
    every: int = 1,
    load: Load | None = None,
) -> Array:
    """Simulate `count` steps and keep every `every`-th one, the start included; see `steps` for the arguments.

    Returns:
        Shape (1 + count // every, nodes).
    """
    frames = [np.atleast_2d(np.asarray(start, float))[0]]
    for n, frame in enumerate(steps(stencil, left, right, start, load), 1):
        if n % every == 0:
            frames.append(frame)
        if n >= count:
            break
    return np.array(frames)


def growth_of(
    stencil: Stencil, left: BoundaryStencil | None, right: BoundaryStencil | None, start: Array, count: int, blocks: int
) -> Array:
    """Largest displacement within each of `blocks` equal parts of a long run: falls if and only if it is stable.

    Returns:
        Shape (blocks,).

    Raises:
        ValueError: the run has fewer steps than blocks.
    """
    if blocks < 1 or count < blocks:
        raise ValueError(f"{count} steps cannot be divided into {blocks} blocks")
    length = count // blocks
    peaks = np.zeros(blocks)
    for n, frame in enumerate(steps(stencil, left, right, start)):
        if n >= length * blocks:
            break
        peaks[n // length] = max(peaks[n // length], float(np.abs(frame).max()))
    return peaks
