"""How a node speaks and listens on its topics: publishers, subscriptions and links, and the process that has them."""

from __future__ import annotations

import threading
from collections.abc import Callable
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message

from phil_base.scheduling import IN_CYCLE
from phil_node.box import Box
from phil_node.cycle_thread import CycleThread
from phil_node.exchange import HandedCycles, HandedFollower
from phil_node.link import Inlet, Outlet, address
from phil_node.outbox import Outbox, Topic
from phil_node.paths import CycleReceiver, CycleSender, Follower, Receiver, Sender
from phil_node.qos import NO_PUBLISHER_EVENTS, NO_SUBSCRIPTION_EVENTS
from phil_node.topics import NAMESAKES, TopicsProcess

if TYPE_CHECKING:
    from phil_node.composition import Composition, Member

R = TypeVar("R", bound=Receiver)

HAND_OVER = 1.0
"""Time in s that listeners have to take the last messages when a node is deactivated."""
DIAGNOSTICS = QoSProfile(depth=10)


class Wires:
    """The topics of a node, by a process of their own if it was told to `use` one, else by the node's own DDS.

    Args:
        node: whose topics they are.
        lock: of the node's state; callbacks are called with it held.
        failed: is told what went wrong in the cycle's thread.
        role: of the cycle's thread (``scheduling.ROLES``).
        priority: gives the priority of SCHED_FIFO that the process for topics needs, from whether all peers are linked.
    """

    def __init__(
        self,
        node: Node,
        lock: threading.RLock,  # type: ignore[valid-type]  # a function before Python 3.13
        failed: Callable[[BaseException], None],
        role: str,
        priority: Callable[[bool], int],
    ) -> None:
        self._node: Any = node
        self._lock: Any = lock
        self._priority = priority
        self.thread: CycleThread | Member = CycleThread(lock, failed, self._look, role)
        self.open = False
        self.process: TopicsProcess | None = None
        self._owner = 0
        """The node's number in the process for topics."""
        self._together: Composition | None = None
        self._failed = failed
        self._speaking = False
        self._outbox = Outbox("publish" if role in IN_CYCLE else role)
        self._receivers: list[Receiver] = []
        self._topics: list[Topic] = []
        self._outlets: list[Outlet | Box] = []
        self._heard: dict[int, str] = {}
        """Topics that are listened to by the process for topics, by their numbers."""
        self._diagnostics: Topic | None = None
        self._owned: list[tuple[Callable[[Any], Any], Any]] = []

    def use(self, process: TopicsProcess) -> None:
        """Speak and listen by a process of its own; before there is any topic."""
        self._owner = process.name(self._node.get_name(), self._node.get_namespace())
        self.process = self._outbox.process = process
        number = process.speak(DiagnosticArray, "/diagnostics", DIAGNOSTICS, self._owner)
        self._diagnostics = Topic("/diagnostics", number, None, 0)

    def share(self, together: Composition) -> None:
        """Share thread, outbox and process for topics with other nodes of this process; before there is any topic."""
        self._together = together
        self._outbox = together.outbox
        self.thread = together.member(self._lock, self._failed, self._look)
        self.use(together.process)

    @property
    def alone(self) -> bool:
        """Tell whether no other node shares the threads."""
        return self._together is None

    # Topics -----------------------------------------------------------------------------------------------------

    def sender(self, kind: Any, name: str, qos: QoSProfile) -> Sender:
        """Create a publisher that is silent unless the wires are open."""
        return Sender(self._topic(kind, name, qos), self._outbox)

    def cycle_sender(self, kind: Any, name: str, qos: QoSProfile, peers: int) -> CycleSender:
        """Create a publisher of a message a cycle that ``peers`` nodes of the loop wait for; it links them as well."""
        topic = self._topic(kind, name, qos)
        outlet: Outlet | Box
        if topic.box is not None:
            outlet = topic.box
            outlet.wanted = peers
        else:
            outlet = Outlet(address(self._domain, topic.name), peers)
        self._outlets.append(outlet)
        return CycleSender(topic, self._outbox, outlet)

    def _topic(self, kind: Any, name: str, qos: QoSProfile) -> Topic:
        full = self._node.resolve_topic_name(name)
        serialize_message(kind())  # the first of a kind takes 5 to 50 ms, to find its libraries
        if self.process is None:
            publisher = self._node.create_publisher(kind, name, qos, event_callbacks=NO_PUBLISHER_EVENTS)
            self._owned.append((self._node.destroy_publisher, publisher))
        kept = qos.depth if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL else 0
        speaker = publisher.handle if self.process is None else self.process.speak(kind, full, qos, self._owner)
        topic = Topic(full, speaker, Outlet(address(self._domain, full, followed=True), 0), kept)
        topic.open = self.open
        if self._together is not None:
            topic.box = self._together.exchange.open(full, kind, kept)
        self._topics.append(topic)
        self._outbox.topics = [*self._outbox.topics, topic]
        return topic

    def latched(self, kind: Any, name: str, qos: QoSProfile) -> Any:
        """Create a publisher of the node's own that speaks also while the wires are not open."""
        publisher = self._node.create_publisher(kind, name, qos, event_callbacks=NO_PUBLISHER_EVENTS)
        self._owned.append((self._node.destroy_publisher, publisher))
        return publisher

    def receiver(
        self, way: type[R], kind: Any, name: str, qos: QoSProfile, callback: Callable[[Any], None], always: bool = False
    ) -> R:
        """Listen, by the link to the sender if there is one; while the wires are not open only if ``always``."""
        full, process = self._node.resolve_topic_name(name), self.process
        number = 0

        def from_topic(data: bytes) -> None:
            with self._lock:
                if self.open or always:
                    receiver.from_topic(data)

        def when_open(message: Any) -> None:
            if self.open or always:
                callback(message)

        # Links of cycles are there only while the thread is.
        take = callback if way is CycleReceiver else when_open

        def linked(yes: bool) -> None:
            if process is not None:
                process.linked(number, yes)

        receiver: Receiver
        if isinstance(self.thread, CycleThread):
            inlet = Inlet(address(self._domain, full, followed=way is Follower))
            receiver = way(kind, inlet, self.thread, take, linked)
        else:
            receiver = (HandedFollower if way is Follower else HandedCycles)(kind, full, self.thread, take, linked)
        if process is not None:
            number = process.hear(kind, full, qos, from_topic, self._owner)
            self._heard[number] = full
            self._owned.append((process.drop, number))
        else:
            subscription = self._node.create_subscription(
                kind, name, from_topic, qos, raw=True, event_callbacks=NO_SUBSCRIPTION_EVENTS
            )
            self._owned.append((self._node.destroy_subscription, subscription))
        self._receivers.append(receiver)
        return receiver  # type: ignore[return-value]  # it is one of that way

    @property
    def _domain(self) -> int:
        return int(self._node.context.get_domain_id())

    def say(self, message: DiagnosticArray) -> None:
        """Publish on /diagnostics, whether the wires are open or not; see to the process for topics on the way."""
        process = self.process
        if self._diagnostics is None:
            handle = self._node.create_publisher(DiagnosticArray, "/diagnostics", DIAGNOSTICS).handle
            self._diagnostics = Topic("/diagnostics", handle, None, 0)
        if process is not None and process.gone:
            self._node.log.error("the process for the node's topics is gone: it is started again")
            process.revive()
            if self.open:
                self._watch(process)
        elif process is not None and not self.open:
            process.receive()  # else nobody does, and it would wait for room to tell its counts
        self._outbox.say(self._diagnostics, serialize_message(message))

    # Open and closed ----------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Link who is there already, drop what came while the wires were not open, and open them."""
        if self.process is not None:
            self.process.receive()
            self._watch(self.process)
        for receiver in self._receivers:
            receiver.look()
            if isinstance(receiver, Follower):
                receiver.drain()
        self._set(True)
        self._outbox.start()
        self._speaking = True

    def begin(self) -> None:
        """Let the cycle run."""
        self.thread.start()

    def halt(self) -> None:
        """Let the cycle end; what is still to be said can be published until `disconnect`."""
        self.open = False
        self.thread.stop()
        for receiver in self._receivers:
            if isinstance(receiver, CycleReceiver):
                receiver.close()

    def disconnect(self) -> None:
        """Publish what waits, and speak no more."""
        self._set(False)
        if self._speaking:
            self._speaking = False
            self._outbox.stop()

    def hand_over(self) -> None:
        """Let slow listeners take what was sent: with the publisher its samples go. A dead listener costs a second."""
        deadline = monotonic() + HAND_OVER
        self._outbox.hand_over(HAND_OVER, self._owner)
        for destroy, entity in self._owned:
            if destroy == self._node.destroy_publisher:
                entity.wait_for_all_acked(Duration(seconds=max(0.0, deadline - monotonic())))

    def clear(self) -> None:
        """End all topics."""
        for receiver in self._receivers:
            receiver.close()
        for outlet in self._outlets:
            if isinstance(outlet, Outlet) and outlet.alone:
                self.thread.forget(outlet.held.fileno())
            outlet.close()
        self._outbox.topics = [topic for topic in self._outbox.topics if topic not in self._topics]
        for topic in self._topics:
            if topic.outlet is not None:
                topic.outlet.close()
            if self._together is not None and topic.box is not None:
                self._together.exchange.close(topic.name, topic.box)
            if self.process is not None:
                self.process.drop(topic.publisher)
        for destroy, entity in reversed(self._owned):
            destroy(entity)
        for several in (self._receivers, self._outlets, self._topics, self._owned):
            several.clear()  # type: ignore[attr-defined]  # lists of different kinds
        self._heard.clear()

    def close(self) -> None:
        """End the threads and the process, unless others share them; the node's own entities go with it."""
        self.halt()
        self.disconnect()
        self.clear()
        if self.process is not None and self._together is None:
            self.process.close()

    def _set(self, yes: bool) -> None:
        if self.process is not None:
            self.process.active(yes, self._owner)
        for topic in self._topics:
            topic.open = yes
        self.open = yes

    def _watch(self, process: TopicsProcess) -> None:
        file = process.file

        def receive() -> None:
            if not process.receive():
                self.thread.forget(file)

        self.thread.watch(file, receive)

    def _look(self) -> None:
        """Link who has come; in the cycle's thread."""
        for outlet in self._outlets:
            if isinstance(outlet, Outlet) and outlet.alone:
                self.thread.watch(outlet.held.fileno(), outlet.accept)
        for receiver in self._receivers:
            receiver.look()
        if self.process is not None:
            linked = all(len(outlet.peers) >= outlet.wanted for outlet in self._outlets)
            linked = linked and all(receiver.linked for receiver in self._receivers)
            self.process.schedule(self._priority(linked), self._owner)

    # Figures ------------------------------------------------------------------------------------------------------

    def figures(self) -> dict[str, str]:
        """Give figures for /diagnostics; none if there are no links."""
        wanted = len(self._receivers) + sum(outlet.wanted for outlet in self._outlets)
        if not wanted:
            return {}
        linked = sum(receiver.linked for receiver in self._receivers)
        found = {"links": f"{linked + sum(len(outlet.peers) for outlet in self._outlets)} of {wanted}"}
        if process := self.process:
            found["process for topics"] = str(process.pid)
            found["restarts of it"] = str(process.deaths)
            found["batches not published"] = str(process.dropped)
        followed = sum(topic.outlet.dropped for topic in self._topics if topic.outlet is not None)
        found["messages dropped by links"] = str(followed + sum(outlet.dropped for outlet in self._outlets))
        return found

    def contested(self) -> list[str]:
        """Give the topics that the node listens to and more than one publishes."""
        process = self.process
        if process is None or not self.open:
            return []
        return [topic for number, topic in self._heard.items() if process.counts.get(number, 0) > 1]

    def namesakes(self) -> int:
        """Count the nodes of this name; a look at the graph may wait for DDS, and would keep the cycle waiting."""
        if self.process is None:
            return int(self._node.count_services(f"{self._node.full_name}/reset"))
        return self.process.counts.get(NAMESAKES - self._owner, 0)
