"""ROS node of the impedance controller: wires topics, services and parameters to :class:`EnvironmentSwitch`."""

from __future__ import annotations

import phil_node.before_rclpy  # noqa: F401  # isort: skip

from time import monotonic
from typing import Any

import numpy as np
from phil_interfaces.msg import CatenaryState, ConservedQuantities, ImpedanceCommand, ImpedanceModel, RigState
from rclpy.parameter import Parameter
from rclpy.wait_for_message import wait_for_message
from std_srvs.srv import SetBool

from impedance_mpc.asking import Asking
from impedance_mpc.controller import EnvironmentReading, RigReading
from impedance_mpc.cycle import BOOKS_EVERY, Answer, ControllerCycle
from impedance_mpc.pairing import LONGEST, Arrival, CyclePairs
from impedance_mpc.parameters import CORRECTED, INTEGRATED, Parameters
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import ENVIRONMENTS, EnvironmentSwitch
from phil_base.enumerations import Correction
from phil_base.guard import finite, finite_rows, objection, plausible
from phil_node.base import WARN, Diagnosis, PhilNode, leave, run
from phil_node.cdr import Plan
from phil_node.diagnosis import SILENT
from phil_node.qos import CYCLE, CYCLE_KEPT, LATCHED
from phil_node.signals import asked_to_end

MODEL_PART = 2.5
"""Time in s that the reduced model is waited for at a stretch."""
RIG_NUMBERS = ("w_tr", "v_tr", "f_tr", "reference", "work", "impulse")
SEGMENT = ("segment_displacement", "segment_velocity", "segment_acceleration", "segment_force")
WIRE_NUMBERS = ("w_cat", "v_cat", "f_cat", "work", "impulse", *SEGMENT)
NOT_USED = (Arrival.AHEAD, Arrival.REFUSED)
LACKS = {"rig": "test_rig_sim", "catenary": "catenary_model", "both": "test_rig_sim and catenary_model"}


class ImpedanceNode(PhilNode[Parameters]):
    """Answers each pair of rig and catenary state with a command, in order, and keeps the books."""

    cycle_role = "controller"

    def __init__(self) -> None:
        super().__init__("impedance_mpc", Parameters)
        self.serve(SetBool, "~/set_correction", self._set_correction)
        self.cycle: ControllerCycle
        self.switch: EnvironmentSwitch
        self.pairs: CyclePairs[RigState, CatenaryState] = CyclePairs()
        self.over = False
        self.unusable = 0
        self.fallbacks_reported = 0
        self._asked = 0
        self._asking = Asking(0.0)

    def build(self) -> None:
        """Wait for the impedance model, design the controllers, compile their kernels, open the topics."""
        model = self._receive_model()
        self.cycle = ControllerCycle(self.parameters, model)
        self.switch = self.cycle.switch
        self.switch.warm_up()
        self._rows = np.zeros((len(SEGMENT), model.n))
        self.segment = tuple(self._rows)
        self._loaded: CatenaryState | None = None
        self.pairs.clear()
        self.answer = Plan(ImpedanceCommand, "rig").writer().message
        self.quantities = Plan(ConservedQuantities, "rig").writer().message
        self.commands = self.send_cycles(ImpedanceCommand, "impedance_mpc/command", CYCLE_KEPT, peers=2)
        self.books = self.publish_on(ConservedQuantities, "impedance_mpc/conserved_quantities", CYCLE)
        self._asking = Asking(self.parameters.cycle_time)
        # In lockstep the rig waits, and asks again itself.
        self._hurried = self.parameters.mode == "realtime"
        self._again = self.cycle_timer(self.parameters.cycle_time, self._send_again)
        self.time_cycles(self.parameters.cycle_time)
        self.timing.inputs = {
            "test_rig_sim/state": self.pairs.of_rig,
            "catenary_model/state": self.pairs.of_catenary,
        }
        self.receive_cycles(CatenaryState, "catenary_model/state", CYCLE, self._take_catenary)
        self.receive_cycles(RigState, "test_rig_sim/state", CYCLE, self._take_rig)

    def start(self) -> None:
        """Begin at cycle 0."""
        self.reset()

    def reset(self) -> None:
        """Forget states, plan and books and wait for cycle 0."""
        self.cycle.reset()
        self.pairs.clear()
        self.over = False
        self.unusable = 0
        self.fallbacks_reported = 0
        self._asked = 0

    def changed(self, names: frozenset[str]) -> None:
        """Change the control scheme, or the environment: the next cycle begins with it."""
        if "control" in names:
            self.switch.set_control(self.parameters.control)
        if "environment" in names:
            self.switch.select(self.parameters.environment)

    def diagnose(self) -> Diagnosis:
        """Report books, correction and solver; warn of new fallbacks and of lost cycles."""
        books, result = self.switch.books, self.switch.result
        values = {
            "environment": ENVIRONMENTS[self.switch.active],
            "next cycle": str(self.pairs.next),
            "energy error J": f"{books.delta_e:.4f}",
            "energy error by work done J": f"{books.delta_work:.4f}",
            "exchanged energy J": f"{books.exchanged_energy:.2f}",
            "momentum error N s": f"{books.delta_p:.3f}",
            "correction": Correction(result.correction).words,
            "correction force N": f"{result.f_cor:.2f}",
            "solver iterations": str(result.iterations),
            "fallbacks": str(result.fallbacks),
        }
        new = result.fallbacks - self.fallbacks_reported
        self.fallbacks_reported = result.fallbacks
        values["fallbacks of the last second"] = str(new)
        found = []
        if new > 0:
            found.append("solver failed, old plan used")
        if self.timing.missing > 0:
            found.append("some cycles never came")
        if self.timing.refused > 0:
            found += self.timing.refusals
        return Diagnosis(WARN, "; ".join(found), values) if found else Diagnosis(values=values)

    def signs(self) -> tuple[object, ...]:
        """Give whether the solver failed since it was last said."""
        return (self.switch.result.fallbacks > self.fallbacks_reported,)

    def silence(self) -> str:
        """Say whose state does not come any more; the rig tells when a ride is over."""
        if self.over or not SILENT < self.timing.idle < float("inf") or self.stuck():
            return ""
        if self.timing.stale and self.timing.heard <= SILENT:
            return f"states come of cycles that are over, not {self.pairs.next}: call impedance_mpc/reset"
        lacking = LACKS[self.pairs.lacks]
        return f"no command since cycle {self.pairs.next - 1}: no usable state {self.pairs.next} of {lacking}"

    def _receive_model(self) -> Impedance:
        timeout = self.parameters.model_timeout
        topic = "catenary_model/impedance_model"
        received, left = False, timeout
        while not received and left > 0.0 and not asked_to_end():
            # In parts, so that a signal is heeded; each is long enough for the publisher to be matched.
            received, message = wait_for_message(
                ImpedanceModel, self, topic, qos_profile=LATCHED, time_to_wait=min(left, MODEL_PART)
            )
            left -= MODEL_PART
        if asked_to_end():
            raise RuntimeError("asked to end")
        if not received:
            raise RuntimeError(f"no message on {topic} within {timeout} s: is catenary_model configured?")
        n = int(message.n)
        return Impedance.from_flat(
            n,
            message.mass,
            message.damping,
            message.stiffness,
            message.input,
            message.output,
            message.ts,
            message.newmark_beta,
            message.newmark_gamma,
            message.local_compliance,
        )

    def _set_correction(self, request: Any, response: Any) -> Any:
        wanted = CORRECTED if request.data else INTEGRATED
        result = self.set_parameters([Parameter("control", value=wanted)])[0]
        response.success = result.successful
        response.message = result.reason or f"correction force is {'on' if request.data else 'off'}"
        return response

    def _take_rig(self, state: RigState) -> None:
        self.timing.begin()
        usable = plausible(state.w_tr, state.v_tr, state.f_tr, state.reference) and finite(state.work, state.impulse)
        if not usable:
            self._refuse("rig", state, RIG_NUMBERS)
            return
        arrival = self.pairs.add_rig(state.cycle, state)
        if arrival in NOT_USED or self.unusable + self.pairs.refused != self.timing.refused:
            self._object("rig", state.cycle, arrival)
        if arrival is Arrival.NEW:
            self._answer_all()
            if self._hurried and self.pairs.waits_for_catenary:
                # By each state of the rig once: who comes back when it rests is not to hear of a ride that is over.
                self._again.once(self._asking.due)
        elif arrival is Arrival.STALE:
            self.timing.stale += 1
        elif arrival is Arrival.REPEATED and self.answer.cycle == state.cycle:
            if state.f_tr != self.answer.f_tr:
                self._contradict(state.cycle)
            else:
                self.commands.publish(self.answer)

    def _take_catenary(self, state: CatenaryState) -> None:
        self.timing.begin()
        self._loaded = None
        usable = (
            plausible(state.w_cat, state.v_cat, state.f_cat)
            and finite(state.work, state.impulse)
            and finite_rows(state, SEGMENT, self._rows)
        )
        if not usable:
            self._refuse("catenary", state, WIRE_NUMBERS)
            self._ask_again(state.cycle)
            return
        self._loaded = state
        arrival = self.pairs.add_catenary(state.cycle, state)
        if arrival in NOT_USED or self.unusable + self.pairs.refused != self.timing.refused:
            self._object("catenary", state.cycle, arrival)
        if arrival is Arrival.NEW:
            self._answer_all()
        elif arrival is Arrival.STALE:
            self.timing.stale += 1

    def _send_again(self) -> None:
        """Send the last command again, unless the wire's state has come meanwhile."""
        if self.pairs.waits_for_catenary:
            self.commands.publish(self.answer)
            self._asking.again(monotonic())

    def _ask_again(self, cycle: int) -> None:
        """Ask the catenary for a state that could not be used, once, if it is the one that is waited for."""
        if cycle == self.pairs.next > self._asked and cycle == self.answer.cycle + 1:
            self._asked = cycle
            self.commands.publish(self.answer)

    def _refuse(self, sender: str, state: RigState | CatenaryState, names: tuple[str, ...]) -> None:
        """Count a state whose numbers cannot be used, and say why; `timing.refused` has these and the strays."""
        self.unusable += 1
        self.timing.refused = self.unusable + self.pairs.refused
        why = objection(state, names, len(self.segment[0]))
        self.timing.refuse(f"state {state.cycle} of the {sender} was refused: {why}")

    def _contradict(self, cycle: int) -> None:
        """Count a state for a cycle that has had another one: the first was answered, and stays."""
        self.unusable += 1
        self.timing.refused = self.unusable + self.pairs.refused
        said = "it came before with other numbers: does a second publisher send states?"
        self.timing.refuse(f"state {cycle} of the rig was refused: {said}")

    def _object(self, sender: str, cycle: int, arrival: Arrival) -> None:
        """Say why a state, or one that was kept aside before it, is not used."""
        self.timing.refused = self.unusable + self.pairs.refused
        state, expected = f"state {cycle} of the {sender}", self.pairs.next
        if arrival is Arrival.REFUSED:
            self.timing.refuse(f"{state} was refused: more than {LONGEST} cycles ahead of {expected}, which comes next")
        elif arrival is Arrival.AHEAD:
            missing = self.pairs.expected(sender)
            begins = ", with which a ride begins," if missing == 0 else ""
            self.timing.refuse(f"{state} cannot be used: state {missing}{begins} has not come")
        else:
            self.timing.refuse(f"strays were dropped when {state} came")

    def _answer_all(self) -> None:
        while (pair := self.pairs.take()) is not None:
            cycle, rig, wire = pair
            if wire is not self._loaded:  # not the one that came last, which has been copied already
                finite_rows(wire, SEGMENT, self._rows)
                self._loaded = wire
            q, qd, qdd, held = self.segment
            answer = self.cycle.answer(
                RigReading(rig.w_tr, rig.v_tr, rig.f_tr, rig.reference, rig.work, rig.impulse),
                EnvironmentReading(q, qd, qdd, held, wire.w_cat, wire.v_cat, wire.f_cat, wire.work, wire.impulse),
                rig.mode,
            )
            self._send(rig, cycle, answer)
            self.timing.missing = self.pairs.missing
            self.timing.end(rig.header, cycle)
            if cycle % BOOKS_EVERY == 0:
                self._send_books(rig, cycle)
            if rig.last:
                self.over = True
                self.timing.flush(rig.header, cycle)
            self.timing.begin()

    def _send(self, rig: RigState, cycle: int, answer: Answer) -> None:
        message = self.answer
        message.header.stamp = rig.header.stamp
        message.cycle = cycle
        (
            message.u_tr,
            message.u_tr_next,
            message.f_tr,
            message.f_predicted,
            message.f_cor,
            message.f_cat,
            message.f_cor_lower,
            message.f_cor_upper,
            message.correction,
            message.environment,
            message.status,
            message.iterations,
            message.fallbacks,
            message.w_env,
            message.v_env,
        ) = answer
        self.commands.publish(message)
        self._asking.sent(monotonic())

    def _send_books(self, rig: RigState, cycle: int) -> None:
        message, books = self.quantities, self.switch.books
        message.header.stamp = rig.header.stamp
        message.cycle = cycle
        (
            message.e_tr,
            message.e_cat,
            message.p_tr,
            message.p_cat,
            message.work_tr,
            message.work_cat,
            message.impulse_tr,
            message.impulse_cat,
            message.exchanged_energy,
            message.exchanged_momentum,
        ) = books.totals
        message.delta_e, message.delta_p, message.delta_work = books.delta_e, books.delta_p, books.delta_work
        self.books.publish(message)


def main() -> None:
    """Run the node."""
    leave(run(ImpedanceNode))


if __name__ == "__main__":
    main()
