"""The static shape of the contact wire as the moving mesh sees it.

The exact static shape has kinks that are rounded over sqrt(EI/T) = 9 cm; a mesh of 1 m cannot follow them and rounds
them over about an element. When the pantograph lifts the wire at a dropper, the dropper goes slack and the mesh answers
with the opposite of *its own* kink. For the two to cancel, the static shape that is added to the integrated deviation
must be the mesh's: exact everywhere but within about one element of a clamp, where it differs by 1.4e-6 m/N at most
(0.15 mm at 100 N, for Table 3.1 and 1 m elements).

By reciprocity the displacement of a node for a unit load at distance s is the deflection at s of an endless mesh that
carries a unit force on that node, and its rotation the deflection for a unit moment. Both decay to the string's
solution within a few elements or a few sqrt(EI/T), whichever is longer, so a patch with the string's values at its
ends is exact: 24 elements on either side, more on a fine mesh.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from catenary_model import elements
from catenary_model.line import Wire
from catenary_model.statics import Statics

Array = NDArray[np.float64]

_REACH = 24
"""Elements of a patch on either side, at least."""
_LONGEST_REACH = 400
_BENDING_LENGTHS = 30
"""Length of a patch on either side in sqrt(EI/T), at least: exp(-30) is rounding."""
TABLE_STEP = 0.005
"""Distance of the table's samples, m. Linear interpolation is then good to 0.03 micrometre in w and 2e-7 in phi and
w' (Table 3.1, 1 m elements); w'' and phi'' have jumps, each smeared over one sample."""
TABLE_SAMPLES = 400_000
"""Most samples of a table: 19.2 MB. Periods beyond 2 km get a longer step; the error grows with its square."""


class Lattice:
    """Difference between an endless mesh and a string, both under a unit point load.

    Attributes: `h` element length (m), `reach` distance (m) beyond which there is none.
    """

    def __init__(self, wire: Wire, h: float) -> None:
        """Solve the patch for a unit force and a unit moment on its middle node."""
        self.h = h
        self._elements = reach = min(max(_REACH, math.ceil(_BENDING_LENGTHS * wire.bending_length / h)), _LONGEST_REACH)
        self.reach = h * reach
        self._tension = wire.tension
        n = 2 * (2 * reach + 1)
        K = np.zeros((n, n))
        block = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
        for e in range(2 * reach):
            K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += block
        ends = np.array([0, 1, n - 2, n - 1])
        inner = np.setdiff1d(np.arange(n), ends)
        w, kink = 0.5 * self.reach / wire.tension, 0.5 / wire.tension
        self._nodal = np.zeros((2, n))
        for which, given in ((0, (-w, kink, -w, -kink)), (1, (-kink, 0.0, kink, 0.0))):
            load = np.zeros(n)
            load[2 * reach + which] = 1.0
            self._nodal[which, ends] = given
            rhs = load[inner] - K[np.ix_(inner, ends)] @ np.array(given)
            self._nodal[which, inner] = np.linalg.solve(K[np.ix_(inner, inner)], rhs)

    def excess(self, s: Array, which: int) -> tuple[Array, Array, Array]:
        """Displacement (which = 0, m/N) or rotation (1, 1/N) of a node for a load at s (m), minus the string's.

        Returns the value and its first and second derivatives by s; zero beyond `reach`.
        """
        s = np.asarray(s, dtype=np.float64)
        inside = np.abs(s) < self.reach
        at = np.where(inside, s, 0.0) / self.h + self._elements
        e = np.minimum(at.astype(np.int64), 2 * self._elements - 1)
        q = np.stack([self._nodal[which, 2 * e + j] for j in range(4)])
        value, slope, bend = ((q * psi).sum(axis=0) for psi in elements.shape_derivatives(at - e, self.h))
        side = np.where(s > 0, 1.0, -1.0)  # at s = 0 the same side as the string's slope on a load
        kink = 0.5 / self._tension
        if which == 0:
            value, slope = value + np.abs(s) * kink, slope + side * kink
        else:
            value = value - side * kink
        zero = np.zeros_like(s)
        return np.where(inside, value, zero), np.where(inside, slope, zero), np.where(inside, bend, zero)


def local_compliance(wire: Wire, h: float) -> float:
    """dC: what the mesh lacks in compliance under a load on a node, m/N."""
    exact = -0.5 * wire.bending_length / wire.tension
    return exact - float(Lattice(wire, h).excess(np.zeros(1), 0)[0][0])


def missing_compliance(wire: Wire, h: float, samples: int) -> Array:
    """dC(xi): what the mesh lacks in compliance under a load inside an element, m/N, at xi = 0 .. 1, (samples + 1,)."""
    n = 2 * (2 * _REACH + 2)
    K = np.zeros((n, n))
    block = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
    for e in range(2 * _REACH + 1):
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += block
    ends = np.array([0, 1, n - 2, n - 1])
    inner = np.setdiff1d(np.arange(n), ends)
    inverse = np.linalg.inv(K[np.ix_(inner, inner)])
    exact, kink = -0.5 * wire.bending_length / wire.tension, 0.5 / wire.tension
    out = np.zeros(samples + 1)
    for i, xi in enumerate(np.linspace(0.0, 1.0, samples + 1)):
        load = np.zeros(n)
        load[2 * _REACH : 2 * _REACH + 4] = elements.shape_derivatives(np.array([xi]), h)[0][:, 0]
        given = np.array([-(_REACH + xi) * h * kink, kink, -(_REACH + 1.0 - xi) * h * kink, -kink])
        q = np.zeros(n)
        q[ends] = given
        q[inner] = inverse @ (load[inner] - K[np.ix_(inner, ends)] @ given)
        out[i] = exact - float(load @ q)
    return out


def static_table(statics: Statics, h: float) -> Array:
    """Static shape of the contact wire on a node of the moving mesh, over one period of the line.

    Returns shape (samples + 1, 6): w, w', w'', phi, phi', phi'' with ' the derivative by the track position zeta;
    sample i is at zeta = i P / samples, the last one repeats the first. Units m, 1, 1/m; 1, 1/m, 1/m^2. The step is
    `TABLE_STEP`, or longer where a long period would need more than `TABLE_SAMPLES`.
    """
    line = statics.line
    period, beam = line.period, statics.contact_beam
    samples = min(max(16, round(period / TABLE_STEP)), TABLE_SAMPLES)
    zeta = np.linspace(0.0, period, samples + 1)
    table = np.zeros((samples + 1, 6))
    if not beam.at.size:
        return table
    lattice = Lattice(beam.wire, h)
    value, slope, bend = beam.string(zeta)
    table[:, 0] = value
    table[:, (1, 3)] = slope[:, None]
    table[:, (2, 4)] = bend
    copies = int(np.ceil(lattice.reach / period))
    for position, load in zip(beam.at, beam.load, strict=True):
        for at in position + period * np.arange(-copies, copies + 1):
            first, last = np.searchsorted(zeta, (at - lattice.reach, at + lattice.reach))
            s = at - zeta[first:last]
            for which in (0, 1):
                for j, column in enumerate(lattice.excess(s, which)):
                    table[first:last, 3 * which + j] += load * (-1.0) ** j * column
    table[-1] = table[0]
    return table
