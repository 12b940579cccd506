"""The audit of one ride: matching, books, contact quality, comparison and tracing, put together without ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

from energy_monitor.agreement import Agreement, Entry, SampleTrace, Tolerance
from energy_monitor.books import Books, Meters
from energy_monitor.contact_quality import ContactQuality
from energy_monitor.cycles import AHEAD, Arrival, CycleMatcher, JumpFilter
from energy_monitor.parameters import Parameters
from phil_base.enumerations import FOLLOWING, EnvironmentKind

RIG, COMMAND, CATENARY = 0, 1, 2
STREAMS = ("rig", "command", "catenary")
REFUSED = ("state {} of the rig", "command {}", "state {} of the catenary")

HEARTBEAT = 0.1
"""s, how often the monitor is told the time at least while it runs."""
HELD_UP = 0.4
"""s without being told the time: it did not run, and knows nothing of what went on meanwhile."""
LONGEST_CATCHING_UP = 10.0
"""s that it gets at most to read what waited."""
RESTART = 64
"""Cycles that a stream has to have come to for its cycle 0 to be a new ride's; before, it is sent again."""


class RigSample(NamedTuple):
    """What the audit needs of RigState k: ``header`` has the stamp t_k, ``mode`` a :class:`Mode`."""

    header: Any
    f_tr: float  # N
    v_tr: float  # m/s
    work: float  # J
    impulse: float  # N s
    mode: int


class CommandSample(NamedTuple):
    """What the audit needs of ImpedanceCommand k: forces in N, ``environment`` an :class:`EnvironmentKind`."""

    f_tr: float
    f_predicted: float
    f_cor: float
    f_cat: float
    environment: int


class CatenarySample(NamedTuple):
    """What the audit needs of CatenaryState k, all at t_k."""

    v_cat: float  # m/s
    f_cat: float  # N
    work: float  # J
    impulse: float  # N s
    beside: tuple[float, ...] = ()  # N, contact forces of further pantographs


class Audit:
    """State of the monitor; messages go in with their cycle number, complete cycles come out in order."""

    def __init__(self, parameters: Parameters, objects: Callable[[str], object] = str) -> None:
        """Design the filter and open empty books; ``objects`` is told why a message is refused."""
        self._objects = objects
        contact = parameters.contact
        self.matcher: CycleMatcher[Any] = CycleMatcher(STREAMS, parameters.window)
        self.books = Books(parameters.cycle_time)
        self._quality = partial(
            ContactQuality,
            parameters.cycle_time,
            contact.run_in,
            contact.loss_threshold,
            contact.cutoff,
            contact.order,
            contact.loss_duration,
        )
        self.quality = self._quality()
        self.beside: list[ContactQuality] = []
        """Of further pantographs, in the order of the state of the catenary."""
        self.agreement = Agreement(tolerance_of(parameters))
        self.trace = SampleTrace()
        self._jumps = [JumpFilter() for _ in STREAMS]
        self._jumps_of_books = JumpFilter()
        self._alive: float | None = None
        self.rides = 0
        """How often all streams began anew, without this one being told to."""
        self._begun: list[list[tuple[Any, ...]] | None] = [None for _ in STREAMS]
        self._entries_begun: list[Entry] = []
        self._skips_entries = False
        self.clear()

    def clear(self) -> None:
        """Forget the ride and wait for cycle 0."""
        self.matcher.clear()
        self.books.clear()
        self.quality.clear()
        self.beside = []
        self.agreement.clear()
        self.trace.clear()
        for jumps in self._jumps:
            jumps.clear()
        self._jumps_of_books.clear()
        self._newest_entry = -1
        self._caught_up = -math.inf
        self._begun = [None for _ in STREAMS]
        self._entries_begun = []
        self._skips_entries = False
        self.refused = 0

    def rig(self, cycle: int, sample: RigSample, last: bool) -> bool:
        """Take a state of the rig; tells whether it is a new one, which is in the contact quality now."""
        if self._of_next_ride(RIG, cycle, sample, last) or not self._believes(RIG, cycle):
            return False
        arrival = self.matcher.accept(RIG, cycle, sample)
        if last and arrival in (Arrival.NEW, Arrival.OUT_OF_ORDER):
            self.matcher.finish(cycle)
        if arrival is not Arrival.NEW:
            return False
        # Not only for complete cycles: the force is measured even while the controller is silent.
        self.quality.add(cycle, sample.f_tr)
        return True

    def command(self, cycle: int, sample: CommandSample) -> None:
        """Take a command."""
        if not self._of_next_ride(COMMAND, cycle, sample) and self._believes(COMMAND, cycle):
            self.matcher.accept(COMMAND, cycle, sample)

    def catenary(self, cycle: int, sample: CatenarySample) -> bool:
        """Take a state of the catenary; tells whether it was used."""
        if self._of_next_ride(CATENARY, cycle, sample) or not self._believes(CATENARY, cycle):
            return False
        arrival = self.matcher.accept(CATENARY, cycle, sample)
        if sample.beside and arrival is Arrival.NEW:
            if len(self.beside) != len(sample.beside):
                self.beside = [self._quality() for _ in sample.beside]
            for quality, force in zip(self.beside, sample.beside, strict=True):
                quality.add(cycle, force)
        return arrival in (Arrival.NEW, Arrival.OUT_OF_ORDER)

    def believed(self, entry: Entry) -> None:
        """Take an entry of the controller's books."""
        if self._skips_entries:  # left from the ride before
            if entry.cycle > RESTART:
                return
            self._skips_entries = False
        if entry.cycle <= RESTART < self._newest_entry or self._entries_begun:
            if len(self._entries_begun) < self.matcher.capacity:
                self._entries_begun.append(entry)
            return
        # Its topic may be read before the others: it is held against itself, too.
        expected = max(self.matcher.expected, self._newest_entry + 1)
        if not self._jumps_of_books.believes(entry.cycle, expected):
            self._refuse("the controller's entry {}", entry.cycle, expected)
            return
        self._newest_entry = max(self._newest_entry, entry.cycle)
        self.agreement.theirs(entry)

    def _of_next_ride(self, stream: int, cycle: int, *sample: Any) -> bool:
        """Keep a message back that belongs to the next ride, until every stream has begun it; then begin it here.

        All nodes go back to cycle 0 when they are reset; what waits here of the ride before is read first. A stream
        that only sends again what it has sent comes back to where it was: then it is taken as that.
        """
        begun, newest = self._begun[stream], self.matcher.newest[stream]
        if begun is None:
            if cycle != 0 or newest <= RESTART:
                return False
            begun = self._begun[stream] = []
        elif cycle > newest or len(begun) >= self.matcher.capacity:
            for number, *again in begun:
                self.matcher.accept(stream, number, again[0])
            self._begun[stream] = None
            return False
        begun.append((cycle, *sample))
        if all(self._begun):
            self._begin()
        return True

    def _begin(self) -> None:
        """Begin the ride whose first messages were kept back."""
        streams, entries = self._begun, self._entries_begun
        self.clear()
        self.rides += 1
        self._skips_entries = not entries
        takes: tuple[Callable[..., object], ...] = (self.rig, self.command, self.catenary)
        for take, kept in zip(takes, streams, strict=True):
            for message in kept or ():
                take(*message)
        for entry in entries:
            self.believed(entry)

    def alive(self, now: float) -> None:
        """Note that the monitor runs; ``now`` in s, at least every HEARTBEAT.

        After a gap it was held up itself, and gets as long again to catch up before anything counts as old.
        """
        if self._alive is None:
            self._alive = now
        self._watch(now)

    def _watch(self, now: float) -> None:
        if self._alive is None:  # nobody's heart beats: gaps say nothing
            return
        gap, self._alive = now - self._alive, now
        if gap > HELD_UP:
            self._caught_up = now + min(gap, LONGEST_CATCHING_UP)

    def settle(self, now: float) -> Iterator[tuple[int, Any]]:
        """Book every cycle that is complete by now; gives its number and header after it was booked; ``now`` in s."""
        matcher = self.matcher
        self._watch(now)
        while (cycle := matcher.take(now)) is not None:
            rig: RigSample = matcher.payload(RIG, cycle)
            command: CommandSample = matcher.payload(COMMAND, cycle)
            catenary: CatenarySample = matcher.payload(CATENARY, cycle)
            of_catenary = command.environment == EnvironmentKind.CATENARY
            counted = of_catenary and rig.mode in FOLLOWING
            if counted:
                self.books.add(rig.f_tr, rig.v_tr, catenary.f_cat, catenary.v_cat)
            self.books.read(Meters(rig.work, catenary.work, rig.impulse, catenary.impulse), counted)
            if not of_catenary:
                self.agreement.close(cycle)
            # What makes up for another environment's error is no business of the catenary.
            f_cor = command.f_cor if of_catenary else 0.0
            self.trace.add(cycle, rig.f_tr, command._replace(f_cor=f_cor)[:4], catenary.f_cat)
            yield cycle, rig.header

    def entry(self, cycle: int) -> Entry:
        """Give both books as they are after ``cycle``."""
        books = self.books
        return Entry(
            cycle,
            books.delta_e,
            books.delta_p,
            books.delta_work,
            books.delta_impulse,
            books.exchanged_energy,
            books.exchanged_momentum,
        )

    def stalled(self, now: float, age_limit: float) -> bool:
        """Tell whether no cycle became complete for ``age_limit`` s (``now`` in s) although the ride goes on."""
        age = self.matcher.age(now)
        return age is not None and min(age, now - self._caught_up) > age_limit and not self.matcher.finished

    def complaints(self, now: float, age_limit: float) -> list[str]:
        """Say in words what is wrong with the ride so far; time in which the monitor did not run does not count."""
        self._watch(now)
        matcher, agreement, trace = self.matcher, self.agreement, self.trace
        found = []
        if self.stalled(now, age_limit):
            age = matcher.age(now)
            found.append(f"no complete cycle for {age:.1f} s, waiting for cycle {matcher.next}")
        for name, count, cycles in zip(STREAMS, matcher.missing, matcher.missing_cycles, strict=True):
            if count:
                more = ", ..." if count > len(cycles) else ""
                found.append(f"{count} missing from {name} (cycles {', '.join(map(str, cycles))}{more})")
        if not agreement.agrees:
            found.append(
                f"books disagree with the controller's since cycle {agreement.first_disagreement}: "
                f"dE by {agreement.worst_energy:.3g} J, dp by {agreement.worst_momentum:.3g} N s at worst"
            )
        if trace.broken:
            found.append(f"{trace.reason} in {trace.broken} cycles, first in cycle {trace.first_broken}")
        return found

    def _believes(self, stream: int, cycle: int) -> bool:
        if self._jumps[stream].believes(cycle, self.matcher.expected):
            return True
        self._refuse(REFUSED[stream], cycle, self.matcher.expected)
        return False

    def _refuse(self, what: str, cycle: int, expected: int) -> None:
        self.refused += 1
        self._objects(f"{what.format(cycle)} was refused: more than {AHEAD} cycles ahead of {expected}")


def tolerance_of(parameters: Parameters) -> Tolerance:
    """Take the tolerance out of the parameters."""
    group = parameters.tolerance
    return Tolerance(group.energy, group.momentum, group.relative)
