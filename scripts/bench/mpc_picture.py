"""Pictures of the controller's bench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.mpc_contest import Entry
from phil_study.drawing import save, subplots

Array = NDArray[np.float64]
Draw = Callable[[Path], None]


def _axes(count: int = 1) -> tuple[Any, Any]:
    return subplots(1, count, figsize=(8.0, 4.5) if count == 1 else (11.0, 4.8), layout="constrained")


def histogram(times: Array, name: str) -> Draw:
    """Draw how often a cycle took how long (s)."""

    def draw(path: Path) -> None:
        figure, axes = _axes()
        us = times * 1e6
        median, p99 = np.percentile(us, [50.0, 99.0])
        highest = 2.0 * float(p99)
        axes.hist(np.minimum(us, highest), bins=np.linspace(0.0, highest, 151), histtype="step")
        axes.axvline(median, color="k", lw=0.8, label=f"median {median:.1f} us")
        axes.axvline(p99, color="k", lw=0.8, ls="--", label=f"p99 {p99:.1f} us (max {us.max():.0f} us)")
        axes.set(yscale="log", xlabel="time of a cycle in us (the last bin holds all beyond)", ylabel="cycles")
        axes.set_title(name)
        axes.legend(fontsize=8)
        save(figure, path)

    return draw


def cases(rows: Sequence[dict[str, Any]]) -> Draw:
    """Draw median and p99 of all cases side by side."""

    def draw(path: Path) -> None:
        figure, axes = _axes()
        names = [f"{row['segment_m']:g} m\nNp {row['horizon']}\nNc {row['moves']}" for row in rows]
        place = np.arange(len(rows))
        for key, best, offset, label in (
            ("median_ms", "best_round_ms", -0.2, "median"),
            ("p99_ms", "best_p99_ms", 0.2, "p99"),
        ):
            axes.bar(place + offset, [row[key] * 1e3 for row in rows], 0.38, label=label)
            axes.plot(place + offset, [row[best] * 1e3 for row in rows], "k_", ms=10)
        axes.set_xticks(place, names, fontsize=8)
        axes.set(ylabel="time of a cycle in us", title="over segment, horizon and moves; line: best round")
        axes.grid(alpha=0.3, axis="y")
        axes.legend(fontsize=8)
        save(figure, path)

    return draw


def solvers(found: dict[str, dict[str, Entry]]) -> Draw:
    """Draw for all solvers the share of the problems that took longer than a time, sequence by sequence."""

    def draw(path: Path) -> None:
        figure, every = _axes(len(found))
        for axes, (title, entries) in zip(np.atleast_1d(every), found.items(), strict=True):
            for name, entry in entries.items():
                ordered = np.sort(entry.times) * 1e3
                axes.loglog(ordered, 1.0 - np.arange(ordered.size) / ordered.size, label=name, lw=1.2)
            axes.set(title=title, xlabel="time of a solution in ms", ylabel="share of the problems that took longer")
            axes.grid(alpha=0.3)
        np.atleast_1d(every)[0].legend(fontsize=8)
        save(figure, path)

    return draw
