"""One ride of the closed loop as it goes: the cycle functions of the nodes, one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from time import perf_counter_ns
from typing import TYPE_CHECKING

from catenary_model.sequence import LARGEST_FORCE
from impedance_mpc.controller import EnvironmentReading, RigReading
from phil_base.enumerations import SolverStatus
from phil_base.guard import LARGEST
from phil_loop.events import Action
from phil_loop.observing import Moment
from phil_loop.record import Record
from phil_loop.rows import Rows
from test_rig_sim.cycle import ENDLESS
from test_rig_sim.rig import RigSample

if TYPE_CHECKING:
    from phil_loop.loop import ClosedLoop

FALLBACK = int(SolverStatus.FALLBACK)
AT_ONCE = 10_000
"""Cycles for which there is room from the beginning, at most."""


class Ride:
    """A ride of a loop that stands at its cycle 0, with what is to be done on the way; `ClosedLoop.begin` makes it."""

    def __init__(self, loop: ClosedLoop, due: Mapping[int, tuple[Action, ...]], timed: bool) -> None:
        self.loop = loop
        self.cycle = 0
        """The cycle that comes next."""
        self.over = False
        """Whether there is none."""
        self.stopped = False
        """Whether an observer wants it to end."""
        self.stuck = ""
        """What a node would refuse, so that the ride would stand."""
        self._due, self._timed = due, timed
        last = loop.rig_cycle.last_cycle
        self._rows = Rows(AT_ONCE if last == ENDLESS else min(AT_ONCE, last + 1), len(loop.catenary.companions))

    @property
    def endless(self) -> bool:
        """Whether nothing but an observer or the drive ends it."""
        return self.loop.rig_cycle.last_cycle == ENDLESS

    def run(self, cycles: int | None = None) -> None:
        """Ride on to the end, or for so many cycles if it does not end before.

        Raises
        ------
        RuntimeError
            The loop has begun another ride.
        ValueError
            An event cannot be done.
        """
        if self.loop.going is not self:
            raise RuntimeError("the loop has begun another ride: this one cannot go on")
        if not self.over:
            self.stuck = self._run(None if cycles is None else self.cycle + cycles)

    def record(self) -> Record:
        """Give all cycles up to now."""
        loop, rig = self.loop, self.loop.rig_cycle
        outcome = "stuck" if self.stuck else "stopped" if self.stopped and not rig.last else rig.outcome
        reason = self.stuck or rig.supervisor.reason
        return self._rows.record(loop.ts, outcome, reason, loop.settings, self._timed)

    def _run(self, until: int | None) -> str:
        """Ride; say what a node would refuse if there is such a thing, else nothing."""
        loop, rows, due, timed = self.loop, self._rows, self._due, self._timed
        rig, catenary, commander, observers = loop.rig_cycle, loop.catenary, loop.commander, loop.observers
        supervisor, books = rig.supervisor, commander.books
        signals, point, counter = rig.rig.signals, catenary.state.point, catenary.state.counter
        q, qd, qdd, held = catenary.state.segment
        companions = catenary.companions
        moment = Moment()
        moment.loop = loop
        k = self.cycle
        while k != until:
            if k in due:
                for action in due[k]:
                    action(loop)
            begun = perf_counter_ns()
            state = rig.state
            w, v, _, f, _, work, impulse = point.tolist()
            problem = _unusable(state, w, v, f, work, impulse)
            if problem:
                self.over = True
                return f"state {k} of the {problem}"
            wire = EnvironmentReading(q, qd, qdd, held, w, v, f, work, impulse)
            mode = rig.mode
            answer = commander.answer(
                RigReading(state.w_tr, state.v_tr, state.f_tr, state.reference, state.work, state.impulse), wire, mode
            )
            solved = perf_counter_ns()
            rows.note(k, mode, signals, point, counter, answer, books.totals)
            if len(companions):
                rows.accompany(k, companions)
            for observe in observers:
                moment.cycle, moment.mode, moment.rig, moment.wire, moment.command = k, mode, state, wire, answer
                observe(moment)
            if not abs(answer.f_cat) <= LARGEST_FORCE:
                self.over = True
                return f"command {k}: f_cat = {answer.f_cat:.4g} N"
            resumed = perf_counter_ns()
            catenary.step(answer.f_cat)
            stepped = perf_counter_ns()
            if rig.last or self.stopped:
                if rig.last:
                    supervisor.finish()
                if timed:
                    rows.time(k, solved - begun, stepped - resumed, 0)
                self.over = True
                return ""
            u_tr, u_next = answer.u_tr, answer.u_tr_next
            if supervisor.admissible(u_tr, u_next):
                rig.follow(u_tr, u_next, answer.status == FALLBACK)
            else:
                supervisor.objection(u_tr, u_next)
                rig.bridge(refused=True)
            rows.moved(k, rig.ramp)
            if timed:
                rows.time(k, solved - begun, stepped - resumed, perf_counter_ns() - stepped)
            self.cycle = k = k + 1
        return ""


def _unusable(rig: RigSample, w: float, v: float, f: float, work: float, impulse: float) -> str:
    """Say whose state the controller's node would refuse; empty: neither."""
    if not _plausible(rig.w_tr, rig.v_tr, rig.f_tr, rig.work, rig.impulse):
        return "rig is not finite or out of all proportion"
    if not _plausible(w, v, f, work, impulse):
        return "catenary is not finite or out of all proportion"
    return ""


def _plausible(w: float, v: float, f: float, work: float, impulse: float) -> bool:
    return abs(w) <= LARGEST and abs(v) <= LARGEST and abs(f) <= LARGEST and isfinite(work + impulse)
