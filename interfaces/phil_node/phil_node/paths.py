"""The ways of a node's messages: the topic, for everybody, and links, for the loop's peers and those who follow it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.serialization import serialize_message

from phil_node.box import Box
from phil_node.cdr import Reader, Written
from phil_node.cycle_thread import CycleThread
from phil_node.link import Inlet, Outlet, messages_of
from phil_node.once import Once
from phil_node.outbox import Outbox, Topic


class Sender:
    """Publishes on a topic through the outbox; messages are rclpy's or `Written`."""

    def __init__(self, topic: Topic, outbox: Outbox) -> None:
        self.topic, self._outbox = topic, outbox
        self.topic_name = topic.name

    def get_subscription_count(self) -> int:
        """Give the number of those who take what is published: subscriptions that are matched, followers and peers."""
        return self.matched + self.linked

    @property
    def matched(self) -> int:
        """Give the number of subscriptions that are matched."""
        publisher, process = self.topic.publisher, self._outbox.process
        if process is not None:
            return process.counts.get(publisher, 0)
        with publisher:
            return int(publisher.get_subscription_count())

    @property
    def linked(self) -> int:
        """Give the number of those who take it by a link, or in this process."""
        box = self.topic.box
        return self.topic.followers + (len(box.peers) + len(box.followers) if box is not None else 0)

    def publish(self, message: Any) -> None:
        """Publish unless the node is inactive."""
        if self.topic.open:
            data = message.writer.bytes() if isinstance(message, Written) else serialize_message(message)
            if self.topic.box is not None:
                self.topic.box.send(data)
            self._outbox.post(self.topic, data)


class CycleSender(Sender):
    """Sends to the linked peers first, and publishes; at once while one of the loop's peers is not linked."""

    def __init__(self, topic: Topic, outbox: Outbox, outlet: Outlet | Box) -> None:
        """Publish on a topic, and send through ``outlet``: by sockets, or within this process."""
        super().__init__(topic, outbox)
        self.outlet = outlet

    @property
    def linked(self) -> int:
        """Give the number of those who take it by a link, or in this process."""
        return super().linked + (len(self.outlet.peers) if self.topic.box is None else 0)

    def publish(self, message: Any) -> None:
        """Send and publish unless the node is inactive."""
        topic = self.topic
        if not topic.open:
            return
        data = message.writer.bytes() if isinstance(message, Written) else serialize_message(message)
        outlet = self.outlet
        outlet.send(data)
        self._outbox.post(topic, data)
        if len(outlet.peers) < outlet.wanted:
            # A peer listens to the topic alone: it waits for this.
            self._outbox.flush()


class Receiver:
    """Takes each message once, whichever way it comes: by a link in the cycle's thread, or by the topic.

    A link that breaks, or that nobody offers, leaves the topic; a stranger there is heard and judged like the peer.
    """

    def __init__(
        self,
        kind: Any,
        inlet: Inlet,
        thread: CycleThread,
        callback: Callable[[Any], None],
        linked: Callable[[bool], None] = lambda yes: None,
    ) -> None:
        """Give messages of a kind to ``callback``; say it to ``linked`` when the link comes and goes."""
        self._reader, self._inlet, self._thread, self._callback = Reader(kind), inlet, thread, callback
        self._tell = linked
        self._once = Once()
        self.unreadable = 0

    @property
    def linked(self) -> bool:
        """Tell whether the sender is linked."""
        return self._inlet.socket is not None

    def look(self) -> None:
        """Connect if there is a sender; in the cycle's thread, or before it begins."""
        if self._inlet.connect():
            assert self._inlet.socket is not None
            file = self._inlet.socket.fileno()
            self._thread.watch(file, lambda: self._drain(file))
            self._tell(True)

    def close(self) -> None:
        """Disconnect, and forget what came."""
        self._once.clear()
        if self._inlet.socket is not None:
            self._thread.forget(self._inlet.socket.fileno())
            self._inlet.close()
            self._tell(False)

    def drain(self) -> None:
        """Take what waits; not beside the cycle's thread."""
        if self._inlet.socket is not None:
            self._drain(self._inlet.socket.fileno())

    def _drain(self, file: int) -> None:
        while (data := self._inlet.receive()) is not None:
            if not data:
                self._thread.forget(file)
                self._tell(False)
                return
            self._take_link(data)

    def _take_link(self, data: bytes) -> None:
        if self._once.from_link(data):
            self._take(data)

    def from_topic(self, data: bytes) -> None:
        """Take a message in CDR that came by DDS; with the node's lock held."""
        if self._once.from_topic(data):
            self._take(data)

    def _take(self, data: bytes) -> None:
        try:
            message = self._reader.read(data)
        except Exception:
            self.unreadable += 1
            return
        self._callback(message)


class CycleReceiver(Receiver):
    """Takes messages that peers of the loop send one by one."""


class Follower(Receiver):
    """Takes messages that come in batches, and counts those that were lost on the way."""

    lost = 0
    _number = 0

    def _take_link(self, data: bytes) -> None:
        for _, number, message in messages_of(data):
            if self._number and number > self._number + 1:
                self.lost += number - self._number - 1
            self._number = number
            super()._take_link(message)

    def look(self) -> None:
        """Connect if there is a sender, whose numbers begin anew."""
        if not self.linked:
            self._number = 0
        super().look()
