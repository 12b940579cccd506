"""Two periodic wires under point loads, and the forces between and on them: one sparse linear system.

A tensioned beam at rest under point loads P_i is a string through heights s_i less what bending rounds off its kinks
(`periodic_beam`). Both parts know their neighbours only:

    string    T (s_(i+1) - s_i)/L_i - T (s_i - s_(i-1))/L_(i-1) + P_i = q (L_i + L_(i-1))/2
    rounding  b_i = exp(-L_(i-1)/lambda) b_(i-1) + P_i/(2 T),   a_i = exp(-L_i/lambda) a_(i+1) + P_i/(2 T)
    height    W_i = s_i - lambda (b_i + a_i - P_i/(2 T)),   lambda^2 = EI/T

with the distances L_i to the next load, q the uniform load (weight, down) and indices that run round the period. The
rows of the string add up to the balance of all forces. No exponential grows, no difference of large numbers is taken.
Together with one row per unknown force, its law, the system has a few entries a row whatever the period is; SuperLU
factors it in a time that grows with the number of loads. This is exact: there is no mesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from catenary_model.line import Wire
from catenary_model.periodic_beam import PeriodicBeam

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Matrix = sparse.csr_array


@dataclass(frozen=True)
class LoadedWire:
    """One wire with the places of its loads: load = `by_force` @ (unknown forces) + `known`, N up."""

    wire: Wire
    period: float
    """m."""
    at: Array
    """Places of the loads, rising strictly within one period, m."""
    by_force: Matrix
    """What the unknown forces are to the loads, (loads, forces)."""
    known: Array
    """Loads that are given, N."""
    weight: float
    """Uniform load q, N/m down."""

    @property
    def unknowns(self) -> int:
        """Number of (s, b, a)."""
        return 3 * self.at.size

    @property
    def gap(self) -> Array:
        """Distance from every load to the next one round the period, m."""
        return np.diff(self.at, append=self.at[:1] + self.period)

    def equations(self) -> tuple[Matrix, Matrix, Array]:
        """Rows of string and rounding for the unknowns (forces, s, b, a): of the forces, of (s, b, a), right side."""
        n, gap, T, lam = self.at.size, self.gap, self.wire.tension, self.wire.bending_length
        here = np.arange(n)
        ahead, behind = np.roll(here, -1), np.roll(here, 1)
        pull, decay = T / gap, np.exp(-gap / lam)
        string = _matrix(n, (here, ahead, pull), (here, behind, pull[behind]), (here, here, -pull - pull[behind]))
        after = _matrix(n, (here, behind, -decay[behind]), (here, here, np.ones(n)))
        before = _matrix(n, (here, ahead, -decay), (here, here, np.ones(n)))
        kink = self.by_force / (-2.0 * T)
        forces = sparse.vstack([self.by_force, kink, kink])
        known = self.known / (2.0 * T)
        side = np.concatenate((0.5 * self.weight * (gap + gap[behind]) - self.known, known, known))
        return Matrix(forces), Matrix(sparse.block_diag([string, after, before])), side

    def heights(self) -> tuple[Matrix, Matrix, Array]:
        """W at the loads by the unknowns: coefficients of the forces, of (s, b, a), and the known part (m)."""
        one, lam = sparse.eye_array(self.at.size), self.wire.bending_length
        rounded = lam / (2.0 * self.wire.tension)
        return (
            Matrix(rounded * self.by_force),
            Matrix(sparse.hstack([one, -lam * one, -lam * one])),
            rounded * self.known,
        )

    def beam(self, forces: Array, own: Array) -> PeriodicBeam:
        """Shape of the wire for solved forces (N) and its solved (s, b, a)."""
        string, load = own[: self.at.size], self.by_force @ forces + self.known
        return PeriodicBeam(self.wire, self.period, self.at, load, string, self.weight)


class Hung(Protocol):
    """What `Suspension` asks of a carrier: a `LoadedWire` or a `stitched.StitchedCarrier`."""

    @property
    def at(self) -> Array:
        """Places of the loads, m."""

    @property
    def by_force(self) -> Matrix:
        """What the unknown forces are to the loads, (loads, forces)."""

    @property
    def unknowns(self) -> int:
        """Number of its own unknowns."""

    def equations(self) -> tuple[Matrix, Matrix, Array]:
        """See `LoadedWire.equations`."""

    def heights(self) -> tuple[Matrix, Matrix, Array]:
        """See `LoadedWire.heights`."""

    def beam(self, forces: Array, own: Array) -> Shape:
        """Shape for solved forces (N) and own unknowns."""


class Shape(Protocol):
    """Shape of a wire."""

    def value(self, zeta: Array) -> Array:
        """Height at positions zeta, m."""

    def slope(self, zeta: Array) -> Array:
        """Slope at positions zeta, 1."""


def _matrix(n: int, *parts: tuple[Ints, Ints, Array]) -> Matrix:
    row, column, value = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Matrix(sparse.coo_array((value, (row, column)), shape=(n, n)))


def incidence(size: int, row: Ints, column: Ints, columns: int, value: float = 1.0) -> Matrix:
    """Matrix of shape (size, columns) that holds `value` at these places."""
    return Matrix(sparse.coo_array((np.full(row.size, value), (row, column)), shape=(size, columns)))


class Suspension:
    """Carrier and contact wire together; what is left to say is one law per unknown force.

    Attributes: `carrier`, `contact`, `forces` their number.
    """

    def __init__(self, carrier: Hung, contact: LoadedWire) -> None:
        """Put the equations of both wires below each other."""
        self.carrier, self.contact, self.forces = carrier, contact, carrier.by_force.shape[1]
        (f_ca, own_ca, side_ca), (f_co, own_co, side_co) = carrier.equations(), contact.equations()
        self._wires = Matrix(sparse.hstack([sparse.vstack([f_ca, f_co]), sparse.block_diag([own_ca, own_co])]))
        self.side: Array = np.concatenate((side_ca, side_co))
        self._split = self.forces + carrier.unknowns
        (by_ca, at_ca, known_ca), (by_co, at_co, known_co) = carrier.heights(), contact.heights()
        self.carrier_height = Matrix(sparse.hstack([by_ca, at_ca, Matrix((carrier.at.size, contact.unknowns))]))
        self.contact_height = Matrix(sparse.hstack([by_co, Matrix((contact.at.size, carrier.unknowns)), at_co]))
        self.carrier_known: Array = known_ca
        self.contact_known: Array = known_co

    def factor(self, laws: Matrix) -> Factor:
        """Factor the system with these laws of the forces, (forces, unknowns). Raises RuntimeError if singular."""
        return Factor(sparse.csc_array(sparse.vstack([laws, self._wires])))

    def force_rows(self, rows: Ints, value: Array) -> Matrix:
        """Rows that hold a value on the force of their own number, (forces, unknowns)."""
        size = self._wires.shape[1]
        return Matrix(sparse.coo_array((value, (rows, rows)), shape=(self.forces, size)))

    def split(self, x: Array) -> tuple[Array, Array, Array]:
        """Take a solution apart: forces (N), own unknowns of carrier and contact wire (of `LoadedWire` s first)."""
        return x[: self.forces], x[self.forces : self._split], x[self._split :]


class Factor:
    """LU factors of a sparse system, with one step of iterative refinement."""

    def __init__(self, system: sparse.csc_array) -> None:
        """Factor. Raises RuntimeError if the system is singular."""
        self._system = system
        self._factors = linalg.splu(system)

    def solve(self, side: Array) -> Array:
        """Solve for one right side. Raises RuntimeError if there is no finite solution."""
        x: Array = self._factors.solve(side)
        x = x + self._factors.solve(side - self._system @ x)
        if not np.isfinite(x).all():
            raise RuntimeError("singular")
        return x
