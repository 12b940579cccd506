"""Following topics by the links of their senders: what nodes on this machine publish comes without DDS."""

from __future__ import annotations

import select
import threading
from collections.abc import Callable
from time import monotonic, sleep

from phil_node.link import Inlet, address, messages_of
from phil_node.once import Once

LOOK = 0.05
"""Time in s from one look for senders that have come to the next."""
PAUSE = 0.004
"""Time in s that is left for more to come: one look for several messages costs a fraction."""


class Ways:
    """Takes each message of a topic once, if it comes by the link and by DDS as well."""

    def __init__(self, take: Callable[[bytes], None]) -> None:
        self._take, self._once, self._lock = take, Once(), threading.Lock()

    def by_link(self, data: bytes) -> None:
        """Take a message that came by the link."""
        with self._lock:
            if self._once.from_link(data):
                self._take(data)

    def by_topic(self, data: bytes) -> None:
        """Take a message that came by DDS."""
        with self._lock:
            if self._once.from_topic(data):
                self._take(data)


class Followed:
    """A topic that is followed whenever its sender is on this machine."""

    def __init__(self, domain: int, name: str, take: Callable[[bytes], None], lost: Callable[[int], None]) -> None:
        self.inlet = Inlet(address(domain, name, followed=True))
        self.ways = Ways(take)
        self._lost = lost
        self._number = 0

    @property
    def linked(self) -> bool:
        """Tell whether the sender is linked."""
        return self.inlet.socket is not None

    def connect(self) -> bool:
        """Link the sender if there is one; tell whether it is new. Its numbers begin anew."""
        new = self.inlet.connect()
        if new:
            self._number = 0
        return new

    def drain(self) -> None:
        """Take all that is there."""
        while data := self.inlet.receive():
            for _, number, message in messages_of(data):
                if self._number and number > self._number + 1:
                    self._lost(number - self._number - 1)
                self._number = number
                self.ways.by_link(message)


class Links:
    """A thread that takes what comes by links."""

    def __init__(self) -> None:
        self._followed: list[Followed] = []
        self.error: Exception | None = None
        """Why nothing is taken any more."""
        self._running = True
        self._thread = threading.Thread(target=self._run, name="links", daemon=True)
        self._thread.start()

    def follow(self, followed: Followed) -> bool:
        """Follow a topic from now on; tell whether its sender is linked."""
        followed.connect()
        self._followed = [*self._followed, followed]
        return followed.linked

    def close(self) -> None:
        """End, and leave all senders."""
        self._running = False
        self._thread.join()
        for each in self._followed:
            each.inlet.close()

    def _run(self) -> None:
        try:
            self._work()
        except Exception as error:  # it would be lost with the thread, and the recording have a gap that nobody knows
            self.error = error

    def _work(self) -> None:
        looked = 0.0
        while self._running:
            if (now := monotonic()) - looked >= LOOK:
                looked = now
                for each in self._followed:
                    each.connect()
            open_ = {each.inlet.socket.fileno(): each for each in self._followed if each.inlet.socket is not None}
            if not open_:
                sleep(LOOK)
                continue
            ready, _, _ = select.select(list(open_), [], [], LOOK)
            for file in ready:
                open_[file].drain()
            sleep(PAUSE)
