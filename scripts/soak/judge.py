"""What must hold of a long ride, with figures: memory, threads and files, cycles, records, logs, report."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from soak.looks import Sample

Floats = NDArray[np.float64]

SETTLING = 60.0
"""s at the beginning in which memory may grow: queues fill up, libraries are loaded."""
WINDOW = 60.0
"""s over which medians are taken: behind the settling, and at the end."""
SHORTEST = 3
"""A ride that is shorter than so many settlings settles within a third of itself, and so for the windows."""
MEMORY = 1024.0
"""kiB by which resident memory may grow."""
COUNTS = 2.0
"""Threads, or open files, that may come to those of the beginning."""
SEGMENTS = 1024.0
"""kiB by which shared memory may grow."""
LOGS = 65536.0
"""Bytes that may be logged once the ride has settled."""
KIB = 1024.0


@dataclass(frozen=True)
class Verdict:
    """One thing that must hold: at most ``limit``, in ``unit``; ``found`` None is nothing measured, which fails."""

    name: str
    found: float | None
    limit: float
    unit: str
    remark: str = ""

    @property
    def ok(self) -> bool:
        """Tell whether it holds."""
        return self.found is not None and self.found <= self.limit


@dataclass(frozen=True)
class Trend:
    """How a quantity went: medians of the window behind the settling and of the last one, largest, and slope."""

    first: float
    last: float
    largest: float
    slope: float
    """Per minute, of the straight line through all values behind the settling."""

    @property
    def growth(self) -> float:
        """Give by how much the larger of the last median and the largest value is above the first median."""
        return max(self.last, self.largest) - self.first


def settling(seconds: float) -> float:
    """Give the time in s in which a ride of ``seconds`` settles, and over which medians are taken."""
    return min(SETTLING, seconds / SHORTEST)


def trend(time: Floats, values: Floats) -> Trend | None:
    """Find the trend of values at times in s from the beginning on; None if there are too few."""
    if len(time) < SHORTEST:
        return None
    settled = settling(float(time[-1]))
    after = time >= settled
    first = values[after & (time < settled + min(WINDOW, settled))]
    last = values[time >= time[-1] - min(WINDOW, settled)]
    if not len(first) or after.sum() < 2:
        return None
    minutes = (time[after] - time[after].mean()) / 60.0
    slope = float(minutes @ (values[after] - values[after].mean()) / (minutes @ minutes))
    return Trend(float(np.median(first)), float(np.median(last)), float(values[after].max()), slope)


def times(samples: Sequence[Sample]) -> Floats:
    """Give the times of samples in s since the first."""
    wall = np.array([one.wall for one in samples], np.int64)
    return np.asarray((wall - wall[:1]) * 1e-9, np.float64)


def column(samples: Sequence[Sample], pick: Callable[[Sample], float | None]) -> tuple[Floats, Floats]:
    """Give times in s and values of what ``pick`` finds in samples, where it finds something."""
    found = [(at, value) for at, one in zip(times(samples), samples, strict=True) if (value := pick(one)) is not None]
    return np.array([at for at, _ in found]), np.array([value for _, value in found], np.float64)


def quantity(samples: Sequence[Sample], process: str, name: str) -> tuple[Floats, Floats]:
    """Give times in s and values of a quantity of `looks.QUANTITIES` of one process."""
    return column(samples, lambda one: getattr(one.looks[process], name) if process in one.looks else None)


def trends(samples: Sequence[Sample], process: str, names: Sequence[str]) -> dict[str, Trend]:
    """Give the trends of quantities of one process."""
    found = {name: trend(*quantity(samples, process, name)) for name in names}
    return {name: one for name, one in found.items() if one is not None}


def judge_samples(samples: Sequence[Sample], processes: Sequence[str]) -> list[Verdict]:
    """Judge what was seen of the processes: nothing may grow once the ride has settled."""
    verdicts = []
    for process in processes:
        for name, limit, unit, scale, text in (
            ("resident", MEMORY, "MiB", KIB, "resident memory"),
            ("threads", COUNTS, "", 1.0, "threads"),
            ("files", COUNTS, "", 1.0, "open files"),
        ):
            found = trend(*quantity(samples, process, name))
            growth = None if found is None else found.growth / scale
            remark = "" if found is None or scale == 1.0 else _remark(found, scale)
            verdicts.append(Verdict(f"{process}: growth of {text}", growth, limit / scale, unit, remark))
    segments = trend(*column(samples, lambda one: None if one.segments is None else one.segments / KIB))
    growth = None if segments is None else segments.growth / KIB
    verdicts.append(Verdict("shared memory of all: growth", growth, SEGMENTS / KIB, "MiB"))
    verdicts.append(Verdict("logs: growth once settled", _logged(samples), LOGS / KIB, "KiB"))
    return verdicts


def _remark(found: Trend, scale: float) -> str:
    return (
        f"{found.first / scale:.2f} MiB, in the end {found.last / scale:.2f}, at most {found.largest / scale:.2f}, "
        f"slope {found.slope:+.1f} KiB a minute"
    )


def _logged(samples: Sequence[Sample]) -> float | None:
    """Give what was logged in KiB once the ride had settled."""
    time, size = column(samples, lambda one: one.logs)
    if len(time) < SHORTEST:
        return None
    return float(size[-1] - size[np.searchsorted(time, settling(float(time[-1])))]) / KIB


def judge_lists(found: Mapping[str, Sequence[str]]) -> list[Verdict]:
    """Judge lists that have to be empty; what is in them is said."""
    return [Verdict(name, float(len(several)), 0.0, "", ", ".join(several[:3])) for name, several in found.items()]
