"""The node: listens to all others, owns nothing, commands nothing, and audits the ride."""

from __future__ import annotations

import phil_node.before_rclpy  # noqa: F401  # isort: skip

from collections.abc import Sequence
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from phil_interfaces.msg import CatenaryState, ConservedQuantities, ContactQuality, ImpedanceCommand, RigState
from rclpy.qos import QoSProfile

from energy_monitor import topics
from energy_monitor.agreement import Entry
from energy_monitor.audit import HEARTBEAT, Audit, CatenarySample, CommandSample, RigSample, tolerance_of
from energy_monitor.limits import chosen, evaluate, verdict
from energy_monitor.parameters import Parameters
from phil_base.guard import finite, objection
from phil_node.base import Diagnosis, PhilNode, leave, run
from phil_node.cdr import Plan
from phil_node.diagnosis import SILENT
from phil_node.qos import CYCLE, CYCLE_KEPT


def _deep(profile: QoSProfile) -> QoSProfile:
    """Deepen a profile: a ride in lockstep may be faster than this node for a while, and nobody waits for it."""
    return QoSProfile(
        history=profile.history, depth=5000, reliability=profile.reliability, durability=profile.durability
    )


DEEP, DEEP_KEPT = _deep(CYCLE), _deep(CYCLE_KEPT)
RIG_NUMBERS = ("w_tr", "v_tr", "f_tr", "work", "impulse")
COMMAND_NUMBERS = ("f_tr", "f_predicted", "f_cor", "f_cat")
CATENARY_NUMBERS = ("w_cat", "speed", "v_cat", "f_cat", "work", "impulse", "companion_force")
INPUTS = (topics.RIG_STATE, topics.COMMAND, topics.CATENARY_STATE)
METERS = ("work_tr", "work_cat", "impulse_tr", "impulse_cat")
BOOK_NUMBERS = ("delta_e", "delta_p", "delta_work", *METERS, "exchanged_energy", "exchanged_momentum")


class MonitorNode(PhilNode[Parameters]):  # type: ignore[misc]
    """Wires the messages to :class:`energy_monitor.audit.Audit`."""

    threads_role = "listen"
    cycle_role = "listen"

    def __init__(self) -> None:
        """Declare the parameters."""
        super().__init__("energy_monitor", Parameters)

    def build(self) -> None:
        """Design the filter, read the limits, connect.

        Raises
        ------
        ValueError
            The table of limits cannot be read or does not have the standard.
        """
        parameters = self.parameters
        self._standard = chosen(parameters.limits.file, parameters.limits.standard)
        self._audit = Audit(parameters, self.timing.refuse)
        self.timing.inputs = dict(zip(INPUTS, self._audit.matcher.counts, strict=True))
        self._quality_message = Plan(ContactQuality, "rig").writer().message
        self._books_message = Plan(ConservedQuantities, "rig").writer().message
        self._initial: Any = None
        self._clear()
        self._quality_out = self.publish_on(ContactQuality, topics.CONTACT_QUALITY)
        self._books_out = self.publish_on(ConservedQuantities, topics.AUDITED)
        self.listen(RigState, topics.RIG_STATE, DEEP, self._on_rig)
        self.listen(ImpedanceCommand, topics.COMMAND, DEEP_KEPT, self._on_command)
        self.listen(ConservedQuantities, topics.BELIEVED, DEEP, self._on_believed)
        # The catenary's initial state may come before this node is active, and belongs to the books.
        self.listen(CatenaryState, topics.CATENARY_STATE, DEEP_KEPT, self._on_catenary, always=True)
        self.every(HEARTBEAT, lambda: self._audit.alive(monotonic()))
        self.time_cycles(parameters.cycle_time)

    def start(self) -> None:
        """Open new books, beginning with the catenary's initial state if it is there already."""
        self._clear()
        if self._initial is not None:
            self._on_catenary(self._initial)

    def reset(self) -> None:
        """Open new books."""
        self.start()

    def changed(self, names: frozenset[str]) -> None:
        """Take a new tolerance."""
        self._audit.agreement.tolerance = tolerance_of(self.parameters)

    def stuck(self) -> bool:
        """Never: who only listens ends no ride."""
        return False

    def signs(self) -> tuple[object, ...]:
        """Give what a new complaint hangs on, and the beginning and the end of a ride."""
        audit, matcher = self._audit, self._audit.matcher
        stalled = audit.stalled(monotonic(), self.parameters.age_limit)
        return stalled, any(matcher.missing), audit.agreement.agrees, bool(audit.trace.broken), matcher.finished

    def silence(self) -> str:
        """Say that nothing comes any more; the rig tells when a ride is over."""
        if self.timing.heard <= SILENT or not self._audit.stalled(monotonic(), self.parameters.age_limit):
            return ""
        return f"nothing comes any more: no message since cycle {self._audit.matcher.next - 1}"

    def diagnose(self) -> Diagnosis:
        """Report completeness, age, agreement, contact and what the rig counted."""
        audit, now = self._audit, monotonic()
        matcher, agreement, books = audit.matcher, audit.agreement, audit.books
        complaints = audit.complaints(now, self.parameters.age_limit)
        if audit.refused:
            complaints += self.timing.refusals
        statistics = audit.quality.statistics
        checks = evaluate(self._standard, statistics, self._speed * 3.6)
        kept = verdict(checks)
        broken = ", ".join(check.name for check in checks if check.ok is False)
        age = matcher.age(now)
        values = {
            "complete cycles": str(matcher.complete),
            "incomplete cycles": str(matcher.incomplete),
            "missing (rig, command, catenary)": ", ".join(map(str, matcher.missing)),
            "duplicates": str(matcher.duplicates),
            "out of order": str(matcher.out_of_order),
            "pending": str(matcher.pending),
            "age of the newest complete cycle s": "-" if age is None else f"{age:.3f}",
            "late commands counted by the rig": str(self._late_commands),
            "dE J": f"{books.delta_e:.6g}",
            "dE share of the exchanged energy": _share(books.delta_e, books.exchanged_energy),
            "dE by accumulated work J": f"{books.delta_work:.6g}",
            "dE by accumulated work, share of the exchanged energy": _share(books.delta_work, books.exchanged_energy),
            "dp N s": f"{books.delta_p:.6g}",
            "dp share of the exchanged momentum": _share(books.delta_p, books.exchanged_momentum),
            "dp by accumulated impulse N s": f"{books.delta_impulse:.6g}",
            "books compared with the controller's": str(agreement.compared),
            "books of another environment since cycle": "-"
            if agreement.closed_at is None
            else str(agreement.closed_at),
            "books that disagree": str(agreement.disagreements),
            "worst difference of dE J": f"{agreement.worst_energy:.3g}",
            "worst difference of dp N s": f"{agreement.worst_momentum:.3g}",
            "cycles with mixed samples": str(audit.trace.broken),
            "contact force N": f"{audit.quality.force:.1f}",
            "contact force mean N": f"{statistics.mean:.1f}",
            "contact force sigma N": f"{statistics.sigma:.1f}",
            "losses of contact": str(statistics.losses),
            # Not a reason to warn: a bad pantograph is a result of the ride, not a fault of the rig.
            f"limits of {self._standard.title}": "-" if kept is None else "kept" if kept else f"exceeded: {broken}",
        }
        for i, quality in enumerate(audit.beside):
            one = quality.statistics
            values[f"companion {i + 1}"] = f"mean {one.mean:.1f} N, sigma {one.sigma:.1f} N, losses {one.losses}"
        if complaints:
            return Diagnosis(DiagnosticStatus.WARN, "; ".join(complaints), values)
        if matcher.complete == 0:
            return Diagnosis(DiagnosticStatus.OK, "waiting for cycle 0", values)
        text = "ride complete, books agree" if matcher.finished else "books agree, no cycle missing"
        return Diagnosis(DiagnosticStatus.OK, text, values)

    def _clear(self) -> None:
        self._audit.clear()
        self._speed = 0.0
        self._late_commands = 0

    def _on_rig(self, message: Any) -> None:
        self.timing.begin()
        f_tr, v_tr, work, impulse = message.f_tr, message.v_tr, message.work, message.impulse
        if not finite(message.w_tr, f_tr, v_tr, work, impulse):
            self._refuse("state {} of the rig", message, RIG_NUMBERS)
            return
        cycle, last = message.cycle, message.last
        if self._audit.rig(cycle, RigSample(message.header, f_tr, v_tr, work, impulse, message.mode), last):
            self._late_commands = message.late_commands
            if last or cycle % self.parameters.quality_decimation == 0:
                self._publish_quality(cycle, message.header)
        self._settle()

    def _on_command(self, message: Any) -> None:
        self.timing.begin()
        forces = message.f_tr, message.f_predicted, message.f_cor, message.f_cat
        if not finite(*forces):
            self._refuse("command {}", message, COMMAND_NUMBERS)
            return
        self._audit.command(message.cycle, CommandSample(*forces, message.environment))
        self._settle()

    def _on_catenary(self, message: Any) -> None:
        shown = message.v_cat, message.f_cat, message.work, message.impulse
        beside = tuple(message.companion_force) if len(message.companion_force) else ()
        valid = finite(message.w_cat, message.speed, *shown, *beside)
        if valid and message.cycle == 0:
            self._initial = message
        if not self.active:
            return
        self.timing.begin()
        if not valid:
            self._refuse("state {} of the catenary", message, CATENARY_NUMBERS)
            return
        if self._audit.catenary(message.cycle, CatenarySample(*shown, beside)):
            self._speed = message.speed
        self._settle()

    def _on_believed(self, message: Any) -> None:
        meters = message.work_tr, message.work_cat, message.impulse_tr, message.impulse_cat
        exchanged = message.exchanged_energy, message.exchanged_momentum
        if not finite(message.delta_e, message.delta_p, message.delta_work, *meters, *exchanged):
            self._refuse("the controller's entry {}", message, BOOK_NUMBERS)
            return
        delta_impulse = message.impulse_tr - message.impulse_cat
        self._audit.believed(
            Entry(message.cycle, message.delta_e, message.delta_p, message.delta_work, delta_impulse, *exchanged)
        )

    def _refuse(self, what: str, message: Any, names: Sequence[str]) -> None:
        self._audit.refused += 1
        self.timing.refused = self._audit.refused
        self.timing.refuse(f"{what.format(message.cycle)} was refused: {objection(message, names)}")

    def _settle(self) -> None:
        audit, timing = self._audit, self.timing
        matcher = audit.matcher
        for cycle, header in audit.settle(monotonic()):
            if cycle % self.parameters.books_decimation == 0 or cycle == matcher.last:
                audit.agreement.ours(audit.entry(cycle))
                self._publish_books(cycle, header)
            timing.end(header, cycle)
            timing.begin()
            if cycle == matcher.last:
                timing.flush(header, cycle)
        timing.missing, timing.stale, timing.refused = sum(matcher.missing), matcher.stale, audit.refused

    def _publish_books(self, cycle: int, header: Any) -> None:
        books, message = self._audit.books, self._books_message
        message.header.stamp = header.stamp
        message.cycle = cycle
        message.e_tr, message.e_cat, message.delta_e = books.e_tr, books.e_cat, books.delta_e
        message.p_tr, message.p_cat, message.delta_p = books.p_tr, books.p_cat, books.delta_p
        message.exchanged_energy = books.exchanged_energy
        message.exchanged_momentum = books.exchanged_momentum
        message.work_tr, message.work_cat, message.impulse_tr, message.impulse_cat = books.accumulated
        message.delta_work = books.delta_work
        self._books_out.publish(self._books_message)

    def _publish_quality(self, cycle: int, header: Any) -> None:
        quality, message = self._audit.quality, self._quality_message
        statistics = quality.statistics
        message.header.stamp = header.stamp
        message.cycle = cycle
        message.samples = statistics.samples
        message.force = quality.force
        message.mean, message.sigma = statistics.mean, statistics.sigma
        message.minimum, message.maximum = statistics.minimum, statistics.maximum
        message.statistical_minimum = statistics.statistical_minimum
        message.statistical_maximum = statistics.statistical_maximum
        message.loss_share, message.losses = statistics.loss_share, statistics.losses
        self._quality_out.publish(self._quality_message)


def _share(part: float, whole: float) -> str:
    return f"{abs(part) / whole:.3e}" if whole > 0.0 else "-"


def main() -> None:
    """Run the monitor until it is shut down."""
    leave(run(MonitorNode))


if __name__ == "__main__":
    main()
