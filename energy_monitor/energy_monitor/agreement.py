"""Does the controller believe what its messages say? Two books of one ride are compared, and samples are traced."""

from __future__ import annotations

import math
from dataclasses import dataclass

KEPT = 5000
"""Entries that either side may be ahead of the other: a subscription's queue, should it be read first."""


@dataclass(frozen=True)
class Tolerance:
    """Allowed difference of two books: absolute in J and N s, plus ``relative`` times what was exchanged."""

    energy: float
    momentum: float
    relative: float


@dataclass(frozen=True)
class Entry:
    """One line of both books: cycle number; dE (J) and dp (N s) by sums and as accumulated; what was exchanged."""

    cycle: int
    delta_e: float
    delta_p: float
    delta_work: float
    delta_impulse: float
    exchanged_energy: float
    exchanged_momentum: float


class Agreement:
    """Compares the monitor's books with those of another node, cycle by cycle, whichever comes first.

    Both books of energy have to fit, and both of momentum; what is kept is the larger difference of the two.
    """

    def __init__(self, tolerance: Tolerance) -> None:
        """Start with nothing compared."""
        self.tolerance = tolerance
        self.clear()

    def clear(self) -> None:
        """Forget the ride."""
        self.compared = 0
        self.closed_at: int | None = None
        """Cycle from which on the other node's book is about something else."""
        self.disagreements = 0
        self.first_disagreement: int | None = None
        self.energy_difference = 0.0
        self.momentum_difference = 0.0
        self.worst_energy = 0.0
        self.worst_momentum = 0.0
        self._ours: dict[int, Entry] = {}
        self._theirs: dict[int, Entry] = {}

    def ours(self, entry: Entry) -> None:
        """Take an entry of the monitor's own book."""
        self._take(entry, self._ours, self._theirs, swap=False)

    def theirs(self, entry: Entry) -> None:
        """Take an entry of the other node's book."""
        self._take(entry, self._theirs, self._ours, swap=True)

    def close(self, cycle: int) -> None:
        """Compare nothing from this cycle on: the other book goes on with another environment than the catenary."""
        if self.closed_at is None:
            self.closed_at = cycle

    @property
    def agrees(self) -> bool:
        """True as long as no compared pair differed by more than the tolerance."""
        return self.disagreements == 0

    def _take(self, entry: Entry, mine: dict[int, Entry], others: dict[int, Entry], *, swap: bool) -> None:
        if self.closed_at is not None and entry.cycle >= self.closed_at:
            return
        other = others.pop(entry.cycle, None)
        if other is not None:
            self._compare(*((other, entry) if swap else (entry, other)))
            return
        mine[entry.cycle] = entry
        if len(mine) > KEPT:
            del mine[next(iter(mine))]

    def _compare(self, ours: Entry, theirs: Entry) -> None:
        tolerance = self.tolerance
        energy = max(abs(ours.delta_e - theirs.delta_e), abs(ours.delta_work - theirs.delta_work))
        momentum = max(abs(ours.delta_p - theirs.delta_p), abs(ours.delta_impulse - theirs.delta_impulse))
        self.compared += 1
        self.energy_difference, self.momentum_difference = energy, momentum
        self.worst_energy = max(self.worst_energy, energy)
        self.worst_momentum = max(self.worst_momentum, momentum)
        fits = (
            energy <= tolerance.energy + tolerance.relative * ours.exchanged_energy
            and momentum <= tolerance.momentum + tolerance.relative * ours.exchanged_momentum
        )
        if not fits:
            self.disagreements += 1
            if self.first_disagreement is None:
                self.first_disagreement = ours.cycle


class SampleTrace:
    """Follows the force through the loop: nobody may work with a sample of another cycle unknowingly.

    The command must carry the rig's F_tr of its own cycle, its F_cat must be the force predicted for the next instant
    plus F_cor (3.45), and the force on the catenary must be the F_cat of the command of the cycle before. Each cycle
    that breaks one of these is counted.
    """

    def __init__(self) -> None:
        """Start with nothing traced."""
        self.clear()

    def clear(self) -> None:
        """Forget the ride."""
        self.broken = 0
        self.first_broken: int | None = None
        self.reason = ""
        self._cycle = -1
        self._f_cat = 0.0

    def add(
        self, cycle: int, rig_f_tr: float, command: tuple[float, float, float, float], catenary_f_cat: float
    ) -> bool:
        """Check cycle k, in N: F_tr of the rig; F_tr, forecast, F_cor, F_cat of the command; F_cat on the wire."""
        f_tr, f_predicted, f_cor, f_cat = command
        reason = ""
        if not same(f_tr, rig_f_tr):
            reason = "the command was computed from another force than the rig's"
        elif not same(f_cat, f_predicted + f_cor):
            reason = "f_cat is not f_predicted + f_cor"
        elif self._cycle == cycle - 1 and cycle > 0 and not same(catenary_f_cat, self._f_cat):
            reason = "the catenary felt another force than the command's"
        self._cycle, self._f_cat = cycle, f_cat
        if not reason:
            return True
        self.broken += 1
        if self.first_broken is None:
            self.first_broken, self.reason = cycle, reason
        return False


def same(a: float, b: float) -> bool:
    """Tell whether two copies of a force in N are the same but for the rounding of one addition."""
    return math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-9)
