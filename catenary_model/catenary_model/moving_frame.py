"""Both wires as finite elements in the frame of the train, (3.6) in the matrix form (3.16).

    rhoA w_tt + beta w_t = -EI w_xxxx + (T - rhoA v^2) w_xx + beta v w_x + 2 v rhoA w_tx + f             (3.6)

A station is a node of the mesh; it carries (w_ca, phi_ca, w_co, phi_co), so degree of freedom 4 s + 2 wire + r.
Interleaved like this, not wire after wire as in (3.14) and (3.15), everything, droppers included, lies within seven
diagonals on either side of the main one. The wires alone couple only with themselves, so their matrices are kept in a
compact form: six numbers a row, the own wire's (w, phi) at the stations s - 1, s, s + 1.

The convective integrals are not integrated by parts, the tension and bending integrals are; at a free end this
leaves the natural boundary force (T - rhoA v^2) w_x, which `boundary` replaces by what lies beyond the end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import elements
from catenary_model.line import Wire

Matrix = NDArray[np.float64]

CARRIER, CONTACT = 0, 1
_WAVE_NUMBERS = 121
_REACH = 12


@dataclass(frozen=True)
class Mesh:
    """Uniform mesh around the pantograph, which stands at station `middle`, x = 0."""

    h: float
    """Element length, m."""
    half_elements: int
    """Elements behind the pantograph."""
    further_ahead: int = 0
    """Elements that the mesh has ahead of the pantograph more than behind it."""

    @property
    def elements(self) -> int:
        """Number of elements."""
        return 2 * self.half_elements + self.further_ahead

    @property
    def stations(self) -> int:
        """Number of stations."""
        return self.elements + 1

    @property
    def middle(self) -> int:
        """Station of the pantograph."""
        return self.half_elements

    @property
    def behind(self) -> float:
        """Distance from the pantograph to the end behind it, m."""
        return self.h * self.half_elements

    @property
    def ahead(self) -> float:
        """Distance from the pantograph to the end ahead of it, m."""
        return self.h * (self.half_elements + self.further_ahead)

    @property
    def half_length(self) -> float:
        """Distance from the pantograph to the nearer end, m."""
        return min(self.behind, self.ahead)

    @property
    def x(self) -> Matrix:
        """Stations relative to the pantograph, ahead is positive, m, shape (stations,)."""
        return self.h * (np.arange(self.stations, dtype=np.float64) - self.middle)


@dataclass(frozen=True)
class MovingFrame:
    """Compact M, D, K of both wires, each of shape (4 stations, 6); `boundary` functions alter them in place."""

    mesh: Mesh
    carrier: Wire
    contact: Wire
    speed: float
    mass: Matrix
    damping: Matrix
    stiffness: Matrix

    def wire(self, which: int) -> Wire:
        """Return the carrier (0) or the contact wire (1)."""
        return self.contact if which == CONTACT else self.carrier


def wire_elements(wire: Wire, h: float, speed: float) -> tuple[Matrix, Matrix, Matrix]:
    """Element matrices M, D, K of (3.6) for one wire seen from a frame that moves with `speed`, each (4, 4).

    What Galerkin's method (3.10) to (3.13) leaves of an element: integrals of products of its shape functions.
    """
    m, c = elements.mass(h), elements.convection(h)
    M = wire.mass_per_length * m
    D = wire.damping * m - 2.0 * speed * wire.mass_per_length * c
    K = (
        wire.bending_stiffness * elements.bending(h)
        + (wire.tension - wire.mass_per_length * speed**2) * elements.tension(h)
        - wire.damping * speed * c
    )
    return M, D, K


def refuse_fast(carrier: Wire, contact: Wire, speed: float) -> None:
    """Raise ValueError unless the train is slower than 95 % of the waves of both wires."""
    for name, wire in (("carrier", carrier), ("contact", contact)):
        if abs(speed) > 0.95 * wire.wave_speed:
            raise ValueError(
                f"speed {speed * 3.6:.1f} km/h exceeds 95 % of the {name} wire's wave speed "
                f"{wire.wave_speed * 3.6:.1f} km/h"
            )


def assemble(mesh: Mesh, carrier: Wire, contact: Wire, speed: float) -> MovingFrame:
    """Assemble both wires with free ends (3.16).

    Raises ValueError if the train is not slower than the waves: (3.6) then has no wave that runs ahead.
    """
    refuse_fast(carrier, contact, speed)
    n = 4 * mesh.stations
    compact = tuple(np.zeros((n, 6)) for _ in range(3))
    for which, wire in ((CARRIER, carrier), (CONTACT, contact)):
        for target, block in zip(compact, wire_elements(wire, mesh.h, speed), strict=True):
            for e in range(mesh.elements):
                row = 4 * e + 2 * which
                target[row : row + 2, 2:6] += block[:2]
                target[row + 4 : row + 6, 0:4] += block[2:]
    return MovingFrame(mesh, carrier, contact, speed, *compact)


def highest_frequency(wire: Wire, h: float, speed: float) -> float:
    """Highest angular frequency that the endless mesh of one wire has in the frame of the train, rad/s.

    The waves of the mesh are sought over all wave numbers with q ~ exp(i k x), damping left out: the eigenvalues of
    M w_tt + D w_t + K w = 0 in each of them.
    """
    undamped = Wire(wire.mass_per_length, 0.0, wire.bending_stiffness, wire.tension)
    M, D, K = wire_elements(undamped, h, speed)
    highest = 0.0
    for phase in np.exp(1j * np.linspace(0.0, np.pi, _WAVE_NUMBERS)):
        m, d, k = (b[:2, :2] + b[2:, 2:] + b[:2, 2:] * phase + b[2:, :2] / phase for b in (M, D, K))
        companion = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(m, k), -np.linalg.solve(m, d)]])
        highest = max(highest, float(np.abs(np.linalg.eigvals(companion)).max()))
    return highest


def local_mass(wire: Wire, h: float) -> float:
    """Least mass that an endless mesh of one wire puts against a point force, 1 / max (psi M^-1 psi), kg."""
    stations = 2 * _REACH + 2
    M = np.zeros((2 * stations, 2 * stations))
    for e in range(stations - 1):
        M[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += wire.mass_per_length * elements.mass(h)
    psi = elements.shape_derivatives(np.linspace(0.0, 1.0, 9), h)[0]
    load = np.zeros((2 * stations, psi.shape[1]))
    load[2 * _REACH : 2 * _REACH + 4] = psi
    return 1.0 / float((load * np.linalg.solve(M, load)).sum(axis=0).max())


def dense(compact: Matrix) -> Matrix:
    """Return a compact matrix (n, 6) as an ordinary one (n, n), for tests and design."""
    n = compact.shape[0]
    full = np.zeros((n, n))
    for i in range(n):
        first = i - i % 2 - 4
        for j in range(6):
            column = first + 4 * (j // 2) + j % 2
            if 0 <= column < n:
                full[i, column] = compact[i, j]
    return full
