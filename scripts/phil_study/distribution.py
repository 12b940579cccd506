"""One measured distribution, beside what it is to be compared with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from phil_study.drawing import save, subplots


@dataclass(frozen=True)
class Distribution:
    """Times of one thing in ms; ``goal`` is what its median or p99 (``of``) has to stay below."""

    name: str
    count: int
    median: float
    p99: float
    p999: float
    maximum: float
    goal: float | None = None
    of: str = "median"
    source: str = ""

    @property
    def holds(self) -> bool | None:
        """Tell whether the goal is met; None without a goal."""
        return None if self.goal is None else (self.median if self.of == "median" else self.p99) <= self.goal

    def row(self) -> dict[str, object]:
        """Give the figures for JSON."""
        return {
            "name": self.name,
            "count": self.count,
            "median_ms": self.median,
            "p99_ms": self.p99,
            "p999_ms": self.p999,
            "max_ms": self.maximum,
            "goal_ms": self.goal,
            "goal_of": self.of if self.goal is not None else None,
            "goal_source": self.source or None,
            "holds": self.holds,
        }


def distribution(
    name: str, seconds: NDArray[np.float64], goal: float | None = None, of: str = "median", source: str = ""
) -> Distribution:
    """Summarise measured times in s; ``goal`` in ms."""
    median, p99, p999, maximum = (float(ms) for ms in np.percentile(seconds, [50.0, 99.0, 99.9, 100.0]) * 1e3)
    return Distribution(name, int(seconds.size), median, p99, p999, maximum, goal, of, source)


def table(title: str, rows: Sequence[Distribution]) -> Table:
    """Make the table for the terminal."""
    made = Table(title=title, title_justify="left")
    for head in ("", "count", "median ms", "p99 ms", "p99.9 ms", "max ms", "goal ms", "verdict"):
        made.add_column(head, justify="left" if head in ("", "goal ms", "verdict") else "right")
    for row in rows:
        goal = "" if row.goal is None else f"{row.of} <= {row.goal:g} ({row.source})"
        verdict = "" if row.holds is None else "holds" if row.holds else "FAILS"
        figures = (f"{value:.4f}" for value in (row.median, row.p99, row.p999, row.maximum))
        made.add_row(row.name, str(row.count), *figures, goal, verdict)
    return made


def picture(title: str, samples: dict[str, NDArray[np.float64]], path: Path) -> None:
    """Draw the share of the samples (in s) that took longer than a time, one curve each."""
    figure, axes = subplots(figsize=(8, 4.5), layout="constrained")
    for name, seconds in samples.items():
        ordered = np.sort(seconds) * 1e3
        axes.loglog(ordered, 1.0 - np.arange(ordered.size) / ordered.size, label=name, lw=1.2)
    axes.set(title=title, xlabel="time in ms", ylabel="share of the cycles that took longer")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    save(figure, path)
