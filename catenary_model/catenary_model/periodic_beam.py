"""A tensioned beam under point loads that repeat themselves, at rest, in closed form.

Between point loads P_i, which a uniform load q (the weight) balances, a tensioned beam T W'' - EI W'''' = q is the
parabola of a string through the heights s_i at the loads, less what bending rounds off its kinks:

    W(zeta) = s(zeta) - (lambda/(2 T)) sum_i P_i exp(-|zeta - zeta_i|/lambda),   lambda^2 = EI/T.

The sum runs over all loads of all periods.
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


def _carried(load: Array, decay: Array, round_the_period: float) -> Array:
    """Sum over all loads behind, y_i = decay_(i-1) y_(i-1) + load_i, round a period over which y decays so much."""
    y, total, values = np.zeros(load.size), 0.0, list(zip(np.roll(decay, 1).tolist(), load.tolist(), strict=True))
    for factor, own in values:
        total = factor * total + own
    total /= -np.expm1(-round_the_period)
    for i, (factor, own) in enumerate(values):
        total = factor * total + own
        y[i] = total
    return y


class PeriodicBeam:
    """Shape of one wire under its weight and balanced point loads; evaluating it costs nothing per load.

    Between two neighbouring loads the wire is a parabola plus two decaying exponentials, so the sum over all loads is
    taken once, here, and not again at every point.

    Attributes: `wire`, `period` (m), `at` (m, rising, within one period) and `load` (N, up, point loads without the
    uniform load).
    """

    def __init__(self, wire: Wire, period: float, at: Array, load: Array, string: Array, weight: float) -> None:
        """Take the loads (N) by rising place, the heights (m) of the string there, and the uniform load (N/m, down).

        The loads have to be balanced by the uniform load, and the heights by the loads: `suspension` solves for them.
        Several loads may share a place. Without any load the wire is level at height zero.
        """
        self.wire, self.period = wire, period
        self.at: Array = np.asarray(at, dtype=np.float64)
        self.load: Array = np.asarray(load, dtype=np.float64)
        if not self.at.size:
            return
        gap = np.diff(self.at, append=self.at[:1] + period)
        self._value: Array = np.asarray(string, dtype=np.float64)
        self._bend = weight / wire.tension
        rise = np.roll(self._value, -1) - self._value
        self._slope = np.divide(rise, gap, out=np.zeros(gap.size), where=gap > 0.0) - 0.5 * self._bend * gap
        lam = wire.bending_length
        kink, decay = self.load / (2 * wire.tension), np.exp(-gap / lam)
        self._behind = _carried(kink, decay, period / lam)
        self._ahead = _carried(kink[::-1], np.roll(decay[::-1], -1), period / lam)[::-1]

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
            return np.zeros(np.shape(zeta))
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
            return np.zeros(np.shape(zeta)), np.zeros(np.shape(zeta)), 0.0
        k, left, _, _ = self._parts(zeta)
        slope = self._slope[k] + self._bend * left
        return self._value[k] + left * (self._slope[k] + 0.5 * self._bend * left), slope, self._bend
