"""The log of a node, bounded: what comes again and again is left out and counted."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from time import monotonic
from typing import Any

from phil_node.timing import KINDS, NUMBER

PERIOD = 10.0
"""Time in s in which the lines of one kind are counted."""
MOST = 10
"""Lines of one kind in a period; kinds beyond `timing.KINDS` count as one."""


class BoundedLog:
    """Logs through a node's logger; lines that differ in their numbers only are of one kind."""

    def __init__(self, logger: Callable[[], Any]) -> None:
        """Take the function that gives the logger."""
        self._logger = logger
        self._kinds: dict[str, tuple[float, int]] = {}

    @staticmethod
    def prepare() -> None:
        """Let lines of a ride take a fraction of a ms each, all modules being there.

        rclpy looks up who logs by `inspect`, and the first look goes through all modules of the process: 60 to 130 ms.
        """
        inspect.getframeinfo(inspect.currentframe())  # type: ignore[arg-type]  # CPython has frames

    def info(self, text: str) -> None:
        """Log what is as it should be."""
        if line := self._line(text):
            self._logger().info(line)

    def warning(self, text: str) -> None:
        """Log what may be meant."""
        if line := self._line(text):
            self._logger().warning(line)

    def error(self, text: str) -> None:
        """Log what did not work."""
        if line := self._line(text):
            self._logger().error(line)

    def _line(self, text: str) -> str:
        """Give the line, with the number of those of its kind that were left out; empty if it is left out itself."""
        now, kind = monotonic(), NUMBER.sub("#", text)
        if kind not in self._kinds and len(self._kinds) >= KINDS:
            kind = "other"
        begun, count = self._kinds.get(kind, (now, 0))
        left_out = 0
        if now - begun > PERIOD:
            begun, left_out, count = now, max(0, count - MOST), 0
        self._kinds[kind] = begun, count + 1
        if count >= MOST:
            return ""
        return f"{text} ({left_out} lines like this were left out)" if left_out else text
