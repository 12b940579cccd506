"""Point loads on the grid: how they are spread over nodes, what the grid answers, and what it lacks against the wire.

A point at x between two nodes reads the field, and spreads its force, with the same four weights: Keys's cubic
convolution (1981), which is continuous with its slope, exact for parabolas and a single node where x is on a node.

The grid's answer to a load that stands still on the wire follows from the scheme (`absorbing.moving_beam`): with
I shifting by v dt, the wave exp(i theta j) of a steady shape satisfies (2 - C) w = dt^2/rhoA f. So a unit force
on node 0 displaces node n by

    g_n = 1/(2 pi dx) integral dt^2/(rhoA (2 - C(theta))) cos(n theta) d theta,

which is that of the string, -|n| dx/(2 T) (up to a constant that is the same for both), but for a few nodes around the
load, where it differs by `excess`. From there come what the grid lacks in compliance under a dropper or mast, and the
static shape as the grid has it, as `lattice` gives them for elements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import sici

from catenary_model import elements
from catenary_model.absorbing.moving_beam import leap, shift
from catenary_model.lattice import blank_table
from catenary_model.line import Wire
from catenary_model.statics import Statics

Array = NDArray[np.float64]

_WAVES = 8192
"""Samples of an integral over theta, by Gauss and Legendre in pieces."""
_REACH = 24.0
"""Distance (m) beyond which the grid's answer is the string's: it decays within a few nodes or sqrt(EI/T)."""
DUAL_REACH = 6
"""Elements to either side that a projection takes into account."""
_SAMPLES = 32
"""Places between two nodes at which the missing compliance is tabulated."""


def weights(xi: Array) -> tuple[Array, Array, Array]:
    """Weights of nodes -1, 0, 1, 2 for points at xi = 0 .. 1 behind node 0, and first and second derivative by xi.

    Each of shape (4, *xi.shape), 1.
    """
    x = np.asarray(xi, dtype=np.float64)
    x2, x3 = x * x, x * x * x
    zero = np.zeros_like(x)
    value = (-0.5 * x + x2 - 0.5 * x3, 1.0 - 2.5 * x2 + 1.5 * x3, 0.5 * x + 2.0 * x2 - 1.5 * x3, -0.5 * x2 + 0.5 * x3)
    first = (-0.5 + 2.0 * x - 1.5 * x2, -5.0 * x + 4.5 * x2, 0.5 + 4.0 * x - 4.5 * x2, -x + 1.5 * x2)
    second = (2.0 - 3.0 * x, -5.0 + 9.0 * x, 4.0 - 9.0 * x, -1.0 + 3.0 * x)
    return np.stack(value), np.stack(first), np.stack([part + zero for part in second])


def _quadrature() -> tuple[Array, Array]:
    """Nodes and weights of Gauss and Legendre on 0 .. pi in equal pieces."""
    pieces, order = _WAVES // 16, 16
    node, weight = np.polynomial.legendre.leggauss(order)
    edges = np.linspace(0.0, np.pi, pieces + 1)
    half = 0.5 * np.diff(edges)[:, None]
    at = edges[:-1, None] + half * (1.0 + node)
    return at.ravel(), (half * weight).ravel()


@dataclass(frozen=True)
class Grid:
    """One wire on the grid of a moving frame."""

    wire: Wire
    dx: float
    """Spacing, m."""
    dt: float
    """Step, s."""
    speed: float
    """v, m/s."""
    reach: int
    """R of `absorbing.moving_beam`."""

    def _lack(self, theta: Array) -> Array:
        """Symbol of 2 - C without damping, by sines: exact where it is nearly zero."""
        w, R = self.wire, self.reach
        C = leap(w.mass_per_length, 0.0, w.bending_stiffness, w.tension, self.dx, self.dt, R)
        return np.asarray(4.0 * np.sin(0.5 * np.outer(theta, np.arange(1, R + 1))) ** 2 @ C[R + 1 :])

    def excess(self) -> Array:
        """Answer g_n to a load on node 0 minus the string's -|n| dx/(2 T), m/N, for n = 0, 1, ... (nodes,)."""
        theta, weight = _quadrature()
        per = self.dt**2 / (self.wire.mass_per_length * self._lack(theta))
        string = self.dx**2 / (self.wire.tension * theta**2)
        n = np.arange(math.ceil(_REACH / self.dx) + 4)
        inside = np.cos(np.outer(n, theta)) @ (weight * (per - string)) / (np.pi * self.dx)
        # what the string has beyond the grid's shortest wave
        s, K = n * self.dx, np.pi / self.dx
        beyond = (np.cos(K * s) / K - s * (0.5 * np.pi - sici(K * s)[0])) / (np.pi * self.wire.tension)
        return np.asarray(inside - beyond)

    def missing_compliance(self, samples: int = _SAMPLES) -> Array:
        """dC(xi): what the grid lacks under a load between two nodes that stands on the wire, m/N, (samples + 1,)."""
        w = self.wire
        g = self.excess()[:4] - 0.5 * self.dx * np.arange(4) / w.tension
        psi, _, _ = weights(np.linspace(0.0, 1.0, samples + 1))
        between = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
        own = np.einsum("is,ij,js->s", psi, g[between], psi)
        return np.asarray(-0.5 * w.bending_length / w.tension - own)

    def contact_compliance(self) -> float:
        """dC: what the grid lacks under the contact force, which stands on node 0 of the moving frame, m/N."""
        theta, weight = _quadrature()
        seen = self.wire.seen_from(self.speed)
        node = np.arange(-self.reach, self.reach + 1)
        half = 0.5 * np.outer(theta, node)
        away = 2j * np.sin(half) * np.exp(1j * half) @ shift(self.speed * self.dt / self.dx, self.reach)  # I - 1
        lack = away**2 / (1.0 + away) + self._lack(theta)  # I + 1/I - C
        per = self.dt**2 / self.wire.mass_per_length / lack
        string = self.dx**2 / (seen.tension * theta**2)
        inside = float(weight @ (per.real - string)) / (np.pi * self.dx)
        beyond = self.dx / (np.pi**2 * seen.tension)
        return -0.5 * seen.bending_length / seen.tension - (inside - beyond)

    def stiffest(self) -> float:
        """Stiffness (N/m) of a spring on the wire above which the explicit scheme is unstable.

        The factor g = -I of a step is reached where 1 = k (C_grid of a load that changes sign each step).
        """
        theta, weight = _quadrature()
        psi, _, _ = weights(np.linspace(0.0, 1.0, 9))
        node = np.arange(4)
        symbol = np.exp(-1j * np.outer(theta, node)) @ psi  # (theta, places)
        per = weight * self.dt**2 / (self.wire.mass_per_length * (4.0 - self._lack(theta)))
        return float(np.pi * self.dx / (per @ np.abs(symbol) ** 2).max())


def projection(dx: float, per_element: int) -> Array:
    """Weights of grid nodes -m .. m that give (w, phi) of an element's node: the nearest field of Hermite elements.

    The elements of the reduced model are `per_element` spacings long and cannot hold the shortest waves of the grid;
    point values of w and differences of it would turn these into long ones. So the field between the nodes (Keys) is
    projected in the mean square onto an endless row of elements; its dual functions decay within a few elements.

    Returns shape (2, 2 m + 1); phi in 1/m.
    """
    h, half = dx * per_element, DUAL_REACH
    gram = np.zeros((4 * half + 2, 4 * half + 2))
    node, weight = np.polynomial.legendre.leggauss(6)
    for e in range(2 * half):
        gram[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += elements.mass(h)
    dual = np.linalg.inv(gram)[2 * half : 2 * half + 2]
    m = half * per_element
    out = np.zeros((2, 2 * m + 7))
    share = 0.5 * (1.0 + node)
    psi = weights(share)[0]
    for piece in range(2 * m):  # from node piece to node piece + 1
        e, first = piece // per_element, piece % per_element
        shape = elements.shape_derivatives((first + share) / per_element, h)[0]
        field = (dual[:, 2 * e : 2 * e + 4] @ shape) * (0.5 * dx * weight)
        out[:, piece + 2 : piece + 6] += field @ psi.T
    out = np.ascontiguousarray(out[:, 3:-3])
    out[0] /= out[0].sum()  # what the cut duals leave: 1e-5 and 1e-3
    out[1] /= out[1] @ (dx * (np.arange(2 * m + 1) - m))
    return out


def static_table(statics: Statics, grid: Grid, out: Array | None = None) -> Array:
    """Static shape of the contact wire on a node of the grid, over one period of the line.

    Columns w, w', w'' in the format of `lattice.static_table`, shape (samples + 1, 6), `out` if given; the other three
    are zero.
    """
    period, beam, dx = statics.line.period, statics.contact_beam, grid.dx
    table = np.zeros(blank_table(period).shape) if out is None else out
    table[:] = 0.0
    if not beam.at.size:
        return table
    zeta = np.linspace(0.0, period, len(table))
    table[:, 0], table[:, 1], table[:, 2] = beam.string(zeta)
    excess = grid.excess()
    total = excess - 0.5 * dx * np.arange(excess.size) / grid.wire.tension
    reach = dx * (excess.size - 4)
    kink = 0.5 / grid.wire.tension
    copies = int(np.ceil(reach / period))
    for position, load in zip(beam.at, beam.load, strict=True):
        for at in position + period * np.arange(-copies, copies + 1):
            near = slice(*np.searchsorted(zeta, (at - reach, at + reach)))
            s = (at - zeta[near]) / dx  # the load's place relative to the node, in spacings
            if not s.size:
                continue
            e = np.floor(s).astype(np.int64)
            psi = weights(s - e)
            g = total[np.abs(e + np.arange(-1, 3)[:, None])]
            distance, side = np.abs(s) * dx, np.where(s > 0.0, 1.0, -1.0)
            table[near, 0] += load * ((g * psi[0]).sum(axis=0) + kink * distance)
            table[near, 1] -= load * ((g * psi[1]).sum(axis=0) / dx + kink * side)
            table[near, 2] += load * (g * psi[2]).sum(axis=0) / dx**2
    table[-1] = table[0]
    return table
