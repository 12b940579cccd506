"""Several nodes in one process: one thread for all their cycles, one for what they publish, one process for topics."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any

from phil_node.cycle_thread import IDLE, CycleThread, CycleTimer
from phil_node.exchange import Exchange
from phil_node.outbox import Outbox
from phil_node.topics import TopicsProcess

FULL = 64
"""Messages that wait to be published at which the thread of the cycles hands them on itself: more than wait in real
time, where the outbox has a thread that does so every few milliseconds."""


class Composition:
    """What the nodes of one process share."""

    def __init__(self, process: TopicsProcess, role: str = "rig") -> None:
        """Take the process for the topics of all, and the role of the thread of all cycles (``scheduling.ROLES``)."""
        self.process = process
        self.outbox = Outbox()
        self.outbox.process = process
        self.members: list[Member] = []
        self.thread = _Chain(self, role)
        self.exchange = Exchange(self.thread.wake)
        self._starting = threading.Lock()
        self._running = 0

    def member(self, lock: Any, failed: Callable[[BaseException], None], look: Callable[[], None]) -> Member:
        """Take in a node: the lock of its state, who is told what went wrong, and what looks for its peers."""
        self.members = [*self.members, made := Member(self, lock, failed, look)]
        return made

    def begin(self) -> None:
        """Start the thread with the first node that begins."""
        with self._starting:
            self._running += 1
            if self._running == 1:
                self.thread.start()

    def end(self) -> None:
        """Stop the thread with the last node that ends."""
        with self._starting:
            self._running -= 1
            if not self._running:
                self.thread.stop()
                self.exchange.clear()


class Member:
    """A node's part in the thread of a composition; it has the place of the `CycleThread` of a node alone."""

    def __init__(
        self,
        composition: Composition,
        lock: Any,
        failed: Callable[[BaseException], None],
        look: Callable[[], None],
    ) -> None:
        self._composition = composition
        self._thread = composition.thread
        self.lock, self.failed, self._look = lock, failed, look
        self.running = False

    @property
    def exchange(self) -> Exchange:
        """Give what hands messages over."""
        return self._composition.exchange

    def watch(self, file: int, callback: Callable[[], None]) -> None:
        """Call back when a file can be read; the node's lock is not held."""
        self._thread.watch(file, callback)

    def forget(self, file: int) -> None:
        """Watch a file no longer."""
        self._thread.forget(file)

    def timer(self, period: float, callback: Callable[[], None]) -> CycleTimer:
        """Make a timer that stands still until it is reset."""
        return self._thread.timer(period, lambda: self._call(callback))

    def drop(self, timer: CycleTimer) -> None:
        """Take a timer away."""
        self._thread.drop(timer)

    def start(self) -> None:
        """Let this node take messages and be called by its timers."""
        with self.lock:
            self.running = True
        self._composition.begin()

    def stop(self) -> None:
        """Let it be called no more, after the callback that may be running; not with its lock held."""
        with self.lock:
            was, self.running = self.running, False
        if was:
            self._composition.end()

    def look(self) -> None:
        """Look for peers; in the thread."""
        self._call(self._look)

    def _call(self, callback: Callable[[], None]) -> None:
        with self.lock:
            if self.running:
                try:
                    callback()
                except BaseException as error:
                    self.failed(error)
                    raise


class _Chain(CycleThread):
    """The thread in which the cycles of all nodes run: each message that one sends is taken by the next at once."""

    def __init__(self, composition: Composition, role: str) -> None:
        super().__init__(threading.RLock(), lambda error: None, self._look_for_all, role)
        self._composition = composition

    def _look_for_all(self) -> None:
        for member in self._composition.members:
            member.look()

    def _turn(self) -> None:
        """Look for peers, then hand over, wait and call back until it is time to look again."""
        self._look_for_all()
        end = monotonic() + IDLE
        exchange, outbox, wakes = self._composition.exchange, self._composition.outbox, self._pipe[0]
        while self._running:
            more = exchange.deliver()
            if outbox.waiting >= FULL:
                outbox.flush()
                outbox.relieved = True
            now = monotonic()
            if now >= end:
                return
            due = now if more else min((timer.due for timer in self._timers), default=end)
            ready, _, _ = select.select([wakes, *self._readers], [], [], max(0.0, min(due, end) - now))
            if wakes in ready:
                with suppress(BlockingIOError):
                    os.read(wakes, 4096)
                ready.remove(wakes)
            self._call(ready)
