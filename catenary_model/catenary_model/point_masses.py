"""Point masses of a line as loads on its wires at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from catenary_model.line import Line

Array = NDArray[np.float64]
Loads = tuple[Array, sparse.csr_array, Array]
"""Places (m), what the unknown forces are to the loads, given loads (N up)."""


@dataclass(frozen=True)
class PointMasses:
    """All of one period, as the line has them."""

    at: Array
    """Track positions, m."""
    carrier: Array
    """Masses on the carrier, kg; 0 for those on the contact wire."""
    contact: Array

    @classmethod
    def of(cls, line: Line) -> PointMasses:
        """Collect the masses of all spans."""
        rows = [
            (start + one.position, one.mass * (one.wire == "carrier"), one.mass * (one.wire == "contact"))
            for start, span in zip(line.span_starts, line.spans, strict=True)
            for one in span.masses
        ]
        at, carrier, contact = np.array(rows, dtype=np.float64).reshape(-1, 3).T
        return cls(at, carrier, contact)


def loaded(loads: Loads, mass_at: Array, weight: Array) -> Loads:
    """Add weights (N up) to the loads of a wire, in one load with what is at the same place already; any order."""
    at, by_force, known = loads
    used = weight != 0.0
    places = np.unique(mass_at[used])
    new = places[~np.isin(places, at)]
    every, total = np.concatenate((at, new)), np.concatenate((known, np.zeros(new.size)))
    order = np.argsort(every)
    np.add.at(total, order[np.searchsorted(every[order], mass_at[used])], weight[used])
    more = sparse.csr_array((new.size, by_force.shape[1]))
    return every, sparse.csr_array(sparse.vstack([by_force, more])), total


def apart(loads: Loads, mass_at: Array, weight: Array) -> Loads:
    """Add weights (N up) as loads of their own."""
    at, by_force, known = loads
    more = sparse.csr_array((mass_at.size, by_force.shape[1]))
    every = np.concatenate((at, mass_at)), sparse.csr_array(sparse.vstack([by_force, more]))
    return *every, np.concatenate((known, weight))


def rising(loads: Loads) -> Loads:
    """Loads by rising place."""
    order = np.argsort(loads[0])
    return loads[0][order], loads[1][order], loads[2][order]
