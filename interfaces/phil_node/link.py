"""The short way of the cycle's messages: from node to node of one machine by a Unix socket, beside their topic.

A message of the cycle is sent to the peers that are linked before it is published, as the same bytes. So the loop
needs neither discovery nor the locks, threads and queues of DDS, and viewers of its topics cost it nothing. The kernel
wakes the receiver, tells of a dead peer at once, and leaves nothing behind when a process is killed. Whoever is not
linked (another machine, another program, a relay in between) speaks and listens on the topics alone, as ever.
"""

from __future__ import annotations

import os
import socket
import struct
from contextlib import suppress
from hashlib import blake2b

PREFIX = "phil-catenary"
"""Beginning of the names of the sockets (abstract: they are in no folder, and go with their process)."""
LONGEST = 65536
"""Bytes of a message."""
QUEUE = 1 << 20
"""Bytes that wait for a peer that is held up; what is beyond it comes by the topic alone."""
CREDENTIALS = struct.Struct("3i")


def address(domain: int, topic: str) -> str:
    """Give the name of the socket of a topic (full name) on a ROS domain, for this user."""
    name = f"\0{PREFIX}/{os.getuid()}/{domain}{topic}"
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


class Outlet:
    """The sending end of a topic: lets peers in and sends to each; only one process can have it."""

    def __init__(self, name: str, wanted: int = 1) -> None:
        """Take the name of a topic (`address`), on which ``wanted`` nodes of the loop listen."""
        self.held = _socket()
        self.wanted = wanted
        self.dropped = 0
        self.peers: list[socket.socket] = []
        try:
            self.held.bind(name)
            self.held.listen(16)
            self.alone = True
        except OSError:
            # Somebody else sends on this topic: this one does so by DDS, as a stranger does.
            self.alone = False

    def accept(self) -> None:
        """Let in who waits."""
        with suppress(BlockingIOError, OSError):
            while True:
                peer, _ = self.held.accept()
                if not trusted(peer):
                    peer.close()
                    continue
                peer.setblocking(False)
                peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE)
                self.peers.append(peer)

    def send(self, data: bytes) -> None:
        """Send to each peer, or drop it for one whose queue is full; forget who is gone."""
        for peer in self.peers:
            try:
                peer.send(data)
            except BlockingIOError:
                self.dropped += 1
            except OSError:
                peer.close()
        if any(peer.fileno() < 0 for peer in self.peers):
            self.peers = [peer for peer in self.peers if peer.fileno() >= 0]

    def close(self) -> None:
        """Leave the peers alone; they see it at once."""
        for peer in (*self.peers, self.held):
            peer.close()
        self.peers = []


class Inlet:
    """The receiving end of a topic; connects whenever there is a sender, and again after it is gone."""

    def __init__(self, name: str) -> None:
        self._name = name
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
            data = self.socket.recv(LONGEST)
        except BlockingIOError:
            return None
        except OSError:
            data = b""
        if not data:
            self.close()
        return data

    def close(self) -> None:
        """Disconnect."""
        if self.socket is not None:
            self.socket.close()
            self.socket = None
