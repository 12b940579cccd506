"""Publishing beside the cycle: what a node sends goes to a thread, and from it to DDS and to those who follow."""

from __future__ import annotations

import threading
from collections import deque
from time import monotonic, sleep
from typing import Any

from rclpy.exceptions import InvalidHandle

from phil_base.real_time import set_thread
from phil_node.box import Box
from phil_node.link import RECORD, Message, Outlet, Peer, batches, joined
from phil_node.publish import publish_bytes
from phil_node.topics import TopicsProcess

PORTION = 100
"""Kept messages that a new follower is given at once."""
EVERY = 0.008
"""Time in s from one batch to the next: what nobody in the loop waits for costs a fraction if it goes in batches."""

SELDOM = 0.04
"""The same while another thread sees to it."""


class Topic:
    """A topic that a node speaks on: its publisher, in this process or in the one for topics, and who follows it."""

    def __init__(self, name: str, publisher: Any, outlet: Outlet | None, kept: int) -> None:
        """Take the full name, rclpy's publisher or its number in the other process, and how many samples are kept."""
        self.name, self.publisher, self.outlet = name, publisher, outlet
        self.open = True
        self.box: Box | None = None
        """By which it is handed over to other nodes of this process, if there are any."""
        self.number = 0
        self._kept: deque[Message] | None = deque(maxlen=kept) if kept else None

        self._index = publisher if isinstance(publisher, int) else 0

    def enter(self, data: bytes) -> bytes:
        """Number a message, and keep it for who comes late if this topic does so; give its record."""
        number = self.number = self.number + 1
        if self._kept is not None:
            self._kept.append((self._index, number, data))
        return RECORD.pack(self._index, 0, number & 0xFFFFFFFF, len(data))

    def kept(self, after: int) -> list[Message]:
        """Give the messages that were kept, behind the one with this number."""
        return [message for message in self._kept or () if message[1] > after]

    @property
    def followers(self) -> int:
        """Give the number of those who follow by sockets."""
        return len(self.outlet.peers) if self.outlet is not None else 0


class Outbox:
    """Publishes in a thread of its own, in the order of `post`, a few milliseconds later or at once.

    With a process for topics it goes there, and from there by DDS; without one it is published here. Who follows a
    topic is sent the same in batches.
    """

    def __init__(self, role: str = "publish") -> None:
        """Take the role of the thread (``scheduling.ROLES``)."""
        self._role = role
        self.failed = 0
        self.relieved = False
        """Whether another thread has published what waited, so that this one may leave it the interpreter's lock."""
        self.process: TopicsProcess | None = None
        self.topics: list[Topic] = []
        self._waiting: deque[tuple[Topic, bytes]] = deque()
        self._turn = threading.Lock()
        self._thread: threading.Thread | None = None
        self._running = False
        self._users = 0

    def start(self) -> None:
        """Begin, with the first of the nodes that publish by it."""
        self._users += 1
        if self._users == 1:
            self._running = True
            self._thread = threading.Thread(target=self._run, name="publish", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """Publish all that was posted, and end with the last of the nodes."""
        self._users = max(0, self._users - 1)
        self._running = self._users > 0
        if self._thread is not None and not self._running:
            self._thread.join()
            self._thread = None
        self.flush()

    @property
    def waiting(self) -> int:
        """Give the number of messages that wait to be published."""
        return len(self._waiting)

    def post(self, topic: Topic, data: bytes) -> None:
        """Have a message (CDR) published."""
        self._waiting.append((topic, data))

    def say(self, topic: Topic, data: bytes) -> None:
        """Publish a message that belongs to no cycle, now unless the thread does so soon."""
        self.post(topic, data)
        if not self._running:
            self.flush()

    def flush(self) -> None:
        """Publish all that waits, now and here."""
        with self._turn:
            # Each message is its record and its bytes, the same for the process for topics and for those who follow.
            posted: list[bytes] = []
            followed: dict[Topic, list[bytes]] = {}
            waiting, process = self._waiting, self.process
            while waiting:
                topic, data = waiting.popleft()
                message = topic.enter(data), data
                if process is None:
                    self._publish(topic.publisher, data)
                else:
                    posted += message
                if topic.outlet is not None and topic.outlet.peers:
                    parts = followed.get(topic)
                    if parts is None:
                        followed[topic] = parts = []
                    parts += message
            if process is not None:
                process.publish(posted)
                process.go_on()
            for topic, parts in followed.items():
                for batch in joined(parts):
                    topic.outlet.send(batch)  # type: ignore[union-attr]  # it has followers
            for topic in self.topics:
                if topic.followers and topic not in followed:
                    topic.outlet.go_on()  # type: ignore[union-attr]

    def look_for_followers(self) -> None:
        """Let in who wants to follow; in the thread, because what was kept for them may be much."""
        for topic in tuple(self.topics):
            if topic.outlet is not None and topic.outlet.alone:
                for peer in topic.outlet.callers():
                    self._hand_on(topic, topic.outlet, peer)

    def _hand_on(self, topic: Topic, outlet: Outlet, peer: Peer) -> None:
        """Give who begins to follow what was kept, in portions, beside what is published meanwhile."""
        sent = 0
        while True:
            with self._turn:
                left = topic.kept(sent)
                if len(left) <= PORTION:
                    for batch in batches(left):
                        peer.send(batch)
                    outlet.peers = [*outlet.peers, peer]
                    return
            for batch in batches(left[:PORTION]):
                peer.send(batch)
            sent = left[PORTION - 1][1]

    def hand_over(self, seconds: float, owner: int = 0) -> None:
        """Wait until those who follow, and who listens to a node of the process for topics, have all of it."""
        end = monotonic() + seconds
        while monotonic() < end and self._behind():
            sleep(EVERY)
            self.flush()
        if self.process is not None:
            self.process.acknowledged(max(0.0, end - monotonic()), owner)

    def _behind(self) -> bool:
        process = self.process is not None and self.process.behind
        return process or any(peer.waiting for topic in self.topics if topic.outlet for peer in topic.outlet.peers)

    def _publish(self, handle: Any, data: bytes) -> None:
        try:
            with handle:  # it cannot be destroyed meanwhile
                self.failed += not publish_bytes(handle.pointer, data)
        except InvalidHandle:
            self.failed += 1

    def _run(self) -> None:
        set_thread(self._role)
        while self._running:
            sleep(SELDOM if self.relieved else EVERY)
            self.relieved = False
            self.look_for_followers()
            self.flush()
