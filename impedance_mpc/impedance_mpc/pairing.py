"""Pairs the rig's and the catenary's states of one cycle; no ROS."""

from __future__ import annotations

from enum import Enum
from typing import Generic, TypeVar

R = TypeVar("R")
C = TypeVar("C")

BACKLOG = 1024
"""Cycles that are kept at most when the other side is silent: 2 s at 500 Hz."""


class Arrival(Enum):
    """What an arriving state is."""

    NEW = "new"
    REPEATED = "repeated"
    STALE = "stale"


class CyclePairs(Generic[R, C]):
    """Gives the pairs (k, rig state, catenary state) in order, each cycle once; ``missing`` counts lost rig states.

    Both streams are in order. If the rig skips a cycle, its state never comes, no command is sent for it and so the
    catenary cannot get beyond the state that stands next: then the newer rig state is paired with that one and the
    catenary bridges the gap when it gets the command.
    """

    def __init__(self) -> None:
        self.next = 0
        self.missing = 0
        self._rig: dict[int, R] = {}
        self._catenary: dict[int, C] = {}

    def clear(self) -> None:
        """Wait for cycle 0 again."""
        self.next = self.missing = 0
        self._rig.clear()
        self._catenary.clear()

    def add_rig(self, cycle: int, state: R) -> Arrival:
        """Take the rig's state of ``cycle``; REPEATED is the one that was answered last (its command got lost)."""
        if cycle < self.next:
            return Arrival.REPEATED if cycle == self.next - 1 else Arrival.STALE
        if cycle not in self._rig:
            self._put(self._rig, cycle, state)
        return Arrival.NEW

    def add_catenary(self, cycle: int, state: C) -> Arrival:
        """Take the catenary's state of ``cycle``; a repetition of the last or of a waiting one changes nothing."""
        if cycle < self.next:
            return Arrival.REPEATED if cycle == self.next - 1 else Arrival.STALE
        if cycle not in self._catenary:
            self._put(self._catenary, cycle, state)
        return Arrival.NEW

    def take(self) -> tuple[int, R, C] | None:
        """Give the next pair, or None as long as one of the two is to come."""
        if not self._rig or not self._catenary:
            return None
        cycle = min(self._rig)
        partner = cycle if cycle in self._catenary else None
        if partner is None and cycle > self.next:
            older = [number for number in self._catenary if number < cycle]
            partner = max(older, default=None)
        if partner is None:
            if min(self._catenary) <= cycle:
                return None
            # The catenary is ahead: this cycle can have no partner any more.
            del self._rig[cycle]
            self.missing += cycle + 1 - self.next
            self.next = cycle + 1
            return self.take()
        self.missing += cycle - self.next
        self.next = cycle + 1
        rig, catenary = self._rig.pop(cycle), self._catenary[partner]
        for number in [number for number in self._catenary if number <= cycle]:
            del self._catenary[number]
        return cycle, rig, catenary

    @staticmethod
    def _put(states: dict[int, R] | dict[int, C], cycle: int, state: R | C) -> None:
        states[cycle] = state  # type: ignore[assignment]
        if len(states) > BACKLOG:
            del states[min(states)]
