"""The short way of messages: from node to node of one machine by a Unix socket, beside their topic.

A message of the cycle is sent to the peers that are linked before it is published, as the same bytes; monitor and
recorder get what is published in batches. So the loop needs neither discovery nor the locks, threads and queues of DDS,
and viewers of its topics cost it nothing. The kernel wakes the receiver, tells of a dead peer at once, and leaves
nothing behind when a process is killed. Whoever is not linked (another machine, another program, a relay in between)
speaks and listens on the topics alone, as ever.
"""

from __future__ import annotations

import os
import socket
import struct
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from hashlib import blake2b

PREFIX = "phil-catenary"
"""Beginning of the names of the sockets (abstract: they are in no folder, and go with their process)."""
LONGEST = 1 << 20
"""Bytes of a message or of a batch of them that a receiver takes at once."""
QUEUE = 1 << 20
"""Bytes that the kernel is asked to keep for a peer that is held up."""
WAITING = 5000
"""Messages, or batches of them, that wait for a peer beyond that: as many as a topic keeps for a slow listener."""
CREDENTIALS = struct.Struct("3i")


def address(domain: int, topic: str, followed: bool = False) -> str:
    """Give the name of the socket of a topic (full name) on a ROS domain, for this user.

    A topic of the loop has one for its peers; each topic has another for those who follow it in batches (``followed``).
    """
    name = f"\0{PREFIX}/{os.getuid()}/{domain}{topic}{'+' if followed else ''}"
    if len(name) > 100:  # the kernel takes 107 bytes
        name = f"\0{PREFIX}/{blake2b(name.encode(), digest_size=16).hexdigest()}"
    return name


def trusted(peer: socket.socket) -> bool:
    """Tell whether the other end is a process of this user or of root; a name in the kernel has no permissions."""
    content = peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
    return CREDENTIALS.unpack(content)[1] in (os.getuid(), 0)


def _socket() -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET | socket.SOCK_CLOEXEC)
    made.setblocking(False)
    return made


class Peer:
    """One who is sent to: what the kernel has no room for waits in order, the oldest is dropped at last."""

    def __init__(self, connection: socket.socket) -> None:
        """Take a connection that does not block."""
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE)
        self._socket = connection
        self.waiting: deque[bytes] = deque()
        self.dropped = 0
        self.gone = False

    def send(self, data: bytes) -> None:
        """Send, or let it wait behind what waits."""
        if not self.waiting:
            try:
                self._socket.send(data)
                return
            except BlockingIOError:
                pass
            except OSError:
                self.close()
                return
        if len(self.waiting) >= WAITING:
            self.waiting.popleft()
            self.dropped += 1
        self.waiting.append(data)
        self.go_on()

    def go_on(self) -> None:
        """Send what waits, as far as there is room."""
        waiting = self.waiting
        try:
            while waiting:
                self._socket.send(waiting[0])
                waiting.popleft()
        except BlockingIOError:
            pass
        except OSError:
            self.close()

    def close(self) -> None:
        """Leave it alone."""
        self.gone = True
        self.waiting.clear()
        self._socket.close()


class Outlet:
    """The sending end of a topic: lets peers in and sends to each; only one process can have it."""

    def __init__(self, name: str, wanted: int = 1) -> None:
        """Take the name of a topic (`address`), on which ``wanted`` nodes of the loop listen."""
        self.held = _socket()
        self.wanted = wanted
        self.peers: list[Peer] = []
        self._lost = 0
        try:
            self.held.bind(name)
            self.held.listen(16)
            self.alone = True
        except OSError:
            # Somebody else sends on this topic: this one does so by DDS, as a stranger does.
            self.alone = False

    @property
    def dropped(self) -> int:
        """Give the number of messages or batches for which no room was left."""
        return self._lost + sum(peer.dropped for peer in self.peers)

    def accept(self) -> None:
        """Let in who waits."""
        self.peers = [*self.peers, *self.callers()]

    def callers(self) -> list[Peer]:
        """Give who waits to be let in."""
        come: list[Peer] = []
        with suppress(BlockingIOError, OSError):
            while True:
                connection, _ = self.held.accept()
                if not trusted(connection):
                    connection.close()
                    continue
                connection.setblocking(False)
                come.append(Peer(connection))
        return come

    def send(self, data: bytes) -> None:
        """Send to each peer; forget who is gone."""
        gone = False
        for peer in self.peers:
            peer.send(data)
            gone |= peer.gone
        if gone:
            self._forget()

    def go_on(self) -> None:
        """Send what waits for peers that were held up."""
        gone = False
        for peer in self.peers:
            if peer.waiting:
                peer.go_on()
            gone |= peer.gone
        if gone:
            self._forget()

    def _forget(self) -> None:
        self._lost += sum(peer.dropped for peer in self.peers if peer.gone)
        self.peers = [peer for peer in self.peers if not peer.gone]

    def close(self) -> None:
        """Leave the peers alone; they see it at once."""
        for peer in self.peers:
            peer.close()
        self.held.close()
        self.peers = []


class Inlet:
    """The receiving end of a topic; connects whenever there is a sender, and again after it is gone."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._room = memoryview(bytearray(LONGEST))
        self.socket: socket.socket | None = None

    def connect(self) -> bool:
        """Connect unless that is done; tell whether it is new."""
        if self.socket is not None:
            return False
        made = _socket()
        try:
            made.connect(self._name)
            if trusted(made):
                self.socket = made
                return True
        except OSError:
            pass
        made.close()
        return False

    def receive(self) -> bytes | None:
        """Give the next message, None if there is none; empty when the sender is gone."""
        if self.socket is None:
            return None
        try:
            size = self.socket.recv_into(self._room)
        except BlockingIOError:
            return None
        except OSError:
            size = 0
        if not size:
            self.close()
        return bytes(self._room[:size])

    def close(self) -> None:
        """Disconnect."""
        if self.socket is not None:
            self.socket.close()
            self.socket = None


RECORD = struct.Struct("<HHII")
"""Before each message of a batch: number of its topic, 0, its number among the topic's messages, its size in bytes."""
BATCH = 60_000
"""Bytes of a batch; a longer message goes alone."""

Message = tuple[int, int, bytes]
"""Number of the topic, number of the message, message in CDR."""


def batches(messages: Iterable[Message]) -> list[bytes]:
    """Put messages together, in their order, into batches that a socket takes."""
    parts: list[bytes] = []
    for topic, number, data in messages:
        parts += (RECORD.pack(topic, 0, number & 0xFFFFFFFF, len(data)), data)
    return joined(parts)


def joined(parts: list[bytes]) -> list[bytes]:
    """Put messages together, each as its record (`RECORD`) and its bytes in turn, into batches as `batches` does."""
    made: list[bytes] = []
    begin = size = 0
    for at in range(1, len(parts), 2):
        length = len(parts[at]) + RECORD.size
        if size and size + length > BATCH:
            made.append(b"".join(parts[begin : at - 1]))
            begin, size = at - 1, 0
        size += length
    if parts:
        made.append(b"".join(parts[begin:]))
    return made


def messages_of(batch: bytes) -> list[Message]:
    """Take a batch apart.

    Raises
    ------
    ValueError
        It is none: a message is cut off.
    """
    found: list[Message] = []
    at, end = 0, len(batch)
    while at < end:
        if at + RECORD.size > end:
            raise ValueError("a batch of messages is cut off")
        topic, _, number, size = RECORD.unpack_from(batch, at)
        at += RECORD.size
        if at + size > end:
            raise ValueError("a batch of messages is cut off")
        found.append((topic, number, batch[at : at + size]))
        at += size
    return found
