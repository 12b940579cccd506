"""The lifecycle base of every node: parameters, diagnostics, timing and reset, in one place."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import partial
from time import time_ns
from typing import Any, Generic, TypeVar

from phil_interfaces.msg import CycleTiming
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_srvs.srv import Trigger

from phil_base.parameters import Group, ParameterError, defaults
from phil_base.real_time import Granted
from phil_node import collector, services, system
from phil_node.answers import Answers
from phil_node.bounded_log import BoundedLog
from phil_node.changes import Changes
from phil_node.cycle_thread import CycleTimer
from phil_node.declare import declare
from phil_node.diagnosis import ERROR, LOOK, OK, STALE, WARN, Diagnosis
from phil_node.health import Health
from phil_node.paths import CycleReceiver, CycleSender, Follower, Sender
from phil_node.process import RCLError, leave, run
from phil_node.qos import CYCLE
from phil_node.services import QUIET
from phil_node.timing import Timing
from phil_node.wires import Wires

P = TypeVar("P", bound=Group)

__all__ = ["ERROR", "OK", "QUIET", "STALE", "WARN", "Diagnosis", "PhilNode", "leave", "run"]


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
        self.parameters: P = declare(self, model, defaults(name))
        self.timing = Timing()
        self.finished = Future()
        # Held by whoever touches the cycle's state: its thread, or the executor's for services, timers and parameters.
        self.lock = threading.RLock()
        self.failure: BaseException | None = None
        self.wires = Wires(self, self.lock, self._fail, self.cycle_role, partial(system.priority_for_topics, self))
        self.configured = False
        self.active = False
        self.has_process = False
        self.granted = Granted()
        self._owned: list[tuple[Callable[[Any], Any], Any]] = []
        self.changes = Changes(self, model)
        self.log = BoundedLog(lambda: self.get_logger())
        self.health = Health(self)
        # No timer of ours on the ROS clock: under use_sim_time it stands still until somebody publishes /clock.
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self.create_timer(LOOK, self.health.look, clock=self.steady)
        self._reset_service = self.create_service(Trigger, "~/reset", partial(services.reset, self))
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
        if system.in_lockstep(self.parameters):
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
        return self.create_service(kind, name, partial(services.answer, self, name, callback))

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
            if self.changes.stale:
                self._tear_down()
                self._build()
            self.timing.clear()
            self.log.prepare()
            collector.hold(self)
            self.granted = system.ask(self)
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
            self.health.failure = f"cannot {what}: {str(error) or type(error).__name__}"
            self.log.error(self.health.failure)
            return TransitionCallbackReturn.FAILURE
        self.health.failure = ""
        return TransitionCallbackReturn.SUCCESS

    def _build(self) -> None:
        self.timing.clear()
        try:
            self.build()
        except Exception:
            self._destroy_owned()
            raise
        self.configured = True
        self.changes.stale = False

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

    def _nobody_heard(self, name: str) -> None:
        self.log.warning(
            f"nobody heard an answer of {name}: who asked is gone, or cannot hear this node (quality of service?)"
        )
