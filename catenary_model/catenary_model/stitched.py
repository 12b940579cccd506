"""A carrier with stitch wires over its supports, under point loads: exact beam elements in place of `LoadedWire`.

A stitch wire of length l and tension S hangs below the carrier from clamps l/2 before and behind a mast. Forces along
the track balance in every clamp, so between the two clamps of a stitch wire the carrier keeps T - S. Tension is then no
longer the same everywhere and the closed form of `periodic_beam` does not hold, but from load to load it does:

    T w'' - EI w'''' = q,   w = c_0 + B x + q x^2/(2 T) + A cosh(x/lambda) + D sinh(x/lambda),   lambda^2 = EI/T.

With height and slope at both ends as unknowns this is a beam element without error (`element`): nodes stand where
something is clamped, there is no mesh. A clamp joins heights, not slopes: a stitch wire ends there in a hinge.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from catenary_model.line import Line, StitchWire, Wire
from catenary_model.suspension import Matrix

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_SAME = 1e-9
"""Distance (m) below which two places are one node."""
CARRIER = -1
"""Number of the carrier among the stitch wires."""


def element(wire: Wire, length: float, weight: float) -> tuple[Array, Array]:
    """Return stiffness, (4, 4), and nodal loads of a weight (N/m, down), (4,), for (w, slope) at both ends, exactly."""
    T, lam = wire.tension, wire.bending_length
    t = np.tanh(0.5 * length / lam)
    bend = lam * t
    c = 1.0 / (0.5 * length - bend)
    tilt, turn, curl = np.array([[-0.5, 0.0, 0.5, 0.0], [0.0, 0.5, 0.0, 0.5], [0.0, -0.5, 0.0, 0.5]])
    K = T * (
        2.0 * c * np.outer(tilt, tilt)
        - 2.0 * c * bend * (np.outer(tilt, turn) + np.outer(turn, tilt))
        + c * bend * length * np.outer(turn, turn)
        + 2.0 * lam / t * np.outer(curl, curl)
    )
    moment = weight * lam * (lam - 0.5 * length / t)
    return K, np.array([-0.5 * weight * length, moment, -0.5 * weight * length, -moment])


class Strand:
    """Shape of a stretch of wire of several elements, by height and slope of its nodes.

    Attributes: `at` (m, places of the nodes, rising).
    """

    def __init__(self, at: Array, wires: Sequence[Wire], ends: Array, weight: float, period: float) -> None:
        """Take the places of the nodes (m), a wire per element, (w, slope, w, slope) per element, and q (N/m, down)."""
        self.at, self._period = at, period
        self._length = L = np.diff(at)
        T = np.array([wire.tension for wire in wires])
        self._lam = lam = np.array([wire.bending_length for wire in wires])
        self._bend = weight / T
        t = np.tanh(0.5 * L / lam)
        half = 0.5 * (ends[:, 2] - ends[:, 0])
        turn, curl = 0.5 * (ends[:, 1] + ends[:, 3]), 0.5 * (ends[:, 3] - ends[:, 1])
        self._rise = (half - lam * t * turn) / (0.5 * L - lam * t)
        self._odd = lam * (turn - self._rise)  # of sinh(x/lambda)/cosh(L/(2 lambda))
        self._even = lam * (curl - 0.5 * self._bend * L)  # of (cosh(x/lambda) - cosh(L/(2 lambda)))/sinh(..)
        self._middle = 0.5 * (ends[:, 0] + ends[:, 2]) - self._even / t - 0.125 * self._bend * L**2

    def _parts(self, zeta: Array) -> tuple[NDArray[np.intp], Array, Array, Array]:
        """Element, place from its middle (m), sinh over cosh and cosh over sinh of the element's half."""
        s = np.mod(np.asarray(zeta, dtype=np.float64) - self.at[0], self._period) + self.at[0]
        i = np.clip(np.searchsorted(self.at, s, side="right") - 1, 0, self._length.size - 1)
        L, lam = self._length[i], self._lam[i]
        x = np.clip(s - self.at[i] - 0.5 * L, -0.5 * L, 0.5 * L)
        near, far = np.exp((np.abs(x) - 0.5 * L) / lam), np.exp(-(np.abs(x) + 0.5 * L) / lam)
        whole = np.exp(-L / lam)
        return i, x, np.sign(x) * (near - far) / (1.0 + whole), (near + far) / (1.0 - whole)

    def value(self, zeta: Array) -> Array:
        """Height at track positions zeta, m; NaN where the wire is not."""
        i, x, odd, even = self._parts(zeta)
        curve = self._middle[i] + self._rise[i] * x + 0.5 * self._bend[i] * x**2
        return self._within(zeta, curve + self._odd[i] * odd + self._even[i] * even)

    def slope(self, zeta: Array) -> Array:
        """Slope at track positions zeta, 1; NaN where the wire is not."""
        i, x, odd, even = self._parts(zeta)
        t = np.tanh(0.5 * self._length[i] / self._lam[i])
        turned = self._odd[i] * even * t + self._even[i] * odd / t
        return self._within(zeta, self._rise[i] + self._bend[i] * x + turned / self._lam[i])

    def _within(self, zeta: Array, value: Array) -> Array:
        s = np.mod(np.asarray(zeta, dtype=np.float64) - self.at[0], self._period)
        return np.where(s <= self.at[-1] - self.at[0] + _SAME, value, np.nan)


class StitchedCarrier:
    """Carrier and stitch wires with what hangs from them: to `Suspension` like a `LoadedWire`.

    Attributes: `at` (m, places of the loads as they were given), `unknowns` (their number), `by_force`.
    """

    def __init__(
        self, line: Line, copies: int, at: Array, hangs: Ints, by_force: Matrix, known: Array, gravity: float
    ) -> None:
        """Take the loads on so many periods of a line.

        Args:
            line: with its wires and masts.
            copies: periods that the domain has before it repeats itself.
            at: places of the loads, m, in any order, within the domain.
            hangs: number of the stitch wire that each load sits on, in the order of the masts, or CARRIER.
            by_force: what the unknown forces are to the loads, (loads, forces).
            known: loads that are given, N up.
            gravity: m/s^2; 0 for a deviation from rest.
        """
        self.at, self.by_force, self.known = at, by_force, known
        self.period = P = copies * line.period
        self._gravity = gravity
        masts = [k * line.period + start for k in range(copies) for start in line.span_starts]
        every = [span.stitch_wire for _ in range(copies) for span in line.spans]
        self._stitches = {s: (mast, wire) for s, (mast, wire) in enumerate(zip(masts, every, strict=True)) if wire}
        clamps = [np.mod(mast + 0.5 * e * wire.length, P) for mast, wire in self._stitches.values() for e in (-1, 1)]
        self._carrier_at = _distinct(np.concatenate((at[hangs == CARRIER], clamps)), P)
        n = self._carrier_at.size
        ahead = np.append(self._carrier_at[1:], self._carrier_at[0] + P)
        self._carrier_wires = [
            _eased(line.carrier, 0.5 * (a + b), self._stitches.values(), P)
            for a, b in zip(self._carrier_at, ahead, strict=True)
        ]
        dofs: list[tuple[int, int, int, int]] = [
            (2 * i, 2 * i + 1, 2 * j, 2 * j + 1) for i, j in zip(range(n), [*range(1, n), 0], strict=True)
        ]
        wires, lengths = list(self._carrier_wires), list(ahead - self._carrier_at)
        self._dof = np.zeros(at.size, dtype=np.int64)
        on_carrier = hangs == CARRIER
        self._dof[on_carrier] = 2 * _numbers(self._carrier_at, at[on_carrier], P)
        count, clamped = 2 * n, []
        self._strands: list[tuple[Array, Wire, list[tuple[int, int, int, int]]]] = []
        for s, (mast, stitch) in self._stitches.items():
            own = np.flatnonzero(hangs == s)
            offset = np.mod(at[own] - mast + 0.5 * P, P) - 0.5 * P
            inner = _distinct(offset, np.inf)
            places = np.concatenate(([-0.5 * stitch.length], inner, [0.5 * stitch.length]))
            ends = 2 * _numbers(self._carrier_at, np.mod(mast + places[[0, -1]], P), P)
            inside = [(count + 1 + 2 * i, count + 2 + 2 * i) for i in range(inner.size)]
            last = count + 1 + 2 * inner.size
            nodes = [(int(ends[0]), count), *inside, (int(ends[1]), last)]
            self._dof[own] = [nodes[1 + i][0] for i in _numbers(inner, offset, np.inf)] if own.size else []
            count = last + 1
            steps = [(*a, *b) for a, b in itertools.pairwise(nodes)]
            self._strands.append((mast + places, stitch.wire, steps))
            dofs += steps
            wires += [stitch.wire] * len(steps)
            lengths += list(np.diff(places))
            clamped += [(int(end), stitch.clamp) for end in ends]
        self.unknowns = count
        self._carrier_dofs = dofs[:n]
        rows, columns, values, load = [], [], [], np.zeros(count)
        for dof, wire, length in zip(dofs, wires, lengths, strict=True):
            K, f = element(wire, float(length), gravity * wire.mass_per_length)
            rows.append(np.repeat(dof, 4))
            columns.append(np.tile(dof, 4))
            values.append(K.ravel())
            np.add.at(load, list(dof), f)
        for end, mass in clamped:
            load[end] -= gravity * mass
        at_rows = (np.concatenate(rows), np.concatenate(columns))
        self._K = Matrix(sparse.coo_array((np.concatenate(values), at_rows), shape=(count, count)))
        self._load = load
        pick = sparse.coo_array((np.ones(at.size), (np.arange(at.size), self._dof)), shape=(at.size, count))
        self._pick = Matrix(pick)

    def equations(self) -> tuple[Matrix, Matrix, Array]:
        """Rows of the balance of every node: of the forces, of heights and slopes, right side."""
        return Matrix(-(self._pick.T @ self.by_force)), self._K, self._load + self._pick.T @ self.known

    def heights(self) -> tuple[Matrix, Matrix, Array]:
        """Heights of the loads by the unknowns: coefficients of the forces, of heights and slopes, known part (m)."""
        return Matrix(self.by_force.shape), self._pick, np.zeros(self.at.size)

    def beam(self, forces: Array, own: Array) -> Strand:
        """Shape of the carrier for solved heights and slopes."""
        del forces
        at = np.append(self._carrier_at, self._carrier_at[0] + self.period)
        weight = self._gravity * self._carrier_wires[0].mass_per_length
        return Strand(at, self._carrier_wires, own[np.array(self._carrier_dofs)], weight, self.period)

    def stitches(self, own: Array) -> tuple[Strand, ...]:
        """Shapes of the stitch wires, in the order of their masts."""
        return tuple(
            Strand(at, [wire] * len(steps), own[np.array(steps)], self._gravity * wire.mass_per_length, self.period)
            for at, wire, steps in self._strands
        )


def _eased(carrier: Wire, place: float, stitches: Iterable[tuple[float, StitchWire]], period: float) -> Wire:
    """Carrier at a place (m) with the tension that the stitch wires below it leave."""
    taken = math.fsum(
        stitch.tension
        for mast, stitch in stitches
        if abs((place - mast + 0.5 * period) % period - 0.5 * period) < 0.5 * stitch.length
    )
    return dataclasses.replace(carrier, tension=carrier.tension - taken) if taken else carrier


def _distinct(at: Array, period: float) -> Array:
    """Places by rising position, each once; what is nearly a period away is at 0."""
    rising = np.unique(np.where(at > period - _SAME, 0.0, at))
    return rising[np.diff(rising, prepend=-np.inf) > _SAME]


def _numbers(nodes: Array, at: Array, period: float) -> Ints:
    """Number of the node at each place."""
    place = np.where(at > period - _SAME, 0.0, at)
    return np.searchsorted(nodes, place - _SAME).astype(np.int64)
