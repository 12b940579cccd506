"""The two ways of a node's messages: the topic, for everybody, and the link, for the loop's peers on this machine."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from rclpy.serialization import serialize_message

from phil_node.cdr import Reader, Writer
from phil_node.cycle_thread import CycleThread
from phil_node.link import Inlet, Outlet
from phil_node.outbox import Outbox

REMEMBERED = 5000
"""Messages back for which it is known that they came already by the other way."""


class Sender:
    """Publishes on a topic through the outbox; messages are rclpy's or a `Writer`."""

    def __init__(self, publisher: Any, outbox: Outbox) -> None:
        self._publisher, self._outbox = publisher, outbox
        self._handle = publisher.handle
        self.topic_name = str(publisher.topic_name)

    def get_subscription_count(self) -> int:
        """Give the number of subscriptions that are matched."""
        return int(self._publisher.get_subscription_count())

    def publish(self, message: Any) -> None:
        """Publish unless the node is inactive."""
        if self._publisher.is_activated:
            data = message.bytes() if isinstance(message, Writer) else serialize_message(message)
            self._outbox.post(self._handle, data)


class CycleSender(Sender):
    """Sends to the linked peers first, and publishes; at once while one of the loop's peers is not linked."""

    def __init__(self, publisher: Any, outbox: Outbox, outlet: Outlet) -> None:
        """Publish as ``publisher`` does, and send through ``outlet``."""
        super().__init__(publisher, outbox)
        self.outlet = outlet

    def publish(self, message: Any) -> None:
        """Send and publish unless the node is inactive."""
        if not self._publisher.is_activated:
            return
        data = message.bytes() if isinstance(message, Writer) else serialize_message(message)
        outlet = self.outlet
        outlet.send(data)
        self._outbox.post(self._handle, data)
        if len(outlet.peers) < outlet.wanted:
            # A peer listens to the topic alone: it waits for this.
            self._outbox.flush()


class CycleReceiver:
    """Takes each message once, whichever way it comes: by the link in the cycle's thread, or by the topic.

    A message that came both ways, the same to the last byte, is taken from the first. One that came twice by one way is
    taken twice: a sender that sends again has a reason, and a stranger on the topic is heard and judged like the peer.
    """

    def __init__(self, kind: Any, inlet: Inlet, thread: CycleThread, callback: Callable[[Any], None]) -> None:
        """Give messages of a kind to ``callback``."""
        self._reader, self._inlet, self._thread, self._callback = Reader(kind), inlet, thread, callback
        self._by_link: OrderedDict[int, None] = OrderedDict()
        self._by_topic: OrderedDict[int, None] = OrderedDict()
        self.unreadable = 0

    @property
    def linked(self) -> bool:
        """Tell whether the sender is linked."""
        return self._inlet.socket is not None

    def look(self) -> None:
        """Connect if there is a sender; in the cycle's thread."""
        if self._inlet.connect():
            assert self._inlet.socket is not None
            file = self._inlet.socket.fileno()
            self._thread.watch(file, lambda: self._drain(file))

    def close(self) -> None:
        """Disconnect, and forget what came."""
        self._by_link.clear()
        self._by_topic.clear()
        if self._inlet.socket is not None:
            self._thread.forget(self._inlet.socket.fileno())
            self._inlet.close()

    def _drain(self, file: int) -> None:
        while (data := self._inlet.receive()) is not None:
            if not data:
                self._thread.forget(file)
                return
            self._take(data, self._by_link, self._by_topic)

    def from_topic(self, data: bytes) -> None:
        """Take a message in CDR that came by DDS; with the node's lock held."""
        self._take(data, self._by_topic, self._by_link)

    def _take(self, data: bytes, mine: OrderedDict[int, None], other: OrderedDict[int, None]) -> None:
        digest = hash(data)
        if digest in other:
            del other[digest]
            return
        mine[digest] = None
        if len(mine) > REMEMBERED:
            mine.popitem(last=False)
        try:
            message = self._reader.read(data)
        except Exception:
            self.unreadable += 1
            return
        self._callback(message)
