"""What a node says of itself on /diagnostics, by the conventions of ROS (REP 107), and when it says it.

A status is called "NODE: cycle", with the node's full name, which is its hardware_id, too. The page docs/diagnostics.md
explains every sentence and every figure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

OK, WARN, ERROR, STALE = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR, DiagnosticStatus.STALE
SEVERITY = (OK, WARN, STALE, ERROR)
"""From good to bad; STALE, the largest number, says that nothing is known any more, and ERROR that nothing will be."""
EVERY = 1.0
"""Time in s from one status to the next while nothing changes."""
LOOK = 0.1
"""Time in s from one look for a change to the next: not more than ten statuses a second."""
SILENT = 2.0
"""Time in s without input after which a node in whose ride cycles were coming is STALE."""


def worst(*levels: bytes) -> bytes:
    """Give the worst of some levels."""
    return max(levels, key=SEVERITY.index)


@dataclass
class Diagnosis:
    """What a node says of itself on /diagnostics: level OK, WARN, STALE or ERROR, a sentence, and figures.

    The sentence is for people and does not change as long as nothing new happens: counts are figures. What a program
    has to know is a figure too.
    """

    level: bytes = OK
    message: str = "active"
    values: dict[str, str] = field(default_factory=dict)

    def add(self, level: bytes, text: str) -> None:
        """Say something more; what is worse than all that was said stands first."""
        if level != OK and self.level == OK:
            self.message = text
        elif SEVERITY.index(level) > SEVERITY.index(self.level):
            self.message = f"{text}; {self.message}"
        else:
            self.message = f"{self.message}; {text}"
        self.level = worst(level, self.level)


class Reporter:
    """Publishes a node's diagnosis once a second, and within a tenth of a second when something changed."""

    def __init__(
        self,
        name: str,
        say: Callable[[DiagnosticArray], None],
        diagnose: Callable[[], Diagnosis],
        signs: Callable[[], tuple[object, ...]],
        stamp: Callable[[], int],
    ) -> None:
        """Take the node's full name, who publishes, what to say, signs of a change, and what gives the time in ns."""
        # Two rigs in namespaces share the topic: the whole name tells whose status this is.
        self._status = DiagnosticStatus(name=f"{name}: cycle", hardware_id=name)
        self._message = DiagnosticArray(status=[self._status])
        self._say, self._diagnose, self._signs, self._stamp = say, diagnose, signs, stamp
        self._shown: tuple[object, ...] = ()
        self._at = -EVERY
        self._events: Mapping[str, int] = {}
        self._event_at: float | None = None

    def look(self) -> None:
        """Publish if it is time, or if something changed."""
        now, signs = monotonic(), self._signs()
        if signs != self._shown or now - self._at >= EVERY - 0.5 * LOOK:
            self._shown, self._at = signs, now
            self.publish()

    def publish(self) -> None:
        """Publish now."""
        found, status = self._diagnose(), self._status
        status.level, status.message = found.level, found.message
        status.values = [KeyValue(key=key, value=value) for key, value in found.values.items()]
        stamp: Any = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(self._stamp(), 1_000_000_000)
        self._say(self._message)

    def since_last(self, **counts: int) -> str:
        """Give the time in s since one of these counters was last seen to rise, "-" if none has."""
        now = monotonic()
        if any(count > self._events.get(name, 0) for name, count in counts.items()):
            self._event_at = now
        if not any(counts.values()):
            self._event_at = None
        self._events = counts
        return "-" if self._event_at is None else f"{now - self._event_at:.0f}"
