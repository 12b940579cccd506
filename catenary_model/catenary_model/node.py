"""The node `catenary_model`: a contact force in, the motion of the wire out, once a cycle."""

from __future__ import annotations

import phil_node.before_rclpy  # noqa: F401  # isort: skip

from array import array
from time import monotonic

import numpy as np
from phil_interfaces.msg import CatenaryState, ImpedanceCommand, ImpedanceModel, WireShape

from catenary_model import companions
from catenary_model.build import build
from catenary_model.parameters import Parameters
from catenary_model.reach import far_from_nominal
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from catenary_model.sequence import Sequence, Verdict
from phil_node.base import ERROR, OK, WARN, Diagnosis, PhilNode, leave, run
from phil_node.cdr import OpenWriter, Plan
from phil_node.diagnosis import SILENT
from phil_node.qos import CYCLE, CYCLE_KEPT, LATCHED, VIEW

FRAME = "train"
SEGMENT = ("segment_displacement", "segment_velocity", "segment_acceleration", "segment_force")
COMPANIONS = {
    "companion_place": companions.PLACE,
    "companion_force": companions.FORCE,
    "companion_height": companions.HEIGHT,
    "companion_loss": companions.LOST,
}
"""Fields of the state to the columns that the model has of its companions."""
WARM_UP_CYCLES = 20


class CatenaryNode(PhilNode[Parameters]):
    """Listens to impedance_mpc/command; publishes state, impedance_model and wire_shape below its own name."""

    cycle_role = "environment"

    def __init__(self) -> None:
        super().__init__("catenary_model", Parameters)

    def build(self) -> None:
        """Design the model, compile its kernels, publish the reduced model."""
        p = self.parameters
        self.catenary = build(p.config())
        far = far_from_nominal(self.catenary.statics)
        if far:
            self.log.warning(f"{far}: the drive has to reach that far (parameter 'line' = {p.line!r})")
        self.sequence = Sequence(p.max_bridged_cycles)
        self._bridged = 0
        self._ts_ns = round(p.cycle_time * 1e9)
        self._overdue = 0.5 * p.cycle_time
        self._shape_every = p.wire_shape_every
        self._state_publisher = self.send_cycles(CatenaryState, "~/state", CYCLE_KEPT, peers=1)
        self._shape_publisher = self.publish_on(WireShape, "~/wire_shape", VIEW)
        model_publisher = self.publish_always(ImpedanceModel, "~/impedance_model", LATCHED)
        self.time_cycles(p.cycle_time)
        self.timing.inputs = {"impedance_mpc/command": self.sequence.counts}
        self._prepare_messages()
        for _ in range(WARM_UP_CYCLES):
            self.catenary.step(0.0)
            self._fill_shape()
        self.catenary.reset()
        model_publisher.publish(self._impedance_model())
        self.receive_cycles(ImpedanceCommand, "impedance_mpc/command", CYCLE, self._on_command)
        self.every(0.5 * p.resend_time, self._resend)

    def start(self) -> None:
        """Go to rest at the start position and publish cycle 0."""
        self.reset()

    def reset(self) -> None:
        """Go to rest at the start position; expect the command of cycle 0 again."""
        self.catenary.reset()
        self.sequence.reset()
        self._bridged = 0
        stamp = self._state.header.stamp
        stamp.sec, stamp.nanosec = divmod(self.ride_time(), 1_000_000_000)
        if self.active:
            self._publish()

    def diagnose(self) -> Diagnosis:
        """Say what was missing and how the wire is."""
        c = self.catenary
        values = {
            "cycle": str(c.cycle),
            "track position m": f"{c.track_position:.1f}",
            "w_cat mm": f"{c.w_cat * 1e3:.1f}",
            "slack droppers": f"{c.slack_droppers} of {c.droppers}",
            "bridged cycles": str(self._bridged),
            "discretisation": c.config.discretisation,
            "integration steps with slack state not settled": str(c.unsettled_steps),
        }
        for i, (place, force, _, lost) in enumerate(c.companions[:, : companions.LOST + 1].tolist()):
            values[f"companion {i + 1} at {place:g} m"] = f"{force:.1f} N, without contact {lost:.3f} s"
        if self.sequence.broken:
            return Diagnosis(ERROR, self.sequence.broken, values)
        if not np.isfinite(c.w_cat):
            return Diagnosis(ERROR, "the wire's state is not finite: reset", values)
        found = []
        if self._bridged:
            found.append("missing commands bridged with the last force")
        if self.timing.refused:
            found += self.timing.refusals
        if c.unsettled_steps:
            found.append("the slack state did not settle in some integration steps")
        return Diagnosis(WARN, "; ".join(found), values) if found else Diagnosis(OK, "active", values)

    def signs(self) -> tuple[object, ...]:
        """Give what ends the ride for the wire, and what is counted here."""
        return self.sequence.broken, bool(self._bridged), bool(self.catenary.unsettled_steps)

    def silence(self) -> str:
        """Say that no command comes any more; nobody tells the wire that a ride is over."""
        if not SILENT < self.timing.idle < float("inf") or self.stuck():
            return ""
        return f"no usable command since cycle {self.sequence.expected - 1}: the ride is over, or impedance_mpc stands"

    def _on_command(self, command: ImpedanceCommand) -> None:
        self.timing.begin()
        sequence, timing = self.sequence, self.timing
        cycle, force = command.cycle, command.f_cat
        verdict = sequence.judge(cycle, force)
        if verdict is not Verdict.TAKEN:
            if verdict is Verdict.STALE:
                timing.stale += 1
            elif verdict is Verdict.REPEATED:
                if monotonic() - self._sent_at > self._overdue:
                    self._send_state()  # whoever sends it again so much later has not had the answer
            else:
                timing.refused += 1
                timing.refuse(f"command {cycle} was refused: {sequence.objection(cycle, force)}")
            return
        sent = command.header.stamp
        now_ns = sent.sec * 1_000_000_000 + sent.nanosec + self._ts_ns
        stamp = self._state.header.stamp
        missing = sequence.missing
        if missing:
            timing.missing += missing
            self._bridged += missing
        for back in range(missing, -1, -1):
            self.catenary.step(sequence.last_force if back else force)
            stamp.sec, stamp.nanosec = divmod(max(0, now_ns - back * self._ts_ns), 1_000_000_000)
            self._publish()
        sequence.taken(cycle, force)
        timing.end(command.header, cycle)

    def _resend(self) -> None:
        if monotonic() - self._sent_at >= self.parameters.resend_time:
            self._send_state()

    def _send_state(self) -> None:
        self._state_publisher.publish(self._state)
        self._sent_at = monotonic()

    def _publish(self) -> None:
        """Publish the model's present state under the stamp that is already in the message."""
        c, state = self.catenary, self._state
        state.cycle = c.cycle
        state.w_cat, state.v_cat, state.a_cat, state.f_cat = c.w_cat, c.v_cat, c.a_cat, c.f_cat
        state.work, state.impulse = c.work, c.impulse
        state.track_position = c.track_position
        state.droppers, state.slack_droppers = c.droppers, c.slack_droppers
        state.iterations = min(c.iterations, 255)
        self._rows[:] = c.state.segment
        if self._companions:
            for field, values in self._beside:
                field[:] = values
        self._send_state()
        if c.cycle % self._shape_every == 0:
            self._fill_shape()
            self._shape_publisher.publish(self._shape)

    def _prepare_messages(self) -> None:
        """Make the messages whose arrays the cycle only overwrites."""
        c = self.catenary
        sizes = dict.fromkeys(SEGMENT, c.reduced.n) | dict.fromkeys(COMPANIONS, len(c.config.companions))
        self._state = Plan(CatenaryState, FRAME, sizes).writer().message
        self._beside = [(getattr(self._state, name), c.companions[:, column]) for name, column in COMPANIONS.items()]
        self._state.speed = c.config.speed
        self._rows = self._state.rows
        self._companions = len(c.config.companions)
        self._sent_at = 0.0
        self._shape = OpenWriter(WireShape, FRAME).message

    def _fill_shape(self) -> None:
        view, shape = self.catenary.wire_shape(), self._shape
        stamp, now = shape.header.stamp, self._state.header.stamp
        stamp.sec, stamp.nanosec = now.sec, now.nanosec
        shape.cycle = self.catenary.cycle
        shape.track_position = self.catenary.track_position
        # Views of what is overwritten next time; they are written out before.
        shape.x, shape.contact, shape.carrier = view.x, view.contact, view.carrier
        shape.dropper_x, shape.dropper_force, shape.mast_x = view.dropper_x, view.dropper_force, view.mast_x

    def _impedance_model(self) -> ImpedanceModel:
        """Give the reduced model; in lockstep without a stamp, so that two rides are equal to the last bit."""
        reduced, config = self.catenary.reduced, self.catenary.config
        message = ImpedanceModel()
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = divmod(self.ride_time(), 1_000_000_000)
        message.header.frame_id = FRAME
        message.description = (
            f"free contact wire, {reduced.x[0]:g} to {reduced.x[-1]:g} m in {reduced.x.size - 1} Hermite elements, "
            f"moving frame at {config.speed * 3.6:g} km/h, matched ends"
        )
        message.n = reduced.n
        message.ts = config.cycle_time
        message.newmark_beta, message.newmark_gamma = NEWMARK_BETA, NEWMARK_GAMMA
        message.local_compliance = self.catenary.local_compliance
        message.mass = array("d", reduced.M.tobytes())
        message.damping = array("d", reduced.D.tobytes())
        message.stiffness = array("d", reduced.K.tobytes())
        message.input = array("d", reduced.b.tobytes())
        message.output = array("d", reduced.b.tobytes())
        return message


def main() -> None:
    """Run the node."""
    leave(run(CatenaryNode))


if __name__ == "__main__":
    main()
