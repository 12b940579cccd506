"""Messages from node to node of one process: handed over in the order in which they were sent, by one thread.

It stands in the place of the sockets of `phil_node.link` when several nodes share a process. What is sent is written
once, as for everybody; the receivers here are given one reading of these bytes, which they share. Its arrays are views
of bytes that never change, so nobody sees what a sender writes next, and nobody can change what another one reads.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from phil_node.box import Box
from phil_node.once import REMEMBERED
from phil_node.paths import CycleReceiver, Follower, Receiver

PORTION = 48
"""Messages that are handed over at a stretch before the thread looks at clock and sockets: 16 cycles of the loop."""


class Exchange:
    """Hands messages over, in the thread that calls `deliver`; nodes of the loop first, then those who follow."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """Take what wakes that thread up."""
        self.wake = wake
        self._boxes: dict[str, Box] = {}
        self.waiting: deque[tuple[Box, bytes]] = deque()
        """What was sent and has not had its turn."""
        self._followed: deque[tuple[tuple[Receiver, ...], Any, bytes]] = deque()
        self.busy = False
        """Whether the thread is at it, and need not be woken."""
        self._entering = threading.Lock()

    def open(self, name: str, kind: Any, kept: int) -> Box:
        """Open a topic (full name) to be spoken on; a second one of that name takes its place."""
        self._boxes[name] = box = Box(self, kind, kept)
        return box

    def close(self, name: str, box: Box) -> None:
        """Close a topic."""
        if self._boxes.get(name) is box:
            del self._boxes[name]
        box.close()

    def box(self, name: str) -> Box | None:
        """Give the topic of that name, if a node of this process speaks on it."""
        return self._boxes.get(name)

    def join(self, box: Box, receiver: Receiver, follows: bool) -> list[bytes]:
        """Let a receiver take what is sent from now on; give what was kept for it."""
        with self._entering:
            if not follows:
                box.peers = (*box.peers, receiver)
                return []
            box.followers = (*box.followers, receiver)
            return list(box.kept or ())

    def leave(self, box: Box, receiver: Receiver) -> None:
        """Let a receiver take no more."""
        with self._entering:
            box.peers = tuple(other for other in box.peers if other is not receiver)
            box.followers = tuple(other for other in box.followers if other is not receiver)

    def deliver(self) -> bool:
        """Hand over what waits, a portion at most; tell whether more waits."""
        waiting, followed = self.waiting, self._followed
        self.busy = True
        left = PORTION
        while waiting and left:
            left -= 1
            box, data = waiting.popleft()
            message = box.reader.read(data)
            box.digests[box.count % REMEMBERED] = hash(data)
            box.count += 1
            if box.kept is not None:
                with self._entering:  # who joins now has it either way, not both ways
                    box.kept.append(data)
                    followers = box.followers
            else:
                followers = box.followers
            for receiver in box.peers:
                receiver.take(message, data)  # type: ignore[attr-defined]
            if followers:
                followed.append((followers, message, data))
        while followed:
            followers, message, data = followed.popleft()
            for receiver in followers:
                receiver.take(message, data)  # type: ignore[attr-defined]
        # First this, then the look: what is sent in between is seen by one of the two.
        self.busy = bool(waiting)
        return self.busy or bool(waiting)

    def clear(self) -> None:
        """Drop what waits."""
        self.waiting.clear()
        self._followed.clear()


class _Handed:
    """Makes a receiver of one that takes messages by a socket: it is handed them over by an `Exchange`."""

    follows = False

    def __init__(
        self,
        kind: Any,
        name: str,
        member: Any,
        callback: Callable[[Any], None],
        linked: Callable[[bool], None],
    ) -> None:
        """Take messages of a topic (full name) for a `composition.Member`; say it when they come and when not."""
        super().__init__(kind, None, member, callback, linked)  # type: ignore[call-arg]
        self._name, self._member = name, member
        self._box: Box | None = None
        self._late: list[bytes] = []
        self._begun = 0
        self._heard = False
        """Whether anything came by the topic; as long as nothing does, nothing can come twice."""

    @property
    def linked(self) -> bool:
        """Tell whether the sender is in this process."""
        return self._box is not None

    def look(self) -> None:
        """Join if the sender is there."""
        exchange = self._member.exchange
        if self._box is None and (box := exchange.box(self._name)) is not None:
            self._box, self._begun = box, box.count
            self._late = exchange.join(box, self, self.follows)
            self._tell(True)  # type: ignore[attr-defined]

    def gone(self) -> None:
        """Take note that the sender is gone."""
        if self._box is not None:
            self._box = None
            self._tell(False)  # type: ignore[attr-defined]

    def close(self) -> None:
        """Leave, and forget what came."""
        with self._member.lock:
            self._once.clear()  # type: ignore[attr-defined]
            self._heard = False
            if self._box is not None:
                self._member.exchange.leave(self._box, self)
                self.gone()

    def drain(self) -> None:
        """Take what was kept."""
        late, self._late = self._late, []
        with self._member.lock:
            for data in late:
                self._take_link(data)  # type: ignore[attr-defined]

    def from_topic(self, data: bytes) -> None:
        """Take a message in CDR that came by DDS; with the node's lock held."""
        if not self._heard:
            self._heard = True
            if (box := self._box) is not None:
                for number in range(max(self._begun, box.count - REMEMBERED), box.count):
                    self._once.remember(box.digests[number % REMEMBERED])  # type: ignore[attr-defined]
        super().from_topic(data)  # type: ignore[misc]

    def take(self, message: Any, data: bytes) -> None:
        """Take a message that was handed over, as it reads and as it was written."""
        member = self._member
        with member.lock:
            if member.running and (not self._heard or self._once.from_link(data)):  # type: ignore[attr-defined]
                try:
                    self._callback(message)  # type: ignore[attr-defined]
                except BaseException as error:
                    member.failed(error)
                    raise


class HandedCycles(_Handed, CycleReceiver):
    """Takes messages that peers of the loop in this process send one by one."""


class HandedFollower(_Handed, Follower):
    """Takes messages of a sender in this process behind those of the loop."""

    follows = True

    def _take_link(self, data: bytes) -> None:
        Receiver._take_link(self, data)
