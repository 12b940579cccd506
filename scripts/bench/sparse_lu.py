"""The library's way for comparison: scipy's sparse LU (SuperLU) of the coupled step matrix, anew every step.

The same matrix and right side as in `banded_lu`, assembled by the same compiled code; the columns that it hands to
SuperLU hold what is not zero. The order of the columns is kept and the diagonal is the pivot: on this band both are
faster than what `splu` chooses by itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

from bench import banded_lu
from bench.banded_lu import HALF
from catenary_model import layout, step
from catenary_model.model import Catenary, Config
from phil_base.kernels import njit

Array = NDArray[np.float64]

IN_ORDER: dict[str, Any] = {
    "permc_spec": "NATURAL",
    "diag_pivot_thresh": 0.0,
    "options": {"SymmetricMode": True, "Equil": False},
}
"""How `splu` is called."""


@njit(cache=True)
def columns(rows: Array, data: Array, index: NDArray[np.int32], start: NDArray[np.int32]) -> int:
    """Turn a matrix given by its rows' bands, (n, 16), into compressed columns; return how many entries they have."""
    n, filled = rows.shape[0], 0
    for j in range(n):
        start[j] = filled
        for i in range(max(0, j - HALF), min(n, j + HALF + 1)):
            value = rows[i, j - i + HALF]
            if value != 0.0:
                data[filled], index[filled] = value, i
                filled += 1
    start[n] = filled
    return filled


class SparseLU:
    """A catenary whose steps call SuperLU; `catenary` holds its state and tells what is seen."""

    def __init__(self, config: Config, how: dict[str, Any] | None = None) -> None:
        """Build it; `how` are the arguments of `splu`, those of `IN_ORDER` by default."""
        self.catenary = Catenary(config)
        self._band = banded_lu.band(self.catenary)
        self._how = IN_ORDER if how is None else how
        n = self._band.y.size
        self._data = np.zeros(n * (2 * HALF + 1))
        self._index, self._start = np.zeros(self._data.size, np.int32), np.zeros(n + 1, np.int32)

    def step(self, f_cat: float) -> None:
        """Advance one cycle with the contact force f_cat (N)."""
        c, s = self.catenary.constants, self.catenary.state
        n, before = int(c.whole["substeps"]), float(s.contact[layout.LAST_FORCE])
        s.counter[layout.ITERATIONS] = 0
        self.steps(np.array([before + (f_cat - before) * ((j + 1) / n) for j in range(n)]))
        step.observe(c, s, f_cat)

    def steps(self, force: Array) -> None:
        """Integrate a step for every force (N), without an observation."""
        for value in force:
            self._substep(float(value))
        self.catenary.state.contact[layout.LAST_FORCE] = force[-1]

    def _substep(self, force: float) -> None:
        c, s, m = self.catenary.constants, self.catenary.state, self._band
        s.contact[layout.GIVEN] = force
        banded_lu.begin(c, s, m)
        n, iterations = m.y.size, 0
        while True:
            banded_lu.laws(c, s)
            banded_lu.assemble(c, s, m, 0)
            filled = columns(m.lu, self._data, self._index, self._start)
            matrix = csc_matrix((self._data[:filled], self._index[:filled], self._start), shape=(n, n))
            m.a[:n] = splu(matrix, **self._how).solve(m.y)
            banded_lu.take(m.a, s.q)
            iterations += 1
            if banded_lu.recheck(c, s) < 0:
                break
            if iterations >= c.whole["max_iterations"]:
                s.counter[layout.UNSETTLED] += 1
                break
        banded_lu.finish(c, s, iterations)
