"""Completeness and age of the cycles: streams of messages are matched by their cycle number.

Complete cycles are handed out in order. A cycle is given up, and counts as missing in every stream that did not deliver
it, when none of these can deliver it any more: each of them has gone on, by itself, or the ride's last cycle is
complete. How far another stream is ahead says nothing: who was held up is handed what waited topic by topic. So any
interleaving of streams that are in order leads to the same counts.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from enum import IntEnum
from typing import Generic, TypeVar

from phil_base.cycle_counts import CycleCounts

T = TypeVar("T")

AHEAD = 1000
"""Cycles that a message may be ahead of what is expected next; beyond, it is a stray one or the stream jumped."""
CONFIRMED = 50
"""Successive messages beyond AHEAD, each ahead of the one before, that show a jump of the stream."""
REMEMBERED = 8
"""Missing cycle numbers that are kept for people, per stream."""
GAPS = 1000
"""Gaps that are kept, per stream, to tell what comes too late from what comes twice."""
CAPACITY = 15_000
"""Messages of a stream that wait for the others at most, three times a subscription's queue; then the oldest cycle is
given up though it might still come: memory has an end."""


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

    def __init__(self, streams: Sequence[str], window: int, capacity: int = CAPACITY) -> None:
        """Match the named ``streams``.

        What a stream has left out it may still deliver within its next ``window`` cycles; of each stream at most
        ``capacity`` messages wait.

        Raises
        ------
        ValueError
            No streams, a window below 2, or no room for a window.
        """
        if not streams or window < 2:
            raise ValueError("at least one stream and a window of 2 cycles are needed")
        self.streams = tuple(streams)
        self.counts = tuple(CycleCounts() for _ in streams)
        """What was late, lost, doubled and swapped, by stream."""
        self.window = window
        self.capacity = max(capacity, 2 * window)
        self.clear()

    def clear(self) -> None:
        """Wait for cycle 0 again."""
        count = len(self.streams)
        for counts in self.counts:
            counts.clear()
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
        self._waiting: list[dict[int, T]] = [{} for _ in range(count)]
        self._gaps: list[deque[tuple[int, int]]] = [deque(maxlen=GAPS) for _ in range(count)]
        self._taken: tuple[int, list[T]] = (-1, [])

    def accept(self, stream: int, cycle: int, payload: T) -> Arrival:
        """Take the message of ``cycle`` from ``stream`` (index into ``streams``); NEW and OUT_OF_ORDER are kept."""
        waiting, counts = self._waiting[stream], self.counts[stream]
        if cycle == counts.next:
            counts.next += 1
            first = True
        else:
            first = counts.odd(cycle)
        if cycle in waiting:
            self.duplicates += 1
            return Arrival.DUPLICATE
        if cycle < self.next:
            counts.late += first
            if any(first <= cycle < end for first, end in self._gaps[stream]):
                self.stale += 1
                return Arrival.STALE
            self.duplicates += 1
            return Arrival.DUPLICATE
        waiting[cycle] = payload
        if cycle < self.newest[stream]:
            self.out_of_order += 1
            return Arrival.OUT_OF_ORDER
        self.newest[stream] = cycle
        return Arrival.NEW

    def take(self, now: float) -> int | None:
        """Give the next complete cycle, or None; ``now`` in s on any clock that runs on, for :meth:`age`."""
        while not self._is_complete(self.next):
            if not self._is_lost():
                return None
            self._give_up()
        cycle = self.next
        self._taken = (cycle, [waiting.pop(cycle) for waiting in self._waiting])
        self.next += 1
        self.complete += 1
        self.completed_at = now
        return cycle

    def payload(self, stream: int, cycle: int) -> T:
        """Give what ``stream`` delivered for the cycle that :meth:`take` has just handed out.

        Raises
        ------
        KeyError
            It was another cycle.
        """
        if cycle != self._taken[0]:
            raise KeyError(f"{self.streams[stream]}: cycle {cycle}")
        return self._taken[1][stream]

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
        # A plain loop: this is asked for every message, and a generator costs more than what it goes through.
        for waiting in self._waiting:  # noqa: SIM110
            if cycle not in waiting:
                return False
        return True

    @property
    def _is_over(self) -> bool:
        """Whether the ride's last cycle is complete, and not the next one: what lies between will not come."""
        return self.last is not None and self.next < self.last and self._is_complete(self.last)

    @property
    def _is_full(self) -> bool:
        for waiting in self._waiting:  # noqa: SIM110
            if len(waiting) > self.capacity:
                return True
        return False

    def _is_lost(self) -> bool:
        """Tell whether every stream that lacks the next cycle has gone on without it."""
        cycle, latest = self.next, self.next + self.window
        for stream, waiting in enumerate(self._waiting):
            if cycle not in waiting and self.newest[stream] < latest:
                return self._is_over or self._is_full
        return True

    def _give_up(self) -> None:
        """Give up the next cycle, and those behind it of which nothing has come; a jump is not walked through."""
        count = 1
        held = [waiting for waiting in self._waiting if waiting]
        # A stream in order has its oldest message first: only if that is farther off can there be a jump.
        if held and min(next(iter(waiting)) for waiting in held) > self.next + 1:
            end = min(map(min, held))
            if not (self._is_over or self._is_full):
                end = min(end, min(self.newest) - self.window + 1)
            count = max(1, end - self.next)
        self.incomplete += count
        for stream, waiting in enumerate(self._waiting):
            if waiting.pop(self.next, None) is None:
                self._miss(stream, count)
        self.next += count

    def _miss(self, stream: int, count: int) -> None:
        self.missing[stream] += count
        known, gaps, first = self.missing_cycles[stream], self._gaps[stream], self.next
        known.extend(range(first, first + min(count, REMEMBERED - len(known))))
        if gaps and gaps[-1][1] == first:
            first = gaps.pop()[0]
        gaps.append((first, self.next + count))
