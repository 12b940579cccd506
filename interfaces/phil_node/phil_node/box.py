"""A topic within a process: who of its nodes takes what is sent there."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from phil_node.cdr import Reader
from phil_node.once import REMEMBERED


class Turns(Protocol):
    """What a topic asks of the `exchange.Exchange` to which it belongs."""

    waiting: deque[tuple[Any, bytes]]
    busy: bool
    wake: Callable[[], None]


class Box:
    """A topic on which a node of this process speaks: who of its loop waits for it, and who follows it."""

    def __init__(self, exchange: Turns, kind: Any, kept: int) -> None:
        """Take messages of a kind, of which the last ``kept`` are for who comes late."""
        self._exchange = exchange
        self.reader = Reader(kind)
        self.wanted = 0
        """Nodes of the loop that wait for what is sent."""
        self.peers: tuple[Any, ...] = ()
        self.followers: tuple[Any, ...] = ()
        self.kept: deque[bytes] | None = deque(maxlen=kept) if kept else None
        self.count = 0
        self.digests = array("q", bytes(8 * REMEMBERED))
        """Of the messages handed over last, for receivers that hear by DDS as well."""

    alone = False
    """There is no socket at which somebody could ask to be let in."""
    dropped = 0
    """What is sent here waits until it is taken."""

    def send(self, data: bytes) -> None:
        """Hand a message (CDR) over, soon and in turn; never here and now, so that a sender is never called back."""
        if self.peers or self.followers or self.kept is not None:
            exchange = self._exchange
            exchange.waiting.append((self, data))
            if not exchange.busy:
                exchange.wake()

    def close(self) -> None:
        """Leave all; what waits is handed over to nobody."""
        for receiver in (*self.peers, *self.followers):
            receiver.gone()
        self.peers = self.followers = ()
