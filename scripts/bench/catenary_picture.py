"""Pictures of the catenary's bench."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.catenary_competitors import MODEL, Contest
from bench.catenary_phases import GROUPS, Share
from phil_study.drawing import save, subplots

Array = NDArray[np.float64]
Draw = Callable[[Path], None]


def _axes(count: int = 1) -> tuple[Any, Any]:
    return subplots(1, count, figsize=(8.0, 4.5) if count == 1 else (10.0, 4.5), layout="constrained")


def histogram(default: Array, coarse: Array) -> Draw:
    """Draw how often a cycle took how long (s): the default mesh and the thesis's."""

    def draw(path: Path) -> None:
        figure, axes = _axes()
        highest = 3.0e6 * float(np.median(default))
        bins = np.linspace(0.0, highest, 151)
        for times, name in ((coarse, "thesis's mesh, one step a cycle"), (default, "default")):
            us = times * 1e6
            median, p99 = np.percentile(us, [50.0, 99.0])
            label = f"{name}: median {median:.1f} us, p99 {p99:.1f} us, max {us.max():.0f} us"
            (*_, patches) = axes.hist(np.minimum(us, highest), bins=bins, histtype="step", label=label)
            colour = patches[0].get_edgecolor()
            axes.axvline(median, color=colour, lw=0.8)
            axes.axvline(p99, color=colour, lw=0.8, ls="--")
        axes.set(yscale="log", xlabel="time of a cycle in us (the last bin holds all beyond)", ylabel="cycles")
        axes.set_title("2 spans, 250 km/h; lines: median, dashed p99")
        axes.legend(fontsize=8)
        save(figure, path)

    return draw


def spans(rows: Sequence[dict[str, Any]]) -> Draw:
    """Draw the cost over the number of spans."""

    def draw(path: Path) -> None:
        figure, axes = _axes()
        n = np.array([row["spans"] for row in rows], dtype=np.float64)
        median, best, worst, p99 = (
            np.array([row[key] for row in rows]) * 1e3
            for key in ("median_ms", "best_round_ms", "worst_round_ms", "p99_ms")
        )
        slope, rest = np.polyfit(n, median, 1)
        reach = [median - best, worst - median]
        axes.errorbar(n, median, reach, fmt="o", capsize=3, label="median (best, worst round)")
        axes.plot(n, p99, "^", label="p99")
        axes.plot(n, rest + slope * n, lw=1.0, label=f"{rest:.1f} us + {slope:.2f} us a span")
        axes.set(xlabel="spans", ylabel="time of a cycle in us", title="cost over spans, layers as by default")
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
        save(figure, path)

    return draw


def phases(measured: dict[str, Share]) -> Draw:
    """Draw the phases of a cycle for every kind of boundary, one bar each."""

    def draw(path: Path) -> None:
        figure, axes = _axes()
        kinds = list(measured)
        left = np.zeros(len(kinds))
        for name in GROUPS:
            us = np.array([measured[kind].group(name) * 1e6 for kind in kinds])
            axes.barh(kinds, us, left=left, label=name)
            left += us
        whole = [measured[kind].whole * 1e6 for kind in kinds]
        axes.plot(whole, np.arange(len(kinds)), "k|", ms=22, label="whole, without clocks between")
        axes.set(xlabel="us a cycle", title="share by phase, 2 spans")
        axes.invert_yaxis()
        figure.legend(loc="outside lower center", ncols=2, fontsize=8)
        save(figure, path)

    return draw


def competitors(held: dict[str, Contest]) -> Draw:
    """Draw the time of an integration step of all ways, over all rounds, mesh by mesh."""

    def draw(path: Path) -> None:
        figure, every = _axes(len(held))
        for axes, (mesh, contest) in zip(np.atleast_1d(every), held.items(), strict=True):
            names = list(contest.step)
            axes.boxplot([np.array(contest.step[name]) * 1e6 for name in names], showfliers=False)
            axes.set_xticks(range(1, len(names) + 1), [_label(contest, name) for name in names], fontsize=8)
            axes.set(yscale="log", title=f"2 spans, {mesh}", ylabel="us an integration step")
            axes.grid(alpha=0.3, axis="y", which="both")
        save(figure, path)

    return draw


def _label(contest: Contest, name: str) -> str:
    if name == MODEL:
        return name
    words = name.replace(" of the coupled matrix", "").replace(" (splu)", "")
    return f"{words}\n{np.median(contest.ratios(contest.step, name)):.1f} times"
