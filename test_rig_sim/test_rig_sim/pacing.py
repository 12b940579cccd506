"""The clock of a ride in real time: how many cycles are due, and what time a cycle is stamped with."""

EARLY = 0.05
"""Share of a cycle by which a tick may come early (rounding of the timer)."""


class CycleClock:
    """Relates cycles of a period (s) to the steady clock (s) and to the wall clock (ns).

    The origin is fixed while the ride goes on, so ticks do not drift; only ticks that are given up move it.
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._origin = 0.0
        self._wall_origin = 0
        self.skipped = 0

    def start(self, cycle: int, now: float, wall: int) -> None:
        """Let the interval that begins at ``cycle`` begin now (steady clock in s, wall clock in ns)."""
        self._origin = now - cycle * self._period
        self._wall_origin = wall - round(cycle * self._period * 1e9)

    def due(self, cycle: int, now: float) -> int:
        """Return by how many cycles a ride that stands at ``cycle`` is behind."""
        return int((now - self._origin) / self._period + EARLY) - cycle

    def give_up(self, excess: int) -> None:
        """Leave out ticks: the clock of the ride stood still meanwhile, and its stamps jump by that time."""
        if excess > 0:
            self.skipped += excess
            self._origin += excess * self._period
            self._wall_origin += round(excess * self._period * 1e9)

    def stamp(self, cycle: int) -> int:
        """Return the wall time of a cycle in ns."""
        return self._wall_origin + round(cycle * self._period * 1e9)
