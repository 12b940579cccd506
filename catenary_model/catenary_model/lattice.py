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
from phil_base.kernels import njit

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_REACH = 24
"""Elements of a patch on either side, at least."""
_LONGEST_REACH = 400
_BENDING_LENGTHS = 30
"""Length of a patch on either side in sqrt(EI/T), at least: exp(-30) is rounding."""
TABLE_STEP = 0.005
"""Distance of the table's samples, m. Linear interpolation is then good to 0.03 micrometre in w and 2e-7 in phi and
w' (Table 3.1, 1 m elements); w'' and phi'' have jumps, each smeared over one sample."""
TABLE_SAMPLES = 800_000
"""Most samples of a table: 38 MB. Periods beyond 4 km get a longer step, 30 mm for 400 spans of 60 m, 75 mm for 1000.
Within 75 mm w is off by 1.1 micrometre rms (7.3 at most), w' by 8e-6 and phi by 9e-6 rms (Table 3.1, 0.75 m elements):
a hundredth of what the model itself is off by."""
_PIECE = 50_000
"""Samples of a long table that are worked on at once, to spare memory."""


class Lattice:
    """Difference between an endless mesh and a string, both under a unit point load.

    Attributes: `h` element length (m), `reach` distance (m) beyond which there is none, `nodal` (w, phi) at all nodes
    for a unit force (m, 1 per N) and a unit moment on the middle one, (2, 2 nodes).
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
        self.nodal = np.zeros((2, n))
        for which, given in ((0, (-w, kink, -w, -kink)), (1, (-kink, 0.0, kink, 0.0))):
            load = np.zeros(n)
            load[2 * reach + which] = 1.0
            self.nodal[which, ends] = given
            rhs = load[inner] - K[np.ix_(inner, ends)] @ np.array(given)
            self.nodal[which, inner] = np.linalg.solve(K[np.ix_(inner, inner)], rhs)

    def excess(self, s: Array, which: int) -> tuple[Array, Array, Array]:
        """Displacement (which = 0, m/N) or rotation (1, 1/N) of a node for a load at s (m), minus the string's.

        Returns the value and its first and second derivatives by s; zero beyond `reach`.
        """
        s = np.asarray(s, dtype=np.float64)
        inside = np.abs(s) < self.reach
        at = np.where(inside, s, 0.0) / self.h + self._elements
        e = np.minimum(at.astype(np.int64), 2 * self._elements - 1)
        q = np.stack([self.nodal[which, 2 * e + j] for j in range(4)])
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


def blank_table(period: float) -> Array:
    """Return a read-only table of zeros of the shape for a period (m), which takes no memory: a place to keep free."""
    samples = min(max(16, round(period / TABLE_STEP)), TABLE_SAMPLES)
    return np.broadcast_to(np.zeros(6), (samples + 1, 6))


def static_table(statics: Statics, h: float, out: Array | None = None) -> Array:
    """Static shape of the contact wire on a node of the moving mesh, over one period of the line.

    Returns shape (samples + 1, 6), `out` if given: w, w', w'', phi, phi', phi'' with ' the derivative by the track
    position zeta; sample i is at zeta = i P / samples, the last one repeats the first. Units m, 1, 1/m; 1, 1/m, 1/m^2.
    The step is `TABLE_STEP`, or longer where a long period would need more than `TABLE_SAMPLES`.
    """
    period, beam = statics.line.period, statics.contact_beam
    table = np.zeros(blank_table(period).shape) if out is None else out
    samples = len(table) - 1
    if not beam.at.size:
        table[:] = 0.0
        return table
    zeta = np.linspace(0.0, period, samples + 1)
    lattice = Lattice(beam.wire, h)
    for first in range(0, samples + 1, _PIECE):
        rows = slice(first, first + _PIECE)
        value, slope, bend = beam.string(zeta[rows])
        table[rows, 0] = value
        table[rows, 1] = table[rows, 3] = slope
        table[rows, 2] = table[rows, 4] = bend
    copies = int(np.ceil(lattice.reach / period))
    at = (beam.at[:, None] + period * np.arange(-copies, copies + 1)).ravel()
    load = np.repeat(beam.load, 2 * copies + 1)
    near = np.searchsorted(zeta, at - lattice.reach), np.searchsorted(zeta, at + lattice.reach)
    _round_kinks(zeta, at, load, *near, lattice.nodal, h, 0.5 / beam.wire.tension, table)
    table[-1] = table[0]
    return table


@njit(cache=True)
def _round_kinks(
    zeta: Array,
    at: Array,
    load: Array,
    first: Indices,
    last: Indices,
    nodal: Array,
    h: float,
    kink: float,
    table: Array,
) -> None:
    """Add what the mesh has beyond the string around every load, as `Lattice.excess`, to the samples first .. last."""
    elements_ = (nodal.shape[1] - 2) // 4
    for i in range(at.size):
        for j in range(first[i], last[i]):
            s = at[i] - zeta[j]
            if abs(s) >= h * elements_:
                continue
            place = s / h + elements_
            e = min(int(place), 2 * elements_ - 1)
            xi = place - e
            xi2, xi3 = xi * xi, xi * xi * xi
            side = 1.0 if s > 0.0 else -1.0
            for which in range(2):
                q0, q1, q2, q3 = (
                    nodal[which, 2 * e],
                    nodal[which, 2 * e + 1],
                    nodal[which, 2 * e + 2],
                    nodal[which, 2 * e + 3],
                )
                value = q0 * (1.0 - 3.0 * xi2 + 2.0 * xi3) + q1 * h * (xi - 2.0 * xi2 + xi3)
                value += q2 * (3.0 * xi2 - 2.0 * xi3) + q3 * h * (xi3 - xi2)
                slope = (
                    (q2 - q0) * 6.0 * (xi - xi2) / h + q1 * (1.0 - 4.0 * xi + 3.0 * xi2) + q3 * (3.0 * xi2 - 2.0 * xi)
                )
                bend = (q0 - q2) * (12.0 * xi - 6.0) / (h * h) + (q1 * (6.0 * xi - 4.0) + q3 * (6.0 * xi - 2.0)) / h
                if which == 0:
                    value, slope = value + abs(s) * kink, slope + side * kink
                else:
                    value -= side * kink
                table[j, 3 * which] += load[i] * value
                table[j, 3 * which + 1] -= load[i] * slope
                table[j, 3 * which + 2] += load[i] * bend
