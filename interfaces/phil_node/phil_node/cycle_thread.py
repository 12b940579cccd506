"""The thread in which a node's cycle runs: it waits for linked peers and for the clock, and for nothing else."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any

from phil_base.real_time import set_thread

IDLE = 0.25
"""Time in s from one look for peers that have come to the next."""


class CycleTimer:
    """Calls back each ``period`` s in the cycle's thread, from `reset` until `cancel`."""

    def __init__(self, thread: CycleThread, period: float, callback: Callable[[], None]) -> None:
        self._thread, self._period, self.callback = thread, period, callback
        self._next = float("inf")
        self.due = float("inf")
        """When it calls next, monotonic clock in s."""

    def reset(self) -> None:
        """Start: the first call is one period from now."""
        self.due = self._next = monotonic() + self._period
        self._thread.wake()

    def cancel(self) -> None:
        """Stop."""
        self.due = self._next = float("inf")

    def also(self, when: float) -> None:
        """Call at that time (monotonic clock, s), too, if it is before the next call; from a callback of the thread."""
        if when < self._next < float("inf"):
            self.due = when

    def once(self, when: float) -> None:
        """Call at that time (monotonic clock in s), and then stand still."""
        self.due, self._next = when, float("inf")
        self._thread.wake()

    def advance(self, now: float) -> None:
        """Set the next call, on the grid of the first one; those that were missed are left out."""
        if now >= self._next:
            self._next += self._period * (1 + (now - self._next) // self._period)
        self.due = self._next


class CycleThread:
    """Waits for files to become readable and for timers, and calls back with the node's lock held.

    Args:
        lock: of the node's state; who touches that in another thread holds it, too.
        failed: is told of an exception of a callback, which ends the thread.
        look: is called first and then four times a second, for peers that come.
        role: of the thread (``scheduling.ROLES``).
    """

    def __init__(
        self,
        lock: threading.RLock,  # type: ignore[valid-type]  # a function before Python 3.13
        failed: Callable[[BaseException], None],
        look: Callable[[], None],
        role: str = "controller",
    ) -> None:
        self._lock: Any = lock
        self._failed, self._look, self._role = failed, look, role
        self._readers: dict[int, Callable[[], None]] = {}
        self._timers: list[CycleTimer] = []
        self._thread: threading.Thread | None = None
        self._running = False
        self._pipe = (-1, -1)

    def watch(self, file: int, callback: Callable[[], None]) -> None:
        """Call back when a file can be read."""
        self._readers = {**self._readers, file: callback}

    def forget(self, file: int) -> None:
        """Watch a file no longer; call it before the file is closed."""
        self._readers = {other: callback for other, callback in self._readers.items() if other != file}

    def timer(self, period: float, callback: Callable[[], None]) -> CycleTimer:
        """Make a timer that stands still until it is reset."""
        made = CycleTimer(self, period, callback)
        self._timers = [*self._timers, made]
        return made

    def drop(self, timer: CycleTimer) -> None:
        """Take a timer away."""
        self._timers = [other for other in self._timers if other is not timer]

    def wake(self) -> None:
        """Let the thread look at its timers anew."""
        if self._running and threading.current_thread() is not self._thread:
            with suppress(OSError):
                os.write(self._pipe[1], b"x")

    def start(self) -> None:
        """Begin."""
        self._pipe = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        self._running = True
        self._thread = threading.Thread(target=self._run, name="cycle", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End, after the callback that may be running; not to be called with the lock held."""
        if self._thread is None:
            return
        self.wake()
        self._running = False
        with suppress(OSError):
            os.write(self._pipe[1], b"x")
        self._thread.join()
        self._thread = None
        for end in self._pipe:
            os.close(end)

    def _run(self) -> None:
        try:
            set_thread(self._role)
            while self._running:
                self._turn()
        except BaseException as error:
            self._running = False
            self._failed(error)

    def _turn(self) -> None:
        """Look for peers, then wait and call back until it is time to look again."""
        with self._lock:
            self._look()
        end = monotonic() + IDLE
        wakes, lock = self._pipe[0], self._lock
        while self._running:
            now = monotonic()
            if now >= end:
                return
            due = min((timer.due for timer in self._timers), default=end)
            readers = self._readers
            ready, _, _ = select.select([wakes, *readers], [], [], max(0.0, min(due, end) - now))
            if wakes in ready:
                os.read(wakes, 4096)
                ready.remove(wakes)
            with lock:
                self._call(ready)

    def _call(self, ready: list[int]) -> None:
        """Call back for the files that can be read, and by the timers that are due."""
        for file in ready:
            callback = self._readers.get(file)
            if callback is not None:
                callback()
        now = monotonic()
        for timer in self._timers:
            if timer.due <= now:
                timer.advance(now)
                timer.callback()
