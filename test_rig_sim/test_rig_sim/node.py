"""The ROS 2 node test_rig_sim: paces the cycles, publishes the rig's state, follows the commands."""

import phil_node.before_rclpy  # noqa: F401  # isort: skip

import time
from math import isfinite

from geometry_msgs.msg import WrenchStamped
from phil_interfaces.msg import ImpedanceCommand, RigState
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from phil_base.cycle_counts import CycleCounts
from phil_base.enumerations import FOLLOWING, Mode, SolverStatus
from phil_node.base import WARN, Diagnosis, PhilNode, leave, run
from phil_node.cdr import Plan
from phil_node.diagnosis import SILENT
from phil_node.qos import CYCLE, VIEW
from phil_node.stencil import Stencil
from test_rig_sim.cycle import RigCycle
from test_rig_sim.diagnosis import diagnosis, missing_command, missing_listeners, to_go_on
from test_rig_sim.pacing import CycleClock
from test_rig_sim.parameters import Parameters

REPEAT_AFTER = 0.25  # s without an answer after which the last state is published again
LISTENERS_STABLE = 0.25  # s for which the listeners have to be there before cycle 0
LISTENERS_UNMATCHED = 5.0  # s for which one that cannot be matched is waited for
MEMORY = 64  # cycles back for which the time of publication is kept
PATIENCE = 0.9  # share of a cycle that each one takes at least, so that its command has time to come

# What the cycle stands at.
WAITING, ASKING, TICKING, ENDED = "waiting for listeners", "waiting for a command", "ticking", "ended"


class RigNode(PhilNode[Parameters]):
    """Wires the rig's model and its supervisor to topics, services and the clock.

    One cycle is one call of `_advance`. It is made by the command itself (lockstep), or by the tick of the steady clock
    with the command that has come by then (realtime, and a lockstep rig that retracts while nobody answers). Only
    one thread calls any of this.
    """

    cycle_role = "rig"

    def __init__(self) -> None:
        super().__init__("test_rig_sim", Parameters)
        self._commands = CycleCounts()
        self._tripped = ""  # why an earlier ride ended in a retract; only a reset forgives it
        self.serve(Trigger, "test_rig_sim/emergency_stop", self._serve_emergency_stop)
        self.serve(Trigger, "test_rig_sim/land", self._serve_land)

    # Lifecycle -------------------------------------------------------------------------------------------------

    def build(self) -> None:
        """Design the inner loop, compile the step, create the topics."""
        p = self.parameters
        self._period = p.cycle_time
        self._drive = RigCycle(p)
        self._drive.rig.advance(0.0, 0.0)
        self._message = Plan(RigState, "rig").writer().message
        bodies = self._drive.rig.bodies
        joints, wrench = JointState(), WrenchStamped()
        joints.header.frame_id = wrench.header.frame_id = "rig"
        joints.name = ["drive", *(f"pantograph_{i}" for i in range(1, bodies)), "pantograph_head"]
        joints.position = joints.velocity = joints.effort = [0.0] * (1 + bodies)
        self._joints = Stencil(joints, "position", "velocity", "effort")
        self._wrench = Stencil(wrench, "wrench.force.z")
        self._state_out = self.send_cycles(RigState, "test_rig_sim/state", CYCLE, peers=1)
        self._joints_out = self.publish_on(JointState, "test_rig_sim/joint_states", VIEW)
        self._wrench_out = self.publish_on(WrenchStamped, "test_rig_sim/contact_force", VIEW)
        self.time_cycles(p.cycle_time, count_overruns=False)
        self.timing.inputs = {"impedance_mpc/command": self._commands}
        self.receive_cycles(ImpedanceCommand, "impedance_mpc/command", CYCLE, self._take_command)
        self.every(0.02, self._look_around)
        self._tick = self.cycle_timer(p.cycle_time, self._on_tick)
        self._restart()

    def start(self) -> None:
        """Wait for the listeners, then begin with cycle 0; a rig that tripped wants to be reset before."""
        if self._tripped:
            raise RuntimeError(f"the last ride ended in a retract ({self._tripped}): call test_rig_sim/reset first")
        self._restart()

    def stop(self) -> None:
        """Rest; nothing moves until the next activation, which begins with cycle 0."""
        self._tick.cancel()
        self._phase = ENDED
        self._report()

    def reset(self) -> None:
        """Begin anew with cycle 0: books, noise, refusals and a tripped supervisor."""
        self._tripped = ""
        self._restart()

    def changed(self, names: frozenset[str]) -> None:
        """Switch the operating mode, or change the pantograph's pressure: the next cycle begins with it."""
        if "operating_mode" in names:
            self._drive.supervisor.select(self.parameters.operating_mode)
        if "uplift_force" in names:
            self._drive.rig.set_uplift_force(self.parameters.uplift_force)

    def _restart(self) -> None:
        p = self.parameters
        self._tick.cancel()
        self._drive.restart(p)
        self._pacing = CycleClock(p.cycle_time)
        self._reported = Mode.HOLD
        self._commands.clear()
        self._phase = WAITING
        self._command: tuple[float, float] | None = None
        self._answered = self._old_plan = False
        self._late_ticks = 0
        self._newest, self._first = -1, 0.0  # newest cycle that was commanded, and to where, in m
        self._published_at = [0.0] * MEMORY
        self._stamped = 0  # ns, wall time of the newest state in real time
        self._asked_at = self._began_at = 0.0
        self._listeners = (0, 0)  # matched, known to the graph
        self._listeners_since = self._waits_since = time.monotonic()

    # The cycle -------------------------------------------------------------------------------------------------

    def _take_command(self, message: ImpedanceCommand) -> None:
        cycle, counts = message.cycle, self._commands
        if self._phase == WAITING or cycle > self._drive.cycle:
            # From before a reset: nobody can have answered a cycle that was not published.
            self.timing.stale += 1
            return
        if cycle <= self._newest:
            if cycle < counts.next:
                counts.late += counts.odd(cycle)
            # The newest one comes twice when the state was published twice; never with other numbers.
            if cycle < self._newest:
                self.timing.stale += 1
            elif message.u_tr != self._first and isfinite(message.u_tr) and isfinite(self._first):
                self._drive.supervisor.contradict(cycle, message.u_tr, self._first)
            return
        self._newest, self._first = cycle, message.u_tr
        turnaround = time.monotonic() - self._published_at[cycle % MEMORY]
        self.timing.add(turnaround, message.header, cycle)
        why = self._drive.objection(message.u_tr, message.u_tr_next)
        if why:
            self.timing.refused += 1
            self.timing.refuse(f"command {cycle} was refused: {why}")
        elif cycle == counts.next:
            counts.next += 1
        else:
            counts.odd(cycle)
        if cycle < self._drive.cycle:
            # Too late for its own cycle, but its prediction is the newest there is.
            if not why:
                counts.late += 1
                self._drive.supervisor.predict(message.u_tr_next)
            return
        # A refused command leaves the cycle without one; the supervisor bridges it like a late one.
        self._answered = True
        self._command = None if why else (message.u_tr, message.u_tr_next)
        self._old_plan = message.status == SolverStatus.FALLBACK
        if self._message.last:
            self._end()
        elif self._phase == ASKING and self.parameters.mode == "realtime":
            self._start_ticking()
        elif self._phase == ASKING or self._pacing.due(self._drive.cycle, time.monotonic()) > 0:
            self._advance()

    def _advance(self) -> None:
        """Move from t_k to t_(k+1) with command k, or without one if it has not come, and publish state k + 1."""
        drive = self._drive
        self._began_at = time.monotonic()
        if self._command is not None:
            drive.follow(*self._command, self._old_plan)
        else:
            if not self._answered and drive.supervisor.needs_commands:
                self.timing.late += 1
            drive.bridge(refused=self._answered)
        self._publish()

    def _publish(self) -> None:
        """Publish state k; it is the last one at the end of the ride and when the rig came to rest before it."""
        message, drive = self._message, self._drive
        state, cycle = drive.state, drive.cycle
        self._stamp(cycle)
        message.cycle = cycle
        message.mode = int(drive.mode)
        message.last = drive.last
        message.w_tr, message.v_tr = state.w_tr, state.v_tr
        message.f_tr, message.f_raw = state.f_tr, state.f_raw
        message.reference, message.current = state.reference, state.current
        message.work, message.impulse = state.work, state.impulse
        message.late_commands = self.timing.late
        self._command, self._answered = None, False
        self._asked_at = self._published_at[cycle % MEMORY] = time.monotonic()
        self._state_out.publish(self._message)
        if message.last and self._phase == TICKING:
            self._tick.cancel()
            self._phase = ASKING
        if cycle % self.parameters.view_decimation == 0:
            self._publish_views()

    def _stamp(self, cycle: int) -> None:
        """Lockstep: k Ts, the same in every run. Realtime: wall clock, k Ts after its start."""
        now = round(cycle * self._period * 1e9)
        if self.parameters.mode == "realtime":
            now = self.wall_clock() if cycle == 0 else self._pacing.stamp(cycle)
            self._stamped = now
        stamp = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)

    def _publish_views(self) -> None:
        rig, message = self._drive.rig, self._message
        displacement, velocity = rig.pantograph_state()
        now = message.header.stamp
        joints, wrench = self._joints, self._wrench
        for view in (joints, wrench):
            view.stamp(now.sec, now.nanosec)
        joints["position"][0], joints["velocity"][0] = message.w_tr, message.v_tr
        joints["position"][1:], joints["velocity"][1:] = displacement, velocity
        joints["effort"][0] = rig.plant.drive.force_constant * message.current
        wrench["wrench.force.z"][0] = message.f_tr
        self._joints_out.publish(self._joints)
        self._wrench_out.publish(self._wrench)

    def _end(self) -> None:
        """No more states; books and reason stay readable until reset or deactivation."""
        self._tick.cancel()
        self._drive.supervisor.finish()
        self._phase = ENDED
        self._report()
        self.timing.flush(self._message.header, self._drive.cycle)

    # The clock -------------------------------------------------------------------------------------------------

    def _start_ticking(self) -> None:
        """Start the wall clock at the present cycle: its interval ends one period from now."""
        now, wall = time.monotonic(), self._stamped
        # Both clocks were read when the state was published; the wall clock may have been set since.
        if wall:
            wall += round((now - self._published_at[self._drive.cycle % MEMORY]) * 1e9)
        self._pacing.start(self._drive.cycle, now, wall or self.wall_clock())
        self._began_at = now
        self._phase = TICKING
        self._tick.reset()

    def _on_tick(self) -> None:
        """End the interval that is due, with its command or, if it had its time to come, without.

        After a late tick of its own the node owes the command its time: the cycle then ends with the command
        (`_take_command`) or after `PATIENCE`, and the rig comes back into step with the clock cycle by cycle.
        """
        if not self.active or self._phase != TICKING:
            return
        now = time.monotonic()
        # The node was held up for long: what is beyond `catch_up` is given up.
        self._pacing.give_up(self._pacing.due(self._drive.cycle, now) - self.parameters.catch_up)
        while self._phase == TICKING and self._pacing.due(self._drive.cycle, now) > 0:
            owed = self._began_at + PATIENCE * self._period
            if not self._answered and self._drive.supervisor.needs_commands and now < owed:
                self._late_ticks += 1
                self._tick.also(owed)
                break
            self._advance()

    def _look_around(self) -> None:
        """Begin when the listeners are there; publish again, or move on alone, when nobody answers."""
        now = time.monotonic()
        self._report()
        if self._phase == WAITING:
            # A listener that the graph knows but that is not matched yet would miss cycle 0. One that never matches
            # (its QoS asks for more than is offered) does not hold up the ride for ever.
            listeners, known = self._state_out.get_subscription_count(), self._known_listeners()
            quiet = now - self._listeners_since
            if (listeners, known) != self._listeners or listeners < self.parameters.wait_for_subscribers:
                self._listeners, self._listeners_since = (listeners, known), now
            elif quiet >= (LISTENERS_STABLE if listeners == known else LISTENERS_UNMATCHED):
                self._phase = ASKING
                self._publish()
        elif self._phase == ASKING and now - self._asked_at >= REPEAT_AFTER:
            if self._drive.resting:
                self._end()
            elif self._moves_alone():
                self._start_ticking()
            else:
                self._asked_at = now
                self._state_out.publish(self._message)

    def _moves_alone(self) -> bool:
        """Whether the cycle goes on though nobody answers: to get the drive to rest, or because nobody has to."""
        supervisor = self._drive.supervisor
        if supervisor.mode in (Mode.RETRACTING, Mode.LANDING):
            return True
        return self.parameters.mode == "realtime" and not supervisor.needs_commands

    def _known_listeners(self) -> int:
        return int(self.count_subscribers(self._state_out.topic_name)) + self._state_out.linked

    # Operator --------------------------------------------------------------------------------------------------

    def _report(self) -> None:
        """Log what the drive began to do since the last look, and remember a trip; never called within a cycle."""
        supervisor = self._drive.supervisor
        self._tripped = self._tripped or supervisor.reason
        mode, before, cycle = supervisor.mode, self._reported, self._drive.cycle
        if mode is before or (mode in FOLLOWING and before in FOLLOWING):
            return
        self._reported = mode
        log = self.log
        if mode is Mode.RETRACTING or (mode is Mode.STOPPED and supervisor.reason and before is not Mode.RETRACTING):
            log.error(f"the drive retracts at cycle {cycle}: {supervisor.reason}")
        elif mode is Mode.STOPPED:
            log.info(f"the drive rests: {supervisor.reason or ('landed' if supervisor.landed else 'end of the ride')}")
        else:
            log.info(f"the drive is {'tracking' if mode in FOLLOWING else mode.name.lower()} at cycle {cycle}")

    def _serve_land(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = False
        if not self.active:
            response.message = "test_rig_sim is not active: the drive does not move"
        elif self._phase in (WAITING, ENDED):
            response.message = f"nothing to land: the ride is {self._phase}"
        elif not self._drive.supervisor.land():
            response.message = f"the drive does not land: {self._drive.supervisor.reason or 'it rests'}"
        else:
            response.success, response.message = True, "drive parts from the pantograph and rests there"
        return response

    def _serve_emergency_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.active:
            response.success, response.message = False, "test_rig_sim is not active: the drive does not move"
            return response
        self._drive.supervisor.retract("emergency stop")
        if self._phase == WAITING:
            self._end()
        response.success = True
        reason = self._drive.supervisor.reason
        response.message = (
            f"drive goes to its safe position and rests there ({reason})" if reason else "the ride is over, drive rests"
        )
        return response

    def newest(self) -> tuple[int, float]:
        """Give the stamp of the newest state in ns, and how long ago it was published in s."""
        if not self.configured or not self._asked_at:
            return 0, 0.0
        stamp = self._message.header.stamp
        age = time.monotonic() - self._published_at[self._drive.cycle % MEMORY]
        return stamp.sec * 1_000_000_000 + stamp.nanosec, age

    def stuck(self) -> bool:
        """Never: a rig whose commands are refused retracts by itself."""
        return False

    def signs(self) -> tuple[object, ...]:
        """Give what the level hangs on beside the counters."""
        supervisor = self._drive.supervisor
        return supervisor.mode in FOLLOWING or supervisor.mode, supervisor.reason, self._phase == ENDED

    def silence(self) -> str:
        """Say that a cycle stands because its command does not come; in real time the rig retracts instead."""
        waited = time.monotonic() - self._published_at[self._drive.cycle % MEMORY]
        if self._phase != ASKING or self._drive.resting or waited <= SILENT:
            return ""
        return missing_command(self._drive.cycle, self.count_publishers("impedance_mpc/command"))

    def _heard_by(self) -> list[str]:
        infos = self.get_subscriptions_info_by_topic(self._state_out.topic_name)
        return sorted(info.node_name for info in infos)

    def _missing_listeners(self, names: list[str]) -> str:
        if self._phase != WAITING:
            return ""
        waited = time.monotonic() - self._waits_since
        return missing_listeners(self._listeners, self.parameters.wait_for_subscribers, names, waited)

    def diagnose(self) -> Diagnosis:
        """Say the mode, the reason of a retract, and the counters of the cycle."""
        supervisor = self._drive.supervisor
        mode = supervisor.mode.name.lower()
        found = diagnosis(supervisor, self.timing, self._pacing, self._phase)
        names = self._heard_by() if self._phase == WAITING else []
        if missing := self._missing_listeners(names):
            found.add(WARN, missing)
        found.values = {
            "mode": mode,
            "phase": self._phase,
            "outcome": self._drive.outcome,
            "operating mode": self.parameters.operating_mode,
            "in contact": "yes" if supervisor.touching else "no",
            "reason": supervisor.reason,
            "cycle": str(self._drive.cycle),
            "listeners": "{} matched of {}, {} wanted".format(*self._listeners, self.parameters.wait_for_subscribers),
            "heard by": ", ".join(names) or "-",
            "to go on": to_go_on(supervisor) or "-",
            "late ticks": str(self._late_ticks),
            "skipped ticks": str(self._pacing.skipped),
            "commands cut": str(supervisor.limited),
            "effective current A": f"{supervisor.guard.effective_current:.2f}",
            "contact force N": f"{self._message.f_tr:.1f}",
        }
        return found


def main() -> None:
    """Run the node."""
    leave(run(RigNode))


if __name__ == "__main__":
    main()
