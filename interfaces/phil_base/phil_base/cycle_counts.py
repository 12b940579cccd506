"""Late, lost, doubled, swapped: what the cycle numbers of one input of a node say of its messages."""

from __future__ import annotations

from bisect import bisect_right

GAPS = 1000
"""Gaps that are kept to tell what comes late from what comes twice; what is missing in older ones stays lost."""


class CycleCounts:
    """Counts of the messages of one input that were used, by cycle number; cycles are sent in order, from 0.

    Of n messages that were used d cycles have come: n - d are ``doubled``, the d and the ``lost`` make all the cycles
    below ``next``, and ``swapped`` of the d came behind a later one. ``late`` of the d came when their cycle was over;
    that is the owner's to know and to count.

    The usual message must cost nothing, so the owner asks first::

        if cycle == counts.next:
            counts.next += 1
        else:
            counts.odd(cycle)
    """

    __slots__ = ("_ends", "_firsts", "doubled", "late", "lost", "next", "swapped")

    def __init__(self) -> None:
        self.clear()

    def clear(self) -> None:
        """Expect cycle 0."""
        self.next = 0
        self.late = self.lost = self.doubled = self.swapped = 0
        self._firsts: list[int] = []  # of the gaps, in order: first cycle that has not come, and the next that has
        self._ends: list[int] = []

    def take(self, cycle: int) -> bool:
        """Count a message; tells whether it is the first of its cycle."""
        if cycle == self.next:
            self.next = cycle + 1
            return True
        return self.odd(cycle)

    def odd(self, cycle: int) -> bool:
        """Count a message whose cycle is not ``next``; tells whether it is the first of its cycle."""
        if cycle >= self.next:
            self.skip(cycle)
            self.next = cycle + 1
            return True
        at = bisect_right(self._firsts, cycle) - 1
        if at < 0 or cycle >= self._ends[at]:
            self.doubled += 1
            return False
        self._fill(at, cycle)
        self.lost -= 1
        self.swapped += 1
        return True

    def skip(self, cycle: int) -> None:
        """Go on at ``cycle`` (it has not come yet): what lies between is lost, unless it comes later."""
        self.lost += cycle - self.next
        self._firsts.append(self.next)
        self._ends.append(cycle)
        self.next = cycle
        if len(self._firsts) > GAPS:
            del self._firsts[0], self._ends[0]

    def rewind(self, cycle: int) -> None:
        """Go back to ``cycle``: what came of it and of later ones belonged to another ride, or to none."""
        while self._ends and self._ends[-1] > cycle:
            first, end = self._firsts.pop(), self._ends.pop()
            self.lost -= end - max(first, cycle)
            if first < cycle:
                self._firsts.append(first)
                self._ends.append(cycle)
        self.next = min(self.next, cycle)

    def _fill(self, at: int, cycle: int) -> None:
        """Take a cycle out of a gap, which gets shorter, falls into two, or is gone."""
        first, end = self._firsts[at], self._ends[at]
        left = [(first, cycle)] if first < cycle else []
        right = [(cycle + 1, end)] if cycle + 1 < end else []
        self._firsts[at : at + 1] = [gap[0] for gap in left + right]
        self._ends[at : at + 1] = [gap[1] for gap in left + right]

    def __str__(self) -> str:
        """Give the counts in words."""
        return f"late {self.late}, lost {self.lost}, doubled {self.doubled}, swapped {self.swapped}"
