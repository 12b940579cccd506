"""Turnaround of a node, cycle by cycle, sent in batches so that the measurement costs next to nothing."""

from __future__ import annotations

import array
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf
from time import perf_counter_ns
from typing import Any

import numpy as np

from phil_base.cycle_counts import CycleCounts

BATCH = 50
"""Cycles in one CycleTiming message: ten messages a second at 500 Hz."""
RECENT = 5000
"""Cycles that the statistics of /diagnostics look back."""
REASON = "reason: "
"""Beginning of the keys on /diagnostics that say why messages were refused; their values say how many."""
KINDS = 16
"""Kinds of refusals that are told apart; what is refused for yet another reason counts as "other reasons"."""
NUMBER = re.compile(r"-?\b\d+(\.\d+)?(e[-+]?\d+)?\b")
STUCK = 2.0
"""Time in s without a cycle, while what comes is refused, after which a node cannot go on by itself: longer than any
sender waits before it sends again."""


@dataclass
class Refusal:
    """One kind of refused messages: what was said of the first one, and how many there were."""

    text: str
    count: int = 0


class Timing:
    """Stopwatch and counters of one node; ``late``, ``missing``, ``stale``, ``refused`` count since :meth:`clear`.

    ``inputs`` are the counts of the cyclic topics that the node receives, by topic; their owners count and clear them.
    """

    def __init__(self) -> None:
        self.budget = 0.002
        self.late = 0
        self.missing = 0
        self.stale = 0
        self.refused = 0
        self.count_overruns = True
        self.inputs: Mapping[str, CycleCounts] = {}
        self._send: Callable[[Any], None] | None = None
        self._message: Any = None
        # Of the array module: one entry is set in a third of numpy's time.
        self._batch = array.array("f", bytes(4 * BATCH))
        self._filled = 0
        self._recent = array.array("f", bytes(4 * RECENT))
        self._total = 0
        self._begun = 0
        self._ended = 0
        self._header: Any = None
        self._cycle = 0
        self._refusals: dict[str, Refusal] = {}
        self._refused_since = 0
        self._refused_at = 0

    @property
    def idle(self) -> float:
        """Give the time in s since the last cycle; infinite before the first."""
        return (perf_counter_ns() - self._ended) * 1e-9 if self._total else inf

    @property
    def heard(self) -> float:
        """Give the time in s since a message came, usable or not; infinite before the first."""
        return (perf_counter_ns() - self._begun) * 1e-9 if self._begun else inf

    @property
    def stamp(self) -> int:
        """Give the stamp t_k of the last cycle in ns; 0 before the first."""
        if not self._total or self._header is None:
            return 0
        return int(self._header.stamp.sec * 1_000_000_000 + self._header.stamp.nanosec)

    @property
    def stuck(self) -> bool:
        """Tell whether no cycle was done for `STUCK` s because of what was refused.

        Before the first cycle it takes refusals that go on for so long: one stray message does not stop a ride that
        has not begun.
        """
        if not self._refused_at or self._done_since_refusal():
            return False
        now = perf_counter_ns() if self._total else self._refused_at
        return now - self._refused_since > STUCK * 1e9

    @property
    def refusals(self) -> list[str]:
        """Give what was said of the first refused message of each kind."""
        return [refusal.text for refusal in self._refusals.values()]

    def connect(self, message: Any, send: Callable[[Any], None], budget: float, count_overruns: bool = True) -> None:
        """Send batches as ``message`` (a CycleTiming, reused) through ``send``; ``budget`` is the cycle time in s.

        With ``count_overruns`` False the owner counts ``late`` itself (the rig knows when a command is too late).
        """
        self._message, self._send, self.budget, self.count_overruns = message, send, budget, count_overruns
        message.budget = budget

    def clear(self) -> None:
        """Forget all that was measured and counted."""
        self.late = self.missing = self.stale = self.refused = 0
        self._filled = self._total = self._begun = 0
        self._refusals.clear()
        self._refused_since = self._refused_at = 0

    def refuse(self, text: str) -> None:
        """Remember why a message was refused; texts that differ in their numbers only are of one kind.

        The owner counts ``refused`` itself.
        """
        now, kind = perf_counter_ns(), NUMBER.sub("#", text)
        if not self._refused_at or self._done_since_refusal():
            self._refused_since = now
        self._refused_at = now
        if kind not in self._refusals and len(self._refusals) >= KINDS:
            kind, text = "other", "messages were refused for other reasons"
        self._refusals.setdefault(kind, Refusal(text)).count += 1

    def _done_since_refusal(self) -> bool:
        return self._total > 0 and self._ended > self._refused_since

    def begin(self) -> None:
        """Start the stopwatch of a cycle."""
        self._begun = perf_counter_ns()

    def end(self, header: Any, cycle: int) -> None:
        """Stop the stopwatch of ``cycle`` and send the batch when it is full."""
        self.add((perf_counter_ns() - self._begun) * 1e-9, header, cycle)

    def add(self, seconds: float, header: Any, cycle: int) -> None:
        """Add one measured cycle in s; ``header`` is the header whose stamp is t_k."""
        if self.count_overruns and seconds > self.budget:
            self.late += 1
        self._batch[self._filled] = seconds
        self._filled += 1
        self._recent[self._total % RECENT] = seconds
        self._total += 1
        self._ended = perf_counter_ns()
        self._header, self._cycle = header, cycle
        if self._filled == BATCH:
            self.flush(header, cycle)

    def flush(self, header: Any, cycle: int) -> None:
        """Send what the batch holds, even if it is not full (end of a ride)."""
        if self._send is None or self._filled == 0:
            return
        message = self._message
        stamp, now = message.header.stamp, header.stamp
        stamp.sec, stamp.nanosec = now.sec, now.nanosec
        message.header.frame_id = "rig"
        message.cycle = cycle
        message.turnaround = self._batch[: self._filled]
        message.late, message.missing = self.late, self.missing
        message.stale, message.refused = self.stale, self.refused
        message.messages_late, message.messages_lost, message.messages_doubled, message.messages_swapped = self._sums()
        self._filled = 0
        self._send(message)

    def finish(self) -> None:
        """Send what the batch still holds under the last cycle that was measured (before the node falls silent)."""
        self.flush(self._header, self._cycle)

    def _sums(self) -> tuple[int, int, int, int]:
        """Give how many messages came late, never, twice and behind a later one, all inputs together."""
        late = lost = doubled = swapped = 0
        for counts in self.inputs.values():
            late += counts.late
            lost += counts.lost
            doubled += counts.doubled
            swapped += counts.swapped
        return late, lost, doubled, swapped

    def summary(self) -> dict[str, str]:
        """Give the figures for /diagnostics: median, p99 and maximum in ms of the recent cycles, and the counters."""
        recent = np.array(self._recent[: min(self._total, RECENT)], dtype=np.float32)
        figures = {}
        if recent.size:
            median, p99 = np.percentile(recent, [50.0, 99.0])
            figures = {
                "turnaround median ms": f"{median * 1e3:.3f}",
                "turnaround p99 ms": f"{p99 * 1e3:.3f}",
                "turnaround max ms": f"{float(recent.max()) * 1e3:.3f}",
            }
        late, lost, doubled, swapped = self._sums()
        return (
            figures
            | {
                "cycles": str(self._total),
                "late": str(self.late),
                "missing": str(self.missing),
                "stale": str(self.stale),
                "refused": str(self.refused),
                "messages late": str(late),
                "messages lost": str(lost),
                "messages doubled": str(doubled),
                "messages swapped": str(swapped),
            }
            | {f"input {topic}": str(counts) for topic, counts in self.inputs.items()}
            | {f"{REASON}{refusal.text}": str(refusal.count) for refusal in self._refusals.values()}
        )
