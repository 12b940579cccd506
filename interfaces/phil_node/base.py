"""The lifecycle base of every node: parameters, diagnostics, timing and reset, in one place."""

from __future__ import annotations

import gc
import os
import sys
import threading
from collections.abc import Callable
from time import monotonic, time_ns
from typing import Any, Generic, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from phil_interfaces.msg import CycleTiming
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.task import Future
from std_srvs.srv import Trigger

from phil_node.bounded_log import BoundedLog
from phil_node.changes import as_declared, fixed_while_active, merged
from phil_node.cycle_thread import CycleThread, CycleTimer
from phil_node.declare import declare
from phil_node.diagnosis import ERROR, LOOK, OK, STALE, WARN, Diagnosis, Reporter
from phil_node.link import Inlet, Outlet, address
from phil_node.outbox import Outbox, Topic
from phil_node.parameters import Group, ParameterError, defaults, infos, values_of
from phil_node.paths import CycleReceiver, CycleSender, Follower, Receiver, Sender
from phil_node.process import RCLError, leave, run
from phil_node.qos import CYCLE, NO_PUBLISHER_EVENTS, NO_SUBSCRIPTION_EVENTS
from phil_node.real_time import FIFO, Granted, apply
from phil_node.scheduling import CYCLE as CYCLE_PRIORITY
from phil_node.scheduling import priority_of
from phil_node.timing import Timing
from phil_node.topics import NAMESAKES, TopicsProcess

P = TypeVar("P", bound=Group)
R = TypeVar("R", bound=Receiver)

HAND_OVER = 1.0
"""Time in s that listeners have to take the last messages when a node is deactivated."""
QUIET = 1.0
"""Time in s without a cycle after which a ride counts as over."""
SWITCH = 5e-5
"""Time in s for which the cycle's thread at most waits for Python code of another thread of its process."""
DIAGNOSTICS = QoSProfile(depth=10)
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
        self._outbox = Outbox()
        self._thread = CycleThread(self.lock, self._fail, self._look_for_peers, self.cycle_role)
        self._receivers: list[Receiver] = []
        self._heard: dict[int, str] = {}
        """Topics that are listened to by the process for topics, by their numbers."""
        self._outlets: list[Outlet] = []
        self._diagnostics: Topic | None = None
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
        self._reporter = Reporter(self.full_name, self._say, self._diagnosis, self._all_signs, self.ride_time)
        # No timer of ours on the ROS clock: under use_sim_time it stands still until somebody publishes /clock.
        self.steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clock_missed = False
        self._timer = self.create_timer(LOOK, self._reporter.look, clock=self.steady)
        self._reset_service = self.create_service(Trigger, "~/reset", self._serve_reset)

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

    def use(self, process: TopicsProcess) -> None:
        """Speak and listen on topics by a process of its own; before the node is configured."""
        process.name(self.get_name(), self.get_namespace())
        self._outbox.process = process
        number = process.speak(DiagnosticArray, "/diagnostics", DIAGNOSTICS)
        self._diagnostics = Topic("/diagnostics", number, None, 0)

    def publish_on(self, kind: Any, name: str, qos: QoSProfile = CYCLE) -> Sender:
        """Create a publisher that is silent unless the node is active."""
        return Sender(self._topic(kind, name, qos), self._outbox)

    def send_cycles(self, kind: Any, name: str, qos: QoSProfile, peers: int) -> CycleSender:
        """Create a publisher of a message a cycle that ``peers`` nodes of the loop wait for; it links them as well."""
        topic = self._topic(kind, name, qos)
        outlet = Outlet(address(self.context.get_domain_id(), topic.name), peers)
        self._outlets.append(outlet)
        return CycleSender(topic, self._outbox, outlet)

    def _topic(self, kind: Any, name: str, qos: QoSProfile) -> Topic:
        full, process = self.resolve_topic_name(name), self._outbox.process
        serialize_message(kind())  # the first of a kind takes 5 to 50 ms, to find its libraries
        if process is None:
            publisher = self.create_publisher(kind, name, qos, event_callbacks=NO_PUBLISHER_EVENTS)
            self._owned.append((self.destroy_publisher, publisher))
        kept = qos.depth if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL else 0
        outlet = Outlet(address(self.context.get_domain_id(), full, followed=True), 0)
        speaker = publisher.handle if process is None else process.speak(kind, full, qos)
        topic = Topic(full, speaker, outlet, kept)
        topic.open = self.active
        self._outbox.topics.append(topic)
        return topic

    def publish_always(self, kind: Any, name: str, qos: QoSProfile) -> Any:
        """Create a publisher that also speaks while the node is configured but not active (latched data)."""
        publisher = self.create_publisher(kind, name, qos, event_callbacks=NO_PUBLISHER_EVENTS)
        self._owned.append((self.destroy_publisher, publisher))
        return publisher

    def listen(
        self, kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None], always: bool = False
    ) -> Follower:
        """Listen to a topic that nobody waits for; by a link to its sender, in batches, if there is one.

        ``callback`` is called with the node's lock held; messages that come while the node is not active are dropped,
        unless ``always``.
        """

        def when_active(message: Any) -> None:
            if self.active or always:
                callback(message)

        return self._receive(Follower, kind, name, qos, when_active, always)

    def receive_cycles(self, kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None]) -> CycleReceiver:
        """Listen to a message a cycle, by the link to its sender if there is one, and on the topic.

        ``callback`` is called with the node's lock held; messages that come while the node is not active are dropped.
        """
        return self._receive(CycleReceiver, kind, name, qos, callback, False)

    def _receive(
        self, way: type[R], kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None], always: bool
    ) -> R:
        full, process = self.resolve_topic_name(name), self._outbox.process
        inlet = Inlet(address(self.context.get_domain_id(), full, followed=way is Follower))
        number = 0

        def when_active(data: bytes) -> None:
            with self.lock:
                if self.active or always:
                    receiver.from_topic(data)

        def linked(yes: bool) -> None:
            if process is not None:
                process.linked(number, yes)

        receiver = way(kind, inlet, self._thread, callback, linked)
        if process is not None:
            number = process.hear(kind, full, qos, when_active)
            self._heard[number] = full
            self._owned.append((process.drop, number))
        else:
            subscription = self.create_subscription(
                kind, name, when_active, qos, raw=True, event_callbacks=NO_SUBSCRIPTION_EVENTS
            )
            self._owned.append((self.destroy_subscription, subscription))
        self._receivers.append(receiver)
        return receiver

    def cycle_timer(self, period: float, callback: Callable[[], None]) -> CycleTimer:
        """Create a timer of the cycle's thread, which stands still until its ``reset``; it goes with the design."""
        timer = self._thread.timer(period, callback)
        self._owned.append((self._thread.drop, timer))
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
            gc.collect()
            gc.freeze()
            gc.disable()
            sys.setswitchinterval(SWITCH)
            self._ask_system()
            # Publishers first: start() may publish at once.
            LifecycleNode.on_activate(self, state)
            self._connect()
            self._open(True)
            try:
                with self.lock:
                    self.start()
            except Exception:
                self._open(False)
                LifecycleNode.on_deactivate(self, state)
                gc.enable()
                gc.unfreeze()
                raise
            self._thread.start()

        return self._attempt("activate", activate)

    def _connect(self) -> None:
        """Link who is there already, and drop what came while this node was not active."""
        if self._outbox.process is not None:
            self._outbox.process.receive()
            self._watch_process()
        for receiver in self._receivers:
            receiver.look()
            if isinstance(receiver, Follower):
                receiver.drain()

    def _watch_process(self) -> None:
        process = self._outbox.process
        assert process is not None
        file = process.file

        def receive() -> None:
            if not process.receive():
                self._thread.forget(file)

        self._thread.watch(file, receive)

    def _open(self, yes: bool) -> None:
        """Begin or end to take messages, and to publish."""
        process = self._outbox.process
        if process is not None:
            process.active(yes)
        for topic in self._outbox.topics:
            topic.open = yes
        if yes:
            self._outbox.start()
        self.active = yes
        if not yes:
            self._outbox.stop()

    def _ask_system(self) -> None:
        """Ask for what real time needs; a process that belongs to others as well (a test's) is left as it is."""
        wanted = getattr(self.parameters, "real_time", None)
        if not self.has_process or wanted is None:
            return
        in_lockstep = getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP
        self.granted = apply(wanted, self.threads_role, level=in_lockstep)
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
        self._thread.stop()
        for receiver in self._receivers:
            if isinstance(receiver, CycleReceiver):
                receiver.close()
        gc.enable()
        gc.unfreeze()
        self.stop()
        self.timing.finish()
        self._open(False)
        self._hand_over()

    def destroy_node(self) -> None:
        """Destroy the node, after its threads have ended."""
        self.active = False
        self._thread.stop()
        self._outbox.stop()
        self._close_links()
        if self._outbox.process is not None:
            self._outbox.process.close()
        super().destroy_node()

    def _close_links(self) -> None:
        for receiver in self._receivers:
            receiver.close()
        for outlet in self._outlets:
            if outlet.alone:
                self._thread.forget(outlet.held.fileno())
            outlet.close()
        for topic in self._outbox.topics:
            if topic.outlet is not None:
                topic.outlet.close()
            if self._outbox.process is not None:
                self._outbox.process.drop(topic.publisher)
        self._receivers.clear()
        self._heard.clear()
        self._outlets.clear()
        self._outbox.topics.clear()

    def _look_for_peers(self) -> None:
        """Link who has come; in the cycle's thread."""
        for outlet in self._outlets:
            if outlet.alone:
                self._thread.watch(outlet.held.fileno(), outlet.accept)
        for receiver in self._receivers:
            receiver.look()
        self._schedule_process()

    def _schedule_process(self) -> None:
        """Let the process for topics go first where the loop needs it: in lockstep, and for peers without a link."""
        process, wanted = self._outbox.process, getattr(self.parameters, "real_time", None)
        if process is None or wanted is None:
            return
        in_lockstep = getattr(self.parameters, "mode", LOCKSTEP) == LOCKSTEP
        linked = all(len(outlet.peers) >= outlet.wanted for outlet in self._outlets)
        linked = linked and all(receiver.linked for receiver in self._receivers)
        first = wanted.scheduling == FIFO and (in_lockstep or not linked)
        process.schedule(priority_of("publish", wanted.priority or CYCLE_PRIORITY, in_lockstep) if first else 0)

    def _fail(self, error: BaseException) -> None:
        """Keep what went wrong in the cycle's thread: the process ends with it."""
        self.active = False
        self.failure = error

    def _hand_over(self) -> None:
        """Let slow listeners take what was sent: with the publisher its samples go. A dead listener costs a second."""
        deadline = monotonic() + HAND_OVER
        self._outbox.hand_over(HAND_OVER)
        for destroy, entity in self._owned:
            if destroy == self.destroy_publisher:
                entity.wait_for_all_acked(Duration(seconds=max(0.0, deadline - monotonic())))

    def _tear_down(self) -> None:
        self.configured = False
        try:
            self.discard()
        finally:
            self._destroy_owned()

    def _destroy_owned(self) -> None:
        self._close_links()
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

    def _say(self, message: Any) -> None:
        process = self._outbox.process
        if self._diagnostics is None:
            handle = self.create_publisher(DiagnosticArray, "/diagnostics", DIAGNOSTICS).handle
            self._diagnostics = Topic("/diagnostics", handle, None, 0)
        if process is not None and process.gone:
            self._revive(process)
        elif process is not None and not self.active:
            process.receive()  # else nobody does, and it would wait for room to tell its counts
        self._outbox.say(self._diagnostics, serialize_message(message))

    def _revive(self, process: TopicsProcess) -> None:
        self.log.error("the process for the node's topics is gone: it is started again")
        process.revive()
        if self.active:
            self._watch_process()

    def _publish_diagnosis(self) -> None:
        self._reporter.publish()

    def _all_signs(self) -> tuple[object, ...]:
        timing, state = self.timing, (self.active, self.configured, self._failure)
        if not self.active:
            return state
        counted = bool(timing.late), bool(timing.missing), len(timing.refusals)
        return (*state, *counted, len(self._contested()), self.stuck(), bool(self.silence()), *self.signs())

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
        for topic in self._contested():
            found.add(WARN, f"{topic} has a second publisher: end it")
        if self._namesakes() > 1:
            found.add(WARN, f"another node on this ROS domain is called {self.full_name}, too: end one of them")
        own = {"process": str(os.getpid()), **self.granted.figures}
        if wanted := len(self._receivers) + sum(outlet.wanted for outlet in self._outlets):
            linked = sum(receiver.linked for receiver in self._receivers)
            own["links"] = f"{linked + sum(len(outlet.peers) for outlet in self._outlets)} of {wanted}"
        if process := self._outbox.process:
            own["process for topics"] = str(process.pid)
            own["restarts of it"] = str(process.deaths)
            own["batches not published"] = str(process.dropped)
        own["messages dropped by links"] = str(self._dropped())
        if self._misses_clock():
            own["clock"] = "the system's: use_sim_time is set, but nothing came on /clock"
        counts = {"late": timing.late, "missing": timing.missing, "stale": timing.stale, "refused": timing.refused}
        last = {"last incident s ago": self._reporter.since_last(**counts)}
        found.values = {**own, **timing.summary(), **last, **found.values}
        return found

    def _dropped(self) -> int:
        followed = sum(topic.outlet.dropped for topic in self._outbox.topics if topic.outlet is not None)
        return followed + sum(outlet.dropped for outlet in self._outlets)

    def _contested(self) -> list[str]:
        """Give the topics that this node listens to and more than one publishes."""
        process = self._outbox.process
        if process is None or not self.active:
            return []
        return [topic for number, topic in self._heard.items() if process.counts.get(number, 0) > 1]

    def _namesakes(self) -> int:
        """Count the nodes of this name; a look at the graph may wait for DDS, and would keep the cycle waiting."""
        process = self._outbox.process
        if process is None:
            return int(self.count_services(f"{self.full_name}/reset"))
        return process.counts.get(NAMESAKES, 0)

    def _misses_clock(self) -> bool:
        """Tell whether use_sim_time is set without a /clock, and say it once in the log."""
        clock = self.get_clock()
        missing = bool(clock.ros_time_is_active) and clock.now().nanoseconds == 0
        if missing and not self._clock_missed and self.active:
            self._clock_missed = True
            self.log.warning("use_sim_time is set, but nothing came on /clock: going on by the system's clock")
        return missing
