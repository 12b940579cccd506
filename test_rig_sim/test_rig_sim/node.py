"""The ROS 2 node test_rig_sim: paces the cycles, publishes the rig's state, follows the commands."""

import sys
import time

from geometry_msgs.msg import WrenchStamped
from phil_interfaces.msg import ImpedanceCommand, RigState
from rclpy.clock import Clock, ClockType
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from phil_node.base import ERROR, WARN, Diagnosis, PhilNode, run
from phil_node.qos import CYCLE, VIEW
from test_rig_sim.parameters import Parameters
from test_rig_sim.retract import Retract
from test_rig_sim.rig import Rig
from test_rig_sim.supervisor import Limits, Mode, Ramp, Supervisor

REPEAT_AFTER = 0.25  # s without an answer after which the last state is published again
LISTENERS_STABLE = 0.5  # s for which the listeners have to be there before cycle 0
LISTENERS_UNMATCHED = 5.0  # s for which one that cannot be matched is waited for
MEMORY = 64  # cycles back for which the time of publication is kept
PATIENCE = 0.9  # share of a cycle that a command has at least, from the publication of its state
EARLY = 0.05  # share of a cycle by which a tick may come early (rounding of the timer)

# What the cycle stands at.
WAITING, ASKING, TICKING, ENDED = "waiting for listeners", "waiting for a command", "ticking", "ended"


class RigNode(PhilNode[Parameters]):
    """Wires the rig's model and its supervisor to topics, services and the clock.

    One cycle is one call of `_advance`. It is made by the command itself (lockstep), or by the tick of the steady clock
    with the command that has come by then (realtime, and a lockstep rig that retracts while nobody answers). Only
    one thread calls any of this.
    """

    def __init__(self) -> None:
        super().__init__("test_rig_sim", Parameters)

    # Lifecycle -------------------------------------------------------------------------------------------------

    def build(self) -> None:
        """Design the inner loop, compile the step, create the topics."""
        p = self.parameters
        self._period = p.cycle_time
        self._last_cycle = max(1, round(p.duration / p.cycle_time)) - 1 if p.duration > 0.0 else -1
        self._rig = Rig(p)
        self._rig.advance(0.0, 0.0)
        self._message = RigState()
        self._message.header.frame_id = "rig"
        self._joints = JointState()
        self._joints.header.frame_id = "rig"
        self._joints.name = ["drive", *(f"pantograph_{i}" for i in range(1, self._rig.bodies)), "pantograph_head"]
        self._wrench = WrenchStamped()
        self._wrench.header.frame_id = "rig"
        self._state_out = self.publish_on(RigState, "test_rig_sim/state", CYCLE)
        self._joints_out = self.publish_on(JointState, "test_rig_sim/joint_states", VIEW)
        self._wrench_out = self.publish_on(WrenchStamped, "test_rig_sim/contact_force", VIEW)
        self.time_cycles(p.cycle_time, count_overruns=False)
        self.listen(ImpedanceCommand, "impedance_mpc/command", CYCLE, self._take_command)
        self.serve(Trigger, "test_rig_sim/emergency_stop", self._serve_emergency_stop)
        self.every(0.02, self._look_around)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._tick = self.create_timer(p.cycle_time, self._on_tick, clock=self._steady, autostart=False)
        self._restart()

    def start(self) -> None:
        """Wait for the listeners, then begin with cycle 0."""
        self._restart()

    def stop(self) -> None:
        """Rest; nothing moves until the next activation, which begins with cycle 0."""
        self._tick.cancel()
        self._phase = ENDED

    def discard(self) -> None:
        """Destroy the tick."""
        self._tick.cancel()
        self.destroy_timer(self._tick)

    def reset(self) -> None:
        """Begin anew with cycle 0: books, noise, refusals and a tripped supervisor."""
        self._restart()

    def _restart(self) -> None:
        p = self.parameters
        self._tick.cancel()
        self._rig.reset()
        limits = p.limits.model_dump()
        self._supervisor = Supervisor(
            Limits(late_limit=p.late_limit, **limits), Retract(**p.retract.model_dump()), p.cycle_time
        )
        self._cycle = 0
        self._phase = WAITING
        self._command: tuple[float, float] | None = None
        self._answered = False
        self._shown_mode = Mode.HOLD
        self._resting = False
        self._late_ticks = 0
        self._skipped_ticks = 0
        self._origin = 0.0
        self._wall_origin = 0
        self._newest = -1
        self._published_at = [0.0] * MEMORY
        self._asked_at = 0.0
        self._listeners = (0, 0)  # matched, known to the graph
        self._listeners_since = time.monotonic()

    # The cycle -------------------------------------------------------------------------------------------------

    def _take_command(self, message: ImpedanceCommand) -> None:
        cycle = message.cycle
        if self._phase == WAITING or cycle > self._cycle:
            # From before a reset: nobody can have answered a cycle that was not published.
            self.timing.stale += 1
            return
        if cycle <= self._newest:
            # The newest one comes twice when the state was published twice.
            self.timing.stale += cycle < self._newest
            return
        self._newest = cycle
        turnaround = time.monotonic() - self._published_at[cycle % MEMORY]
        self.timing.add(turnaround, message.header, cycle)
        admissible = self._supervisor.admissible(message.u_tr, message.u_tr_next)
        self.timing.refused += not admissible
        if cycle < self._cycle:
            # Too late for its own cycle, but its prediction is the newest there is.
            if admissible:
                self._supervisor.predict(message.u_tr_next)
            return
        # A refused command leaves the cycle without one; the supervisor bridges it like a late one.
        self._answered = True
        self._command = (message.u_tr, message.u_tr_next) if admissible else None
        if self._message.last:
            self._end()
        elif self._phase == ASKING and self.parameters.mode == "realtime":
            self._start_ticking()
        elif self._phase == ASKING or self._due(time.monotonic()) > 0:
            self._advance()

    def _advance(self) -> None:
        """Move from t_k to t_(k+1) with command k, or without one if it has not come, and publish state k + 1."""
        supervisor = self._supervisor
        if self._command is not None:
            ramp: Ramp = supervisor.follow(*self._command)
        else:
            if not self._answered and supervisor.moving:
                self.timing.late += 1
            ramp = supervisor.bridge(refused=self._answered)
        rig = self._rig
        rig.advance(ramp.start, ramp.end)
        self._shown_mode = supervisor.mode
        state = rig.state
        supervisor.watch(state.w_tr, state.v_tr, state.f_tr, state.saturated == rig.plant.inner_steps)
        self._cycle += 1
        self._publish()

    def _publish(self) -> None:
        """Publish state k; it is the last one at the end of the ride and when the rig came to rest before it."""
        message, state, cycle = self._message, self._rig.state, self._cycle
        self._stamp(cycle)
        message.cycle = cycle
        message.mode = int(self._shown_mode)
        self._resting = self._shown_mode is Mode.STOPPED
        message.last = cycle == self._last_cycle or self._resting
        message.w_tr, message.v_tr = state.w_tr, state.v_tr
        message.f_tr, message.f_raw = state.f_tr, state.f_raw
        message.reference, message.current = state.reference, state.current
        message.work, message.impulse = state.work, state.impulse
        message.late_commands = self.timing.late
        self._command, self._answered = None, False
        self._asked_at = self._published_at[cycle % MEMORY] = time.monotonic()
        self._state_out.publish(message)
        if message.last and self._phase == TICKING:
            self._tick.cancel()
            self._phase = ASKING
        if cycle % self.parameters.view_decimation == 0:
            self._publish_views()

    def _stamp(self, cycle: int) -> None:
        """Lockstep: k Ts, the same in every run. Realtime: wall clock, k Ts after its start."""
        now = round(cycle * self._period * 1e9)
        if self.parameters.mode == "realtime":
            now = self.get_clock().now().nanoseconds if cycle == 0 else now + self._wall_origin
        stamp = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(now, 1_000_000_000)

    def _publish_views(self) -> None:
        rig, message = self._rig, self._message
        displacement, velocity = rig.pantograph_state()
        self._joints.header.stamp = self._wrench.header.stamp = message.header.stamp
        self._joints.position = [message.w_tr, *displacement.tolist()]
        self._joints.velocity = [message.v_tr, *velocity.tolist()]
        self._joints.effort = [rig.plant.drive.force_constant * message.current, *([0.0] * rig.bodies)]
        self._wrench.wrench.force.z = message.f_tr
        self._joints_out.publish(self._joints)
        self._wrench_out.publish(self._wrench)

    def _end(self) -> None:
        """No more states; books and reason stay readable until reset or deactivation."""
        self._tick.cancel()
        self._supervisor.finish()
        self._phase = ENDED
        self.timing.flush(self._message.header, self._cycle)

    # The clock -------------------------------------------------------------------------------------------------

    def _start_ticking(self) -> None:
        """Start the wall clock at the present cycle: its interval ends one period from now."""
        self._origin = time.monotonic() - self._cycle * self._period
        self._wall_origin = self.get_clock().now().nanoseconds - round(self._cycle * self._period * 1e9)
        self._phase = TICKING
        self._tick.reset()

    def _due(self, now: float) -> int:
        """Number of cycles by which the rig is behind its clock; the origin is fixed, so ticks do not drift."""
        return int((now - self._origin) / self._period + EARLY) - self._cycle

    def _on_tick(self) -> None:
        """End the interval that is due, with its command or, if it had its time to come, without.

        After a late tick of its own the node owes the command the rest of its time: the cycle then ends with the
        command (`_take_command`) or with the next tick, and the rig is back in step with the clock.
        """
        if not self.active or self._phase != TICKING:
            return
        now = time.monotonic()
        excess = self._due(now) - self.parameters.catch_up
        if excess > 0:
            # The node was held up for long: these ticks are given up, the clock of the ride stands still meanwhile.
            self._skipped_ticks += excess
            self._origin += excess * self._period
            self._wall_origin += round(excess * self._period * 1e9)
        while self._phase == TICKING and self._due(now) > 0:
            waited = now - self._published_at[self._cycle % MEMORY]
            if not self._answered and self._supervisor.moving and waited < PATIENCE * self._period:
                self._late_ticks += 1
                break
            self._advance()

    def _look_around(self) -> None:
        """Begin when the listeners are there; publish again, or move on alone, when nobody answers."""
        now = time.monotonic()
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
            if self._resting:
                self._end()
            elif self._supervisor.mode is Mode.RETRACTING:
                self._start_ticking()
            else:
                self._asked_at = now
                self._state_out.publish(self._message)

    def _known_listeners(self) -> int:
        return int(self.count_subscribers(self._state_out.topic_name))

    # Operator --------------------------------------------------------------------------------------------------

    def _serve_emergency_stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.active:
            response.success, response.message = False, "test_rig_sim is not active: the drive does not move"
            return response
        self._supervisor.retract("emergency stop")
        if self._phase == WAITING:
            self._end()
        response.success = True
        reason = self._supervisor.reason
        response.message = (
            f"drive goes to its safe position and rests there ({reason})" if reason else "the ride is over, drive rests"
        )
        return response

    def diagnose(self) -> Diagnosis:
        """Say the mode, the reason of a retract, and the counters of the cycle."""
        supervisor = self._supervisor
        mode = supervisor.mode.name.lower()
        found = Diagnosis(message=f"{mode}, {self._phase}")
        if supervisor.reason:
            found.level, found.message = ERROR, f"{mode}: {supervisor.reason}"
        elif self.timing.late or self.timing.refused or self._skipped_ticks:
            found.level = WARN
            counts = f"{self.timing.late} commands late, {self.timing.refused} refused"
            found.message = f"{found.message}: {counts}, {self._skipped_ticks} ticks skipped"
        found.values = {
            "mode": mode,
            "reason": supervisor.reason,
            "cycle": str(self._cycle),
            "listeners": "{} matched of {}".format(*self._listeners),
            "late ticks": str(self._late_ticks),
            "skipped ticks": str(self._skipped_ticks),
            "contact force N": f"{self._message.f_tr:.1f}",
        }
        return found


def main() -> None:
    """Run the node."""
    sys.exit(run(RigNode))


if __name__ == "__main__":
    main()
