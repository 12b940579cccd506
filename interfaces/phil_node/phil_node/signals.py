"""What signals do to a node's process, in every phase of its life: it ends in one piece and without a traceback.

| phase | first signal | a further one, half a second later |
|---|---|---|
| imports, before there is a node | ends at once (SIGINT 130, SIGTERM 143, SIGHUP 129) | |
| there is a node | it is deactivated and cleaned up if need be, and ends with 0 | ends at once, with 128 + its number |

SIGHUP (the terminal is gone) is a signal like Ctrl-C, unless whoever started the process told it to ignore that
(nohup). rclpy's own handlers would take the context away in the midst of a callback that publishes.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from time import monotonic
from types import FrameType, TracebackType
from typing import Any

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
SAME = 0.5
"""Time in s in which a second signal is the first one come twice: from the terminal and from what launched the node."""
_BEFORE = sys.excepthook


def end_quietly_on_interrupt() -> None:
    """Let Ctrl-C end the process without a traceback wherever it is; the exit code stays that of the signal (130)."""
    sys.excepthook = _say_nothing_of_interrupts


def _say_nothing_of_interrupts(
    kind: type[BaseException], error: BaseException, traceback: TracebackType | None
) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        _BEFORE(kind, error, traceback)


class Ending:
    """Takes the signals that end a process, for as long as it is entered; ``asked`` tells that one has come."""

    def __init__(self) -> None:
        self._asked_at: float | None = None
        self._before: dict[signal.Signals, Any] = {}

    @property
    def asked(self) -> bool:
        """Tell whether the process was asked to end."""
        return self._asked_at is not None

    def __enter__(self) -> Ending:
        if threading.current_thread() is threading.main_thread():  # no other may set handlers
            for number in ENDING:
                before = signal.getsignal(number)
                if (number, before) != (signal.SIGHUP, signal.SIG_IGN):
                    self._before[number] = signal.signal(number, self._take)
        global _present
        _present = self
        return self

    def __exit__(self, *_: object) -> None:
        global _present
        _present = None
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _take(self, number: int, frame: FrameType | None) -> None:
        now = monotonic()
        if self._asked_at is None:
            self._asked_at = now
        elif now - self._asked_at > SAME:
            os._exit(128 + number)


_present: Ending | None = None


def asked_to_end() -> bool:
    """Tell whether this node's process was asked to end: for what waits long within a callback."""
    return _present is not None and _present.asked
