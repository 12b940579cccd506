"""What to do with a command by its cycle number: the books of the wire must have every cycle exactly once."""

from __future__ import annotations

import enum
import math

from phil_base.cycle_counts import CycleCounts

LARGEST_FORCE = 1e6
"""N, no contact force: the wire would not come back from where it throws it."""


class Verdict(enum.Enum):
    """Fate of a command."""

    TAKEN = "taken"
    """Step with its force, after as many steps with the last force as `Sequence.missing` says."""
    REPEATED = "repeated"
    """The last command once more: ignored."""
    CONTRADICTED = "contradicted"
    """The last command once more, with another force: somebody else sends commands, too. Ignored, counted."""
    STALE = "stale"
    """A cycle that is over: ignored, counted."""
    REFUSED = "refused"
    """Force is not a finite number or out of all proportion, or a stray that is too far ahead: ignored, counted."""
    BROKEN = "broken"
    """The commands have gone on behind a gap that is too long to bridge, now or before: ignored until `reset`."""


class Sequence:
    """Order of the commands. Cycles missing in between are bridged with the last force, up to `longest` in a row.

    A command that is further ahead is a stray, unless the very next one is its successor: then the gap is real.
    ``counts`` has what was late, lost, doubled and swapped.
    """

    def __init__(self, longest: int) -> None:
        self.longest = longest
        self.counts = CycleCounts()
        self.reset()

    def reset(self) -> None:
        """Expect cycle 0."""
        self.counts.clear()
        self.expected = 0
        self.last_force = 0.0
        self.missing = 0
        self.broken = ""
        self._ahead: int | None = None

    def judge(self, cycle: int, force: float) -> Verdict:
        """Judge a command; on TAKEN, `missing` is the number of cycles to bridge first, with `last_force`."""
        ahead, self._ahead = self._ahead, None
        if cycle < self.expected:
            self.counts.late += self.counts.take(cycle)
            if cycle < self.expected - 1:
                return Verdict.STALE
            # Two forces that are no numbers are not told apart: that one was refused, too.
            differs = abs(force) <= LARGEST_FORCE and force != self.last_force
            return Verdict.CONTRADICTED if differs else Verdict.REPEATED
        if not abs(force) <= LARGEST_FORCE:
            return Verdict.REFUSED
        if self.broken:
            return Verdict.BROKEN
        gap = cycle - self.expected
        if gap > self.longest:
            if ahead is None or cycle != ahead + 1:
                self._ahead = cycle
                return Verdict.REFUSED
            self.counts.skip(ahead)
            self.broken = (
                f"{ahead - self.expected} commands missing before cycle {ahead}, "
                f"at most {self.longest} can be bridged: reset"
            )
            return Verdict.BROKEN
        self.missing = gap
        return Verdict.TAKEN

    def objection(self, cycle: int, force: float) -> str:
        """Say in words why a command was not taken."""
        if self.broken:
            return self.broken
        if not math.isfinite(force):
            return "f_cat is not finite"
        if abs(force) > LARGEST_FORCE:
            return f"f_cat = {force:.4g} N is out of all proportion, at most {LARGEST_FORCE:g} N"
        if cycle == self.expected - 1:
            return "it came before with another f_cat: does a second publisher send commands?"
        return f"it is more than {self.longest} cycles ahead of cycle {self.expected}, which has not come"

    def taken(self, cycle: int, force: float) -> None:
        """Note that the command has been carried out."""
        counts = self.counts
        if cycle == counts.next:
            counts.next += 1
        else:
            counts.odd(cycle)
        self.expected = cycle + 1
        self.last_force = force
