"""The lifecycle base of every node: parameters, diagnostics, timing and reset, in one place."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from time import time_ns
from typing import Any, Generic, TypeVar

from phil_interfaces.msg import CycleTiming
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger

from phil_base.parameters import Group, ParameterError, defaults, infos, values_of
from phil_base.real_time import FIFO, Granted, apply, set_thread
from phil_base.scheduling import CYCLE as CYCLE_PRIORITY
from phil_base.scheduling import IN_CYCLE, MIDDLE, priority_of
from phil_node import collector
from phil_node.answers import Answers
from phil_node.bounded_log import BoundedLog
from phil_node.changes import as_declared, fixed_while_active, merged
from phil_node.cycle_thread import CycleTimer
from phil_node.declare import declare
from phil_node.diagnosis import ERROR, LOOK, OK, STALE, WARN, Diagnosis, Reporter
from phil_node.paths import CycleReceiver, CycleSender, Follower, Sender
from phil_node.process import RCLError, leave, run
from phil_node.qos import CYCLE
from phil_node.timing import Timing
from phil_node.wires import Wires

P = TypeVar("P", bound=Group)

QUIET = 1.0
"""Time in s without a cycle after which a ride counts as over."""
SWITCH = 5e-5
"""Time in s for which the cycle's thread at most waits for Python code of another thread of its process."""
LONG_SWITCH = 1e-3
"""The same in lockstep for a thread that has the cycles of several nodes, and never waits by itself."""
LOCKSTEP = "lockstep"
"""Value of the parameter ``mode`` of a ride that waits for its cycles; any other runs by the wall clock."""

__all__ = ["ERROR", "OK", "STALE", "WARN", "Diagnosis", "PhilNode", "leave", "run"]


class PhilNode(LifecycleNode, Generic[P]):  # type: ignore[misc]
    """Lifecycle node with parameters from a model; a node overrides ``build``, ``start``, ``stop``, ``reset``, ...

    Raises
    ------
    ParameterError
        The node was started with a parameter that is unknown, of a wrong type or out of range.
    """

    threads_role = "transport"
    """Role (``scheduling.ROLES``) of the process's threads that have no other."""
    cycle_role = "controller"
    """Role of the thread of its cycle."""

    def __init__(self, name: str, model: type[P]) -> None:
        try:
            super().__init__(name, automatically_declare_parameters_from_overrides=True)
        except ValueError as error:
            # An empty list in a parameter file has no type that rclpy could keep.
            raise ParameterError(f"{name}: a parameter was given without a value ([]): {error}") from None
        self._model = model
        self._live = frozenset(info.name for info in infos(model) if info.live)
        self.parameters: P = declare(self, model, defaults(name))
        self.timing = Timing()
        self.finished = Future()
        # Held by whoever touches the cycle's state: its thread, or the executor's for services, timers and parameters.
        self.lock = threading.RLock()
        self.failure: BaseException | None = None
        self.wires = Wires(self, self.lock, self._fail, self.cycle_role, self._priority_for_topics)
        self.configured = False
        self.active = False
        self.has_process = False
        self.granted = Granted()
        self._stale_build = False
        self._owned: list[tuple[Callable[[Any], Any], Any]] = []
        self.add_pre_set_parameters_callback(self._prepare_parameters)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._take_parameters)
        self.log = BoundedLog(lambda: self.get_logger())
        self._failure = ""
        self._reporter = Reporter(self.full_name, self.wires.say, self._diagnosis, self._all_signs, self.ride_time)
        # No timer of ours on the ROS clock: under use_sim_time it stands still until somebody publishes /clock.
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clock_missed = False
        self._timer = self.create_timer(LOOK, self._reporter.look, clock=self.steady)
        self._reset_service = self.create_service(Trigger, "~/reset", self._serve_reset)
        self.answers = Answers(self, self._nobody_heard)

    # What a node overrides -------------------------------------------------------------------------------------

    def build(self) -> None:
        """Design the model from ``self.parameters``, create publishers and subscriptions, compile kernels."""
        raise NotImplementedError

    def start(self) -> None:
        """Bring the state to its initial value and send the first messages."""

    def stop(self) -> None:
        """Stop what moves."""

    def discard(self) -> None:
        """Drop the design; publishers, subscriptions and timers made through this class are destroyed after it."""

    def reset(self) -> None:
        """Bring the state to its initial value while configured."""

    def changed(self, names: frozenset[str]) -> None:
        """Take live parameters that were set: ``self.parameters`` has the new values."""

    def diagnose(self) -> Diagnosis:
        """Say how the node is, once a second."""
        return Diagnosis()

    def signs(self) -> tuple[object, ...]:
        """Give what the level of `diagnose` hangs on, cheaply: a change of it is told at once."""
        return ()

    def silence(self) -> str:
        """Say what does not come any more although the ride goes on, empty if nothing is missing: level STALE."""
        return ""

    def stuck(self) -> bool:
        """Tell whether the node cannot go on by itself: what it waits for comes, but cannot be used."""
        return self.timing.stuck

    def newest(self) -> tuple[int, float]:
        """Give the stamp of the newest cycle in ns, and how long ago that was in s; (0, ...) before the first."""
        return self.timing.stamp, self.timing.idle

    # What a node uses ------------------------------------------------------------------------------------------

    @property
    def full_name(self) -> str:
        """Give the node's name with its namespace."""
        return str(self.get_fully_qualified_name())

    def wall_clock(self) -> int:
        """Give the wall time in ns: that of /clock under use_sim_time, but the system's if nobody publishes it."""
        return int(self.get_clock().now().nanoseconds) or time_ns()

    def ride_time(self) -> int:
        """Give the time of the ride in ns, the stamp of what belongs to no cycle.

        In lockstep it goes on with the cycles, t_k = k Ts, and stands at 0 before them. In real time it is the wall
        clock up to cycle 0 and runs on from the newest stamp, whatever becomes of the wall clock.
        """
        stamp, ago = self.newest()
        if getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP:
            return stamp
        return stamp + round(ago * 1e9) if stamp else self.wall_clock()

    def publish_on(self, kind: Any, name: str, qos: QoSProfile = CYCLE) -> Sender:
        """Create a publisher that is silent unless the node is active."""
        return self.wires.sender(kind, name, qos)

    def send_cycles(self, kind: Any, name: str, qos: QoSProfile, peers: int) -> CycleSender:
        """Create a publisher of a message a cycle that ``peers`` nodes of the loop wait for; it links them as well."""
        return self.wires.cycle_sender(kind, name, qos, peers)

    def publish_always(self, kind: Any, name: str, qos: QoSProfile) -> Any:
        """Create a publisher that also speaks while the node is configured but not active (latched data)."""
        return self.wires.latched(kind, name, qos)

    def listen(
        self, kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None], always: bool = False
    ) -> Follower:
        """Listen to a topic that nobody waits for; by a link to its sender, in batches, if there is one.

        ``callback`` is called with the node's lock held; messages that come while the node is not active are dropped,
        unless ``always``.
        """
        return self.wires.receiver(Follower, kind, name, qos, callback, always)

    def receive_cycles(self, kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None]) -> CycleReceiver:
        """Listen to a message a cycle, by the link to its sender if there is one, and on the topic.

        ``callback`` is called with the node's lock held; messages that come while the node is not active are dropped.
        """
        return self.wires.receiver(CycleReceiver, kind, name, qos, callback)

    def cycle_timer(self, period: float, callback: Callable[[], None]) -> CycleTimer:
        """Create a timer of the cycle's thread, which stands still until its ``reset``; it goes with the design."""
        timer = self.wires.thread.timer(period, callback)
        self._owned.append((self.wires.thread.drop, timer))
        return timer

    def every(self, period: float, callback: Callable[[], None]) -> Any:
        """Create a timer of ``period`` s that runs while the node is active."""

        def when_active() -> None:
            with self.lock:
                if self.active:
                    callback()

        timer = self.create_timer(period, when_active, clock=self.steady)
        self._owned.append((self.destroy_timer, timer))
        return timer

    def serve(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> Any:
        """Create a service for the life of the node (call it in ``__init__``); unless configured it refuses.

        A service that went with the design would take with it the requests that wait, and the node, which would answer
        through a handle that is gone. ``kind`` has an answer of ``success`` and ``message``.
        """

        def answer(request: Any, response: Any) -> Any:
            if not self.configured:
                response.success, response.message = False, f"{self.get_name()} is not configured"
                return response
            try:
                with self.lock:
                    return callback(request, response)
            except Exception as error:
                self.log.error(f"{name}: {error}")
                response.success, response.message = False, str(error) or type(error).__name__
                return response

        return self.create_service(kind, name, answer)

    def time_cycles(self, budget: float, count_overruns: bool = True) -> None:
        """Create ~/timing and send the batches of ``self.timing`` there; ``budget`` is the cycle time in s."""
        publisher = self.publish_on(CycleTiming, "~/timing", CYCLE)
        self.timing.connect(CycleTiming(), publisher.publish, budget, count_overruns)

    # Lifecycle -------------------------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Build; a failure leaves the node unconfigured and says why."""
        return self._attempt("configure", self._build)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Rebuild if parameters changed, freeze the garbage collector, start."""

        def activate() -> None:
            if self._stale_build:
                self._tear_down()
                self._build()
            self.timing.clear()
            self.log.prepare()
            collector.hold(self)
            in_lockstep = getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP
            sys.setswitchinterval(LONG_SWITCH if in_lockstep and not self.wires.alone else SWITCH)
            self._ask_system()
            # Publishers first: start() may publish at once.
            LifecycleNode.on_activate(self, state)
            self.wires.connect()
            self.active = True
            try:
                with self.lock:
                    self.start()
            except Exception:
                self.active = False
                self.wires.disconnect()
                LifecycleNode.on_deactivate(self, state)
                collector.release(self)
                raise
            self.wires.begin()

        return self._attempt("activate", activate)

    def _ask_system(self) -> None:
        """Ask for what real time needs; a process that belongs to others as well (a test's) is left as it is."""
        wanted = getattr(self.parameters, "real_time", None)
        if not self.has_process or wanted is None:
            return
        in_lockstep = getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP
        alone = self.wires.alone
        self.granted = apply(wanted, self.threads_role if alone else MIDDLE, level=in_lockstep)
        if self.cycle_role in IN_CYCLE or not alone:
            set_thread("serve")
        for line in () if in_lockstep else self.granted.advice:
            self.get_logger().warning(line)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop and let the garbage collector work again."""
        result = self._attempt("deactivate", self._halt)
        LifecycleNode.on_deactivate(self, state)
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Drop the design and everything that it published."""
        return self._attempt("clean up", self._tear_down)

    def _LifecycleNodeMixin__change_state(self, transition_id: int) -> TransitionCallbackReturn:
        # rclpy lets a request for a transition that the present state does not have escape as an exception, which would
        # end the process: a slip of the operator must not take the drive's supervisor away.
        try:
            return super()._LifecycleNodeMixin__change_state(transition_id)
        except RCLError:
            state = self._state_machine.current_state[1]
            self.log.error(f"there is no transition {transition_id} from the state '{state}': nothing done")
            return TransitionCallbackReturn.FAILURE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop, drop the design and end the process."""
        if self.active:
            self._attempt("deactivate", self._halt)
        if self.configured:
            self._attempt("clean up", self._tear_down)
        if not self.finished.done():
            self.finished.set_result(None)
        return TransitionCallbackReturn.SUCCESS

    def _attempt(self, what: str, action: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            action()
        except Exception as error:
            self._failure = f"cannot {what}: {str(error) or type(error).__name__}"
            self.log.error(self._failure)
            return TransitionCallbackReturn.FAILURE
        self._failure = ""
        return TransitionCallbackReturn.SUCCESS

    def _build(self) -> None:
        self.timing.clear()
        try:
            self.build()
        except Exception:
            self._destroy_owned()
            raise
        self.configured = True
        self._stale_build = False

    def _halt(self) -> None:
        self.active = False
        self.wires.halt()
        collector.release(self)
        self.stop()
        self.timing.finish()
        self.wires.disconnect()
        self.wires.hand_over()

    def destroy_node(self) -> None:
        """Destroy the node, after its threads have ended."""
        self.active = False
        self.wires.close()
        super().destroy_node()

    def _priority_for_topics(self, linked: bool) -> int:
        """Let the process for topics go first where the loop needs it: in lockstep, and for peers without a link."""
        wanted = getattr(self.parameters, "real_time", None)
        in_lockstep = getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP
        if wanted is None or wanted.scheduling != FIFO or (linked and not in_lockstep):
            return 0
        return priority_of("transport", wanted.priority or CYCLE_PRIORITY, in_lockstep)

    def _fail(self, error: BaseException) -> None:
        """Keep what went wrong in the cycle's thread: the process ends with it."""
        self.active = False
        self.failure = error

    def _tear_down(self) -> None:
        self.configured = False
        try:
            self.discard()
        finally:
            self._destroy_owned()

    def _destroy_owned(self) -> None:
        self.wires.clear()
        for destroy, entity in reversed(self._owned):
            destroy(entity)
        self._owned.clear()

    # Services, parameters, diagnostics -------------------------------------------------------------------------

    def _serve_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.configured:
            response.success, response.message = False, f"{self.get_name()} is not configured"
            return response
        if self.active and self.timing.idle < QUIET:
            reason = "a ride is going on: end it first (emergency stop, or deactivate test_rig_sim)"
            response.success, response.message = False, f"{self.get_name()} was not reset: {reason}"
            return response
        try:
            with self.lock:
                self.timing.finish()
                self.timing.clear()
                self.reset()
        except Exception as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.message = True, f"{self.get_name()} is back at its initial state"
        return response

    def _nobody_heard(self, name: str) -> None:
        self.log.warning(
            f"nobody heard an answer of {name}: who asked is gone, or cannot hear this node (quality of service?)"
        )

    def _prepare_parameters(self, changes: list[Parameter]) -> list[Parameter]:
        return as_declared(self.get_name(), self._model, changes)

    def _check_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        reason = fixed_while_active(self.get_name(), self._live, changes) if self.active else ""
        if not reason:
            try:
                merged(self.parameters, changes)
            except ParameterError as error:
                reason = str(error)
        return SetParametersResult(successful=not reason, reason=reason)

    def _take_parameters(self, changes: list[Parameter]) -> None:
        ours = values_of(self.parameters).keys()
        names = frozenset(change.name for change in changes if change.name in ours)
        if not names:
            return
        with self.lock:
            self.parameters = merged(self.parameters, changes)
            if self.configured and not names <= self._live:
                self._stale_build = True
            elif self.configured:
                self.changed(names)

    def _publish_diagnosis(self) -> None:
        self._reporter.publish()

    def _all_signs(self) -> tuple[object, ...]:
        timing, state = self.timing, (self.active, self.configured, self._failure)
        if not self.active:
            return state
        counted = bool(timing.late), bool(timing.missing), len(timing.refusals)
        return (*state, *counted, len(self.wires.contested()), self.stuck(), bool(self.silence()), *self.signs())

    def _diagnosis(self) -> Diagnosis:
        """Say how the node is: what its own `diagnose` says, and what is the same for all nodes."""
        timing = self.timing
        if self.active:
            found = self.diagnose()
            if self.stuck() and found.level != ERROR:
                found.level, found.message = ERROR, f"cannot go on: {'; '.join(timing.refusals)}"
            elif silence := self.silence():
                found.add(STALE, silence)
        else:
            found = Diagnosis(message="configured" if self.configured else "unconfigured")
        if self._failure:
            found.add(WARN, self._failure)
        for topic in self.wires.contested():
            found.add(WARN, f"{topic} has a second publisher: end it")
        if self.wires.namesakes() > 1:
            found.add(WARN, f"another node on this ROS domain is called {self.full_name}, too: end one of them")
        own = {
            "process": str(os.getpid()),
            "answers that nobody heard": str(self.answers.given_up),
            **self.granted.figures,
            **self.wires.figures(),
        }
        if self._misses_clock():
            own["clock"] = "the system's: use_sim_time is set, but nothing came on /clock"
        counts = {"late": timing.late, "missing": timing.missing, "stale": timing.stale, "refused": timing.refused}
        last = {"last incident s ago": self._reporter.since_last(**counts)}
        found.values = {**own, **timing.summary(), **last, **found.values}
        return found

    def _misses_clock(self) -> bool:
        """Tell whether use_sim_time is set without a /clock, and say it once in the log."""
        clock = self.get_clock()
        missing = bool(clock.ros_time_is_active) and clock.now().nanoseconds == 0
        if missing and not self._clock_missed and self.active:
            self._clock_missed = True
            self.log.warning("use_sim_time is set, but nothing came on /clock: going on by the system's clock")
        return missing
