"""Completeness and age of the cycles: streams of messages are matched by their cycle number.

A small ring keeps what has come of the last cycles. Complete cycles are handed out in order; a cycle that is still
incomplete when the ring needs its place, or when the ride's last cycle is complete, is given up and counted as missing
in every stream that did not deliver it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from enum import IntEnum
from typing import Generic, TypeVar

T = TypeVar("T")

AHEAD = 1000
"""Cycles that a message may be ahead of what is expected next; beyond, it is a stray one or the stream jumped."""
CONFIRMED = 50
"""Successive messages beyond AHEAD, each ahead of the one before, that show a jump of the stream."""
REMEMBERED = 8
"""Missing cycle numbers that are kept for people, per stream."""


class Arrival(IntEnum):
    """What a message was: new, new but behind a later one, one that came before, or one of a cycle that is over."""

    NEW = 0
    OUT_OF_ORDER = 1
    DUPLICATE = 2
    STALE = 3


class JumpFilter:
    """Tells a stray cycle number from a real jump of one stream, as after a late start or a reset of this node only."""

    def __init__(self) -> None:
        """Expect no jump."""
        self.clear()

    def clear(self) -> None:
        """Forget the numbers that were not believed."""
        self._run = 0
        self._newest = 0

    def believes(self, cycle: int, expected: int) -> bool:
        """Tell whether a message with this cycle number may be used where ``expected`` comes next."""
        if cycle <= expected + AHEAD:
            self._run = 0
            return True
        self._run = self._run + 1 if 0 < cycle - self._newest <= AHEAD else 1
        self._newest = cycle
        return self._run >= CONFIRMED


class CycleMatcher(Generic[T]):
    """Matches several streams by cycle number, counts what is missing, double, late or out of order."""

    def __init__(self, streams: Sequence[str], window: int) -> None:
        """Match the named ``streams``; a cycle waits for at most ``window`` later cycles.

        Raises
        ------
        ValueError
            No streams, or a window below 2.
        """
        if not streams or window < 2:
            raise ValueError("at least one stream and a window of 2 cycles are needed")
        self.streams = tuple(streams)
        self.window = window
        self.clear()

    def clear(self) -> None:
        """Wait for cycle 0 again."""
        count = len(self.streams)
        self.next = 0
        """First cycle that is neither complete nor given up."""
        self.complete = 0
        self.incomplete = 0
        self.missing = [0] * count
        self.missing_cycles: list[list[int]] = [[] for _ in range(count)]
        self.duplicates = self.out_of_order = self.stale = 0
        self.newest = [-1] * count
        self.last: int | None = None
        self.completed_at: float | None = None
        self._cycle = [[-1] * self.window for _ in range(count)]
        self._payload: list[list[T | None]] = [[None] * self.window for _ in range(count)]
        # complete cycles that had to make room before they were taken, and the one that was taken last of them
        self._ready: deque[tuple[int, list[T | None]]] = deque()
        self._taken: tuple[int, list[T | None]] = (-1, [])

    def accept(self, stream: int, cycle: int, payload: T) -> Arrival:
        """Take the message of ``cycle`` from ``stream`` (index into ``streams``); NEW and OUT_OF_ORDER are kept."""
        slot = cycle % self.window
        seen = self._cycle[stream]
        if seen[slot] == cycle:
            self.duplicates += 1
            return Arrival.DUPLICATE
        if cycle < self.next:
            self.stale += 1
            return Arrival.STALE
        if cycle >= self.next + self.window:
            self._give_up_before(cycle - self.window + 1)
        seen[slot] = cycle
        self._payload[stream][slot] = payload
        if cycle < self.newest[stream]:
            self.out_of_order += 1
            return Arrival.OUT_OF_ORDER
        self.newest[stream] = cycle
        return Arrival.NEW

    def take(self, now: float) -> int | None:
        """Give the next complete cycle, or None; ``now`` in s on any clock that runs on, for :meth:`age`."""
        if self._ready:
            self._taken = self._ready.popleft()
            self.completed_at = now
            return self._taken[0]
        if not self._is_complete(self.next):
            if self.last is None or self.next >= self.last or not self._is_complete(self.last):
                return None
            # The ride is over: nothing that is still missing will come.
            while not self._is_complete(self.next):
                self._give_up()
        cycle = self.next
        self.next += 1
        self.complete += 1
        self.completed_at = now
        return cycle

    def payload(self, stream: int, cycle: int) -> T:
        """Give what ``stream`` delivered for a cycle that :meth:`take` has just handed out.

        Raises
        ------
        KeyError
            The ring does not hold that cycle.
        """
        if cycle == self._taken[0]:
            kept = self._taken[1][stream]
            if kept is not None:
                return kept
        slot = cycle % self.window
        value = self._payload[stream][slot]
        if self._cycle[stream][slot] != cycle or value is None:
            raise KeyError(f"{self.streams[stream]}: cycle {cycle}")
        return value

    def finish(self, last: int) -> None:
        """Say that ``last`` is the ride's last cycle."""
        self.last = last

    @property
    def finished(self) -> bool:
        """True when the last cycle was handed out or given up."""
        return self.last is not None and self.next > self.last

    @property
    def pending(self) -> int:
        """Cycles of the first stream that wait for the other streams."""
        return max(0, self.newest[0] + 1 - self.next)

    @property
    def expected(self) -> int:
        """First cycle that no stream has reached yet."""
        return max(self.next, max(self.newest) + 1)

    def age(self, now: float) -> float | None:
        """Time in s since the newest complete cycle became complete; None before the first."""
        return None if self.completed_at is None else now - self.completed_at

    def _is_complete(self, cycle: int) -> bool:
        slot = cycle % self.window
        return all(seen[slot] == cycle for seen in self._cycle)

    def _give_up(self) -> None:
        slot = self.next % self.window
        self.incomplete += 1
        for stream, seen in enumerate(self._cycle):
            if seen[slot] != self.next:
                self._miss(stream, self.next, 1)
        self.next += 1

    def _give_up_before(self, cycle: int) -> None:
        # Only the ring can hold parts of a cycle; what lies behind it after a jump came from nobody.
        in_ring = min(cycle, self.next + self.window)
        while self.next < in_ring:
            if self._is_complete(self.next):
                slot = self.next % self.window
                self._ready.append((self.next, [payload[slot] for payload in self._payload]))
                self.next += 1
                self.complete += 1
            else:
                self._give_up()
        skipped = cycle - self.next
        if skipped > 0:
            self.incomplete += skipped
            for stream in range(len(self.streams)):
                self._miss(stream, self.next, skipped)
            self.next = cycle

    def _miss(self, stream: int, first: int, count: int) -> None:
        self.missing[stream] += count
        known = self.missing_cycles[stream]
        known.extend(range(first, first + min(count, REMEMBERED - len(known))))
