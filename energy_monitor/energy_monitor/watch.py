"""The way out of a recorder whose main thread hangs: it was asked to end, and ends.

A signal's handler runs in the main thread, between two steps of Python. Where that thread waits in a library for ever,
nobody hears the signal. But the C part of Python writes it down at once, into a pipe. Two look at that pipe, and act if
the main thread has not taken the signal's byte from there in time:

1. a thread, which can still close the bag properly; it needs the interpreter's lock, which a library may hold;
2. if that does nothing either, a process of its own (`guardian`), which kills this one. The bag then is as after any
   kill: readable up to the last quarter of a second before the hang.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

from energy_monitor import guardian
from phil_base.scheduling import own_threads, schedule_as_others

PATIENCE = 4.0
"""s from a signal after which the main thread counts as hanging: longer than what still comes is waited for."""
LAST = 6.0
"""s after which the process is killed from outside."""
GOING = 1.0
"""s that the guardian may take to go."""


class Watch:
    """From a signal, or `arm`, until `calm` the main thread has `PATIENCE`; then ``rescue`` is called in a thread.

    Entered in the main thread, before anything can hang.
    """

    def __init__(self, rescue: Callable[[], None]) -> None:
        self._rescue = rescue
        self._read, self._write = -1, -1
        self._guardian: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Watch:
        self._read, self._write = os.pipe()
        for end in (self._read, self._write):
            os.set_blocking(end, False)
        with suppress(OSError):  # no process to be had: the thread is there
            self._guardian = subprocess.Popen(
                [sys.executable, "-I", "-S", guardian.__file__, str(os.getpid()), str(self._read), f"{LAST:g}"],
                pass_fds=[self._read],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
        signal.set_wakeup_fd(self._write, warn_on_full_buffer=False)
        threading.Thread(target=self._watch, name="watch", daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.calm()
        self._leave()
        if self._guardian is not None:
            schedule_as_others(own_threads())
            with suppress(subprocess.TimeoutExpired):
                self._guardian.wait(GOING)

    def arm(self) -> None:
        """Begin the time that the main thread has for what comes now, without a signal."""
        os.write(self._write, b"\0")

    def calm(self) -> None:
        """Say that the main thread goes on: it takes all the time that it needs from now on."""
        signal.set_wakeup_fd(-1)
        with suppress(BlockingIOError):
            while os.read(self._read, 4096):
                pass

    def _watch(self) -> None:
        while True:
            select.select([self._read], [], [])
            if guardian.closed(self._read):
                return
            if guardian.stays(self._read, PATIENCE):
                self._leave()  # from now on nobody waits for the main thread
                self._rescue()
                return

    def _leave(self) -> None:
        """Close the pipe, whose number stays in use: to the guardian this process is gone."""
        with open(os.devnull, "wb") as nothing:  # noqa: PTH123 - a file number is all that counts
            os.dup2(nothing.fileno(), self._write)
