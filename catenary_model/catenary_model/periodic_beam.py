"""A tensioned beam under point loads that repeat themselves, at rest, in closed form.

Point loads P_i per period L whose sum is balanced by a uniform load (the weight) bend a tensioned beam
T W'' - EI W'''' into W(zeta) = W_0 + sum P_i g(zeta - zeta_i), with the periodic Green's function

    g(r) = (1/T) (r^2/(2 L) - r/2 + L/12) - (lambda/(2 T)) sum_j exp(-|r + j L|/lambda),  0 <= r < L,  lambda^2 = EI/T.

The first term is the string, the second rounds its kink. A uniform load has no part in g, whose mean is zero but for
the rounding: it is what balances the points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Wire

Array = NDArray[np.float64]


def _wrapped(r: Array, period: float) -> Array:
    """Remainder of r in [0, period); np.mod alone gives the period itself for -1e-17."""
    s = np.mod(r, period)
    return np.where(s >= period, 0.0, s)


def string_green(r: Array, period: float, tension: float) -> tuple[Array, Array]:
    """Periodic Green's function of a string (m/N) and its slope (1/N) at distance r (m) ahead of the load."""
    s = _wrapped(r, period)
    return (s * s / (2 * period) - s / 2 + period / 12) / tension, (s / period - 0.5) / tension


def green(r: Array, period: float, wire: Wire) -> tuple[Array, Array]:
    """Periodic Green's function g of a beam under tension (m/N) and its slope (1/N) at distance r (m) ahead."""
    value, slope = string_green(r, period, wire.tension)
    lam = wire.bending_length
    s = _wrapped(r, period)
    images = 2 * wire.tension * -np.expm1(-period / lam)
    behind, ahead = np.exp(-s / lam) / images, np.exp(-(period - s) / lam) / images
    return value - lam * (behind + ahead), slope + behind - ahead


class PeriodicBeam:
    """Shape of one wire under its weight and balanced point loads; evaluating it costs nothing per load.

    Between two neighbouring loads the wire is a parabola plus two decaying exponentials, so the sum over all loads is
    taken once, here, and not again at every point.

    Attributes: `wire`, `period` (m), `at` (m, rising, within one period) and `load` (N, up, point loads without the
    weight of the wire), `height` W_0 (m).
    """

    def __init__(self, wire: Wire, period: float, at: Array, load: Array, height: float) -> None:
        """Sum the loads (any order, positions in [0, period))."""
        order = np.argsort(at, kind="stable")
        self.wire, self.period, self.height = wire, period, height
        self.at: Array = np.asarray(at, dtype=np.float64)[order]
        self.load: Array = np.asarray(load, dtype=np.float64)[order]
        if not self.at.size:
            return
        distance = self.at[:, None] - self.at[None, :]
        value, slope = string_green(distance, period, wire.tension)
        self._value = height + value @ self.load
        self._slope = slope @ self.load
        self._bend = float(self.load.sum()) / (period * wire.tension)
        lam = wire.bending_length
        scale = self.load / (2 * wire.tension * -np.expm1(-period / lam))
        self._behind = np.exp(-_wrapped(distance, period) / lam) @ scale
        self._ahead = np.exp(-_wrapped(-distance, period) / lam) @ scale

    def _parts(self, zeta: Array) -> tuple[NDArray[np.intp], Array, Array, Array]:
        """Interval, distance from its left load (m), and what both exponentials are worth there (1)."""
        s = _wrapped(np.asarray(zeta, dtype=np.float64), self.period)
        # compared before anything is subtracted: on a load it is the load's right side that counts, without rounding
        after = np.searchsorted(self.at, s, side="right")
        # of several loads at one place k is the last and `following` the first: their sums hold all of that place
        k, following = (after - 1) % self.at.size, after % self.at.size
        left = s - self.at[k] + np.where(after == 0, self.period, 0.0)
        right = self.at[following] - s + np.where(after == self.at.size, self.period, 0.0)
        lam = self.wire.bending_length
        return k, left, self._behind[k] * np.exp(-left / lam), self._ahead[following] * np.exp(-right / lam)

    def value(self, zeta: Array) -> Array:
        """Height at positions zeta, m."""
        if not self.at.size:
            return np.full(np.shape(zeta), self.height)
        k, left, behind, ahead = self._parts(zeta)
        string = self._value[k] + left * (self._slope[k] + 0.5 * self._bend * left)
        return np.asarray(string - self.wire.bending_length * (behind + ahead))

    def slope(self, zeta: Array) -> Array:
        """Slope at positions zeta, 1."""
        if not self.at.size:
            return np.zeros(np.shape(zeta))
        k, left, behind, ahead = self._parts(zeta)
        return np.asarray(self._slope[k] + self._bend * left + behind - ahead)

    def string(self, zeta: Array) -> tuple[Array, Array, float]:
        """Height (m), slope (1) and curvature (1/m) of a wire of the same loads that does not resist bending."""
        if not self.at.size:
            return np.full(np.shape(zeta), self.height), np.zeros(np.shape(zeta)), 0.0
        k, left, _, _ = self._parts(zeta)
        slope = self._slope[k] + self._bend * left
        return self._value[k] + left * (self._slope[k] + 0.5 * self._bend * left), slope, self._bend
