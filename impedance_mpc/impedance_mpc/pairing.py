"""Pairs the rig's and the catenary's states of one cycle; no ROS."""

from __future__ import annotations

from enum import Enum
from typing import Generic, TypeVar

from phil_base.cycle_counts import CycleCounts

R = TypeVar("R")
C = TypeVar("C")
S = TypeVar("S")

LONGEST = 1000
"""Cycles that a state may be ahead of the one that stands next, 2 s at 500 Hz: also bounds what is kept."""


class Arrival(Enum):
    """What an arriving state is."""

    NEW = "new"
    REPEATED = "repeated"
    STALE = "stale"
    AHEAD = "ahead"
    """Cycles are missing before it: kept aside until the stream goes on from it, or does not."""
    REFUSED = "refused"
    """More than `LONGEST` cycles ahead."""


class Stream(Generic[S]):
    """States of one sender, in order; ``front`` is the cycle after the newest one taken.

    ``refused`` counts strays, ``swapped`` states that came before the one that they follow; ``counts`` has what
    was late, lost, doubled and swapped among the states that were no strays.

    A sender sends its cycles without a gap. A state that is ahead of the next one is a stray, unless the very next
    message is its successor: then the stream has gone on there and what lies between is lost. If what lies between is
    one state that comes first of all, the two were swapped and none is lost. Should a nearer one come
    all the same, before anybody has used the farther ones, these were strays or are from before a reset.
    """

    def __init__(self) -> None:
        self.states: dict[int, S] = {}
        self.refused = 0
        self.swapped = 0
        self.front = 0
        self.counts = CycleCounts()
        self._ahead: tuple[int, S] | None = None

    def clear(self) -> None:
        """Expect cycle 0."""
        self.states.clear()
        self.refused = self.swapped = self.front = 0
        self.counts.clear()
        self._ahead = None

    def add(self, cycle: int, state: S, expected: int) -> Arrival:
        """Take the state of ``cycle``, when ``expected`` is the oldest cycle that anybody still wants."""
        if cycle > expected + LONGEST:
            self.refused += 1
            return Arrival.REFUSED
        ahead, self._ahead, counts = self._ahead, None, self.counts
        front = max(self.front, expected)
        follows = ahead is not None and front < cycle == ahead[0] + 1
        if ahead is not None and follows:
            counts.take(ahead[0])
            if ahead[0] == front:
                self.swapped += 1
                counts.swapped += 1
            self.states[ahead[0]] = ahead[1]
        elif ahead is not None and cycle == front == ahead[0] - 1:
            # Perhaps these two were swapped: then the next one is the successor of the one that is kept aside.
            self._ahead = ahead
        elif ahead is not None:
            self.refused += 1
        if cycle < expected:
            counts.late += counts.take(cycle)
            return Arrival.REPEATED if cycle == expected - 1 else Arrival.STALE
        if cycle > front and not follows:
            self._ahead = (cycle, state)
            return Arrival.AHEAD
        if cycle < front and cycle not in self.states:
            farther = [number for number in self.states if number > cycle]
            for number in farther:
                del self.states[number]
            self.refused += len(farther)
            counts.rewind(cycle)
            front = cycle
        self.states[cycle] = state
        self.front = max(front, cycle + 1)
        if cycle == counts.next:
            counts.next += 1
        else:
            counts.odd(cycle)
        return Arrival.NEW

    def drop_until(self, cycle: int) -> None:
        """Forget the states up to and including ``cycle``."""
        for number in [number for number in self.states if number <= cycle]:
            del self.states[number]


class CyclePairs(Generic[R, C]):
    """Gives the pairs (k, rig state, catenary state) in order, each cycle once; ``missing`` counts lost rig states.

    If the rig skips a cycle, its state never comes, no command is sent for it and so the catenary cannot get beyond
    the state that stands next: then the newer rig state is paired with that one and the catenary bridges the gap when
    it gets the command.
    """

    def __init__(self) -> None:
        self.next = 0
        self.missing = 0
        self._rig: Stream[R] = Stream()
        self._catenary: Stream[C] = Stream()
        self.of_rig, self.of_catenary = self._rig.counts, self._catenary.counts

    @property
    def swapped(self) -> int:
        """States that came before the one that they follow, and were taken behind it."""
        return self._rig.swapped + self._catenary.swapped

    @property
    def waits_for_catenary(self) -> bool:
        """Tell whether a state of the rig waits for the one of the catenary that answers the last command."""
        return self.next > 0 and self.lacks == "catenary"

    @property
    def refused(self) -> int:
        """States that were too far ahead, or ahead of a stream that did not go on there."""
        return self._rig.refused + self._catenary.refused

    def expected(self, sender: str) -> int:
        """Give the cycle that would continue the states of ``sender``, rig or catenary."""
        return max(self.next, (self._rig if sender == "rig" else self._catenary).front)

    @property
    def lacks(self) -> str:
        """Give whose state is missing: rig or catenary when only the other's has come, else both."""
        rigs, wires = bool(self._rig.states), bool(self._catenary.states)
        return "both" if rigs is wires else "catenary" if rigs else "rig"

    def clear(self) -> None:
        """Wait for cycle 0 again."""
        self.next = self.missing = 0
        self._rig.clear()
        self._catenary.clear()

    def add_rig(self, cycle: int, state: R) -> Arrival:
        """Take the rig's state of ``cycle``; REPEATED is the one that was answered last (its command got lost)."""
        return self._rig.add(cycle, state, self.next)

    def add_catenary(self, cycle: int, state: C) -> Arrival:
        """Take the catenary's state of ``cycle``; a repetition of the last or of a waiting one changes nothing."""
        return self._catenary.add(cycle, state, self.next)

    def take(self) -> tuple[int, R, C] | None:
        """Give the next pair, or None as long as one of the two is to come."""
        rigs, wires = self._rig.states, self._catenary.states
        while rigs and wires:
            cycle = min(rigs)
            partner = cycle if cycle in wires else None
            if partner is None and cycle > self.next:
                partner = max((number for number in wires if number < cycle), default=None)
            if partner is None and min(wires) <= cycle:
                return None
            rig = rigs.pop(cycle)
            # Without a partner the catenary has gone on behind this cycle, which is lost.
            self.missing += cycle - self.next + (partner is None)
            self.next = cycle + 1
            if partner is not None:
                catenary = wires[partner]
                self._catenary.drop_until(cycle)
                return cycle, rig, catenary
        return None
