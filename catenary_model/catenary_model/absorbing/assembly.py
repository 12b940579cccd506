"""One time step of a scheme with boundaries as one sparse matrix: simulation and stability use the same numbers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from catenary_model.absorbing.stencil import IntArray

Numbers: TypeAlias = npt.NDArray[Any]


class Entries:
    """Collects the coefficients of all nodes, level by level, while a scheme is assembled."""

    def __init__(self, nodes: int, levels: int) -> None:
        self.nodes = nodes
        self._entries: list[list[tuple[Numbers, Numbers, Numbers]]] = [[] for _ in range(levels + 1)]

    def add(self, level: int, row: int | IntArray, column: int | IntArray, value: complex) -> None:
        """Let a node (or each of an array of nodes) read another one: level 0 is the new time level, 1 the present."""
        if value != 0.0:
            rows, columns, values = (np.ravel(a) for a in np.broadcast_arrays(row, column, value))
            self._entries[level].append((rows, columns, values))

    def solve(self) -> sp.csr_array:
        """Matrix that gives the new level from the old ones, shape (nodes, levels * nodes), newest level first.

        Raises:
            ValueError: nodes read each other's new values in a circle: the scheme is implicit.
        """
        n = self.nodes
        levels = []
        for entries in self._entries:
            if entries:
                rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
                levels.append(sp.csr_array((values, (rows, columns)), shape=(n, n)))
            else:
                levels.append(sp.csr_array((n, n)))
        new, total = levels[0], sp.csr_array(sp.hstack(levels[1:]))
        term = total
        for _ in range(n):
            if new.nnz == 0:
                return total
            term = new @ term
            if term.nnz == 0:
                return sp.csr_array(total)
            total = total + term
        raise ValueError("new values of boundary nodes depend on each other in a circle: the scheme is not explicit")


def transition(update: sp.csr_array) -> Numbers:
    """Dense matrix that takes all kept levels one step further, shape (levels nodes, levels nodes)."""
    n, size = update.shape
    matrix = np.zeros((size, size), update.dtype)
    matrix[:n] = update.toarray()
    matrix[n:, :-n] = np.eye(size - n)
    return matrix


def radius(update: sp.csr_array) -> float:
    """Spectral radius of one step."""
    return float(np.abs(np.linalg.eigvals(transition(update))).max())


def growth_after(update: sp.csr_array, doublings: int) -> float:
    """Largest amplification of any state over 2^doublings steps (Frobenius norm), by repeated squaring."""
    matrix = transition(update)
    for _ in range(doublings):
        matrix = matrix @ matrix
        if not np.all(np.isfinite(matrix)) or np.abs(matrix).max() > 1e100:
            return float("inf")
        # Below this nothing can come back; squaring on would only underflow.
        matrix[np.abs(matrix) < 1e-150] = 0.0
    return float(np.linalg.norm(matrix))


def march(update: sp.csr_array, past: Sequence[Numbers]) -> Iterator[Numbers]:
    """Step a scheme for ever.

    Args:
        update: from `Entries.solve`.
        past: the present level and the ones before it, newest first, each of shape (nodes,); missing older ones are
            taken equal to the oldest given.

    Yields:
        The next levels, shape (nodes,).
    """
    n, size = update.shape
    levels = list(past) + [past[-1]] * (size // n - len(past))
    state = np.concatenate(levels[: size // n])
    while True:
        new = update @ state
        state = np.concatenate([new, state[:-n]])
        yield new
