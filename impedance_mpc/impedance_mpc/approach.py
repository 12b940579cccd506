"""How a gap between drive and wire is closed without a bump, in position and in velocity."""

from __future__ import annotations

import math

GENTLE = 10.0
"""m/s^2, acceleration with which a difference in velocity is taken away: a fifth of what a ride has anyway."""


class Approach:
    """Offset of the target from the wire: from a gap and its rate at t = 0 to zero.

        offset(t) = gap (1 + cos(pi t / T)) / 2 + rate t (1 - t / T_v)^2,    T_v = 4 |rate| / 10 m/s^2, at most T

    At t = 0 the target wire + offset has the drive's own position and velocity; from t = T on it is the wire, with the
    wire's velocity. A difference in velocity is gone much earlier than one in position, or it would carry the drive
    away from the wire for all that time. ``duration`` is T and ``ts`` the cycle, in s. T = 0 closes the gap at once.
    """

    def __init__(self, duration: float, ts: float) -> None:
        self._duration, self._ts = duration, ts
        self.clear()

    def clear(self) -> None:
        """Have no gap."""
        self._gap = self._rate = self._time = 0.0
        self._braking = 0.0

    def restart(self, gap: float, rate: float) -> None:
        """Begin at the present cycle with drive minus wire: gap in m, its rate in m/s."""
        self._gap, self._rate, self._time = gap, rate, 0.0
        self._braking = min(4.0 * abs(rate) / GENTLE, self._duration)

    @property
    def closed(self) -> bool:
        """Whether the target is the wire itself."""
        return self._time >= self._duration

    def advance(self) -> tuple[float, float]:
        """Give the offset (m) and its rate (m/s) at the present cycle and go on to the next one."""
        t, end = self._time, self._duration
        if t >= end:
            return 0.0, 0.0
        self._time += self._ts
        phase = math.pi * t / end
        offset = 0.5 * self._gap * (1.0 + math.cos(phase))
        drift = -0.5 * self._gap * math.pi / end * math.sin(phase)
        if t < self._braking:
            s = t / self._braking
            offset += self._rate * t * (1.0 - s) ** 2
            drift += self._rate * (1.0 - s) * (1.0 - 3.0 * s)
        return offset, drift
