"""What became of a ride to which a fault was done, from what was seen of it; no ROS, no processes."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from phil_base.enumerations import Mode

FOLLOWED = (Mode.TRACKING, Mode.BRIDGING)
"""Modes of a drive that follows its command, or what the one before predicted for a single late one."""
STEADY = 25
"""Successive cycles of these modes after which the drive is back."""
STOOD = 0.04
"""Time in s by which a rig's stamps go ahead of its cycles when it has stood still."""
SILENCE = 1.0
"""Time in s without a state of the rig after which it is silent."""
WARN = 1
TRACKS, RETRACTS, SILENT = "tracks", "retracts", "silent"


class Sight(NamedTuple):
    """A state of the rig, as an observer needs it."""

    at: float  # s, monotonic clock, when it came
    cycle: int
    mode: int
    w: float  # m
    v: float  # m/s
    f: float  # N
    current: float  # A
    late: int
    stamp: float  # s, of the rig's clock


@dataclass
class Remark:
    """What a node said on /diagnostics, and when on the monotonic clock in s."""

    at: float
    node: str
    level: int
    message: str
    values: dict[str, str] = field(default_factory=dict)


class Limits(NamedTuple):
    """What the drive must not exceed, whatever happens."""

    position: float  # m
    speed: float  # m/s
    force: float  # N
    current: float  # A


class Peaks(NamedTuple):
    """Largest values of either sign of a ride."""

    position: float  # m
    speed: float  # m/s
    force: float  # N
    current: float  # A

    def beyond(self, limits: Limits) -> list[str]:
        """Say what is beyond its limit; a value that is not a number is."""
        units = ("m", "m/s", "N", "A")
        return [
            f"{name} {value:.4g} {unit} beyond {most:g} {unit}"
            for name, value, most, unit in zip(self._fields, self, limits, units, strict=True)
            if not value <= most
        ]


@dataclass
class Row:
    """One fault and its outcome; it is good if ``failures`` is empty."""

    name: str
    title: str
    ended: str = ""
    """tracks, retracts or silent; what the drive did at last."""
    safe_after: float | None = None
    """s from the fault until the drive followed again, or rested; None if it never did."""
    peaks: Peaks | None = None
    late: int = 0
    """Late commands from the fault on."""
    reported: list[str] = field(default_factory=list)
    bag: str = ""
    rejoined: str = ""
    tries: int = 1
    failures: list[str] = field(default_factory=list)

    @property
    def ok(self) -> bool:
        """Tell whether nothing was found wrong."""
        return not self.failures

    def document(self) -> dict[str, Any]:
        """Give all of it for a JSON file."""
        return asdict(self) | {"peaks": self.peaks._asdict() if self.peaks else None, "ok": self.ok}


def peaks(sights: Sequence[Sight]) -> Peaks:
    """Give the largest values of a ride."""

    def largest(name: str) -> float:
        values = [abs(getattr(sight, name)) for sight in sights]
        # max() passes over a NaN that is not the first; a value that is none is the worst of all.
        return next((value for value in values if value != value), max(values, default=0.0))

    return Peaks(largest("w"), largest("v"), largest("f"), largest("current"))


def outcome(sights: Sequence[Sight], since: float, until: float, period: float) -> tuple[str, float | None]:
    """Give what the drive did at last, and how long after ``since`` (s) it was safe; ``until`` is the end of the watch.

    It tracks if its newest states follow their commands; the time is then that of the first of `STEADY` followed cycles
    in a row behind the last gap. Whether the rig stood still is told by its stamps and cycles (of ``period`` s): who
    watches may be held up himself. What he did not see, the count of late commands tells: it rises by each.
    """
    after = [sight for sight in sights if sight.at >= since]
    rest = next((sight.at for sight in after if sight.mode == Mode.STOPPED), None)
    if rest is not None:
        return RETRACTS, rest - since
    if not after or until - after[-1].at > SILENCE:
        return SILENT, max(0.0, after[-1].at - since) if after else 0.0
    if any(sight.mode == Mode.RETRACTING for sight in after):
        return RETRACTS, None
    run, back, away = 0, since, False
    before = next((sight for sight in reversed(sights) if sight.at < since), after[0])
    for number, sight in enumerate(after):
        stood = sight.stamp - before.stamp - period * max(0, sight.cycle - before.cycle) > STOOD
        stood = stood or sight.late - before.late > 1
        before = sight
        away = away or stood or sight.mode not in FOLLOWED
        run = 0 if sight.mode not in FOLLOWED else 1 if stood else run + 1
        if away and run >= STEADY:
            back, away = after[number - STEADY + 1].at, False
    return TRACKS, None if away else back - since


def steady(sights: Sequence[Sight], since: float) -> bool:
    """Tell whether the drive has come to an end that lasts: it rests, or it follows its commands."""
    after = [sight for sight in sights if sight.at >= since]
    if any(sight.mode == Mode.STOPPED for sight in after):
        return True
    newest = after[-STEADY:]
    return len(newest) == STEADY and all(sight.mode in FOLLOWED for sight in newest)


def said(remarks: Sequence[Remark], since: float) -> dict[str, list[str]]:
    """Give what each node warned of since then, each sentence once, the worst level in front."""
    found: dict[str, list[str]] = {}
    for remark in remarks:
        if remark.at >= since and remark.level >= WARN:
            text = f"{('OK', 'WARN', 'ERROR', 'STALE')[remark.level]} {remark.message}"
            texts = found.setdefault(remark.node, [])
            if text not in texts:
                texts.append(text)
    return found


def answers(reports: Mapping[str, Sequence[str]], wanted: Sequence[tuple[str, str]]) -> tuple[list[str], list[str]]:
    """Find the newest text that says what is ``wanted`` (node and pattern, all of them); give these and complaints."""
    found, failures = [], []
    for node, pattern in wanted:
        text = next((text for text in reversed(reports.get(node, [])) if re.search(pattern, text)), None)
        if text is None:
            failures.append(f"{node} did not report '{pattern}'")
        else:
            found.append(f"{node}: {text}")
    return found, failures


def bag_gaps(cycles: Sequence[int], through: int) -> str:
    """Say which of the cycles 0 to ``through`` a bag lacks; empty if it has them all."""
    there = set(cycles)
    missing = [cycle for cycle in range(through + 1) if cycle not in there]
    if not missing:
        return ""
    return f"{len(missing)} cycles up to {through} are not in the bag, the first is {missing[0]}"
