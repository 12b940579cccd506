"""Tables and pictures of rides in real time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.realtime.figures import NODES, RIG, Times
from bench.realtime.goals import HALF, Goal
from bench.realtime.session import OF_TOPICS, RECORDER, Ridden
from phil_study.drawing import save, subplots
from phil_study.outcome import Sheet

PROCESSES = (*(process for node in NODES for process in (node, f"{node}, {OF_TOPICS}")), RECORDER)
SHOWN_RIDES = 12


def named(node: str) -> str:
    """Say what the turnaround of a node is."""
    return "rig: state out to command in" if node == RIG else f"{node}: message in to message out"


def pooled(rides: Sequence[Ridden]) -> dict[str, Times]:
    """Put the turnaround times of all rides of one build together, in s by node."""
    several = {
        node: [one.figures.turnaround[node] for one in rides if node in one.figures.turnaround] for node in NODES
    }
    return {node: np.concatenate(times) for node, times in several.items() if sum(map(len, times))}


def ride_sheet(rides: Sequence[Ridden]) -> Sheet:
    """Give a row a ride: late, bridged on end, how it ended, what else the machine did."""
    rows: list[dict[str, object]] = []
    for ride in rides:
        found, times = ride.figures, ride.figures.turnaround.get(RIG, np.zeros(0))
        median, p99 = np.percentile(times, [50.0, 99.0]) * 1e3 if times.size else (float("nan"), float("nan"))
        row: dict[str, object] = {"build": ride.build, "cycles": found.cycles, "late": found.late, "share": found.share}
        row |= {
            "bridged_on_end": found.bridged,
            "skipped": found.skipped,
            "median_ms": float(median),
            "p99_ms": float(p99),
        }
        row |= {"retracted": found.retracted, "outcome": ride.outcome, "late_cycles": found.late_at.tolist()}
        stood = ride.standstills
        row |= {"standstills": stood.begin.size, "longest_standstill_ms": stood.longest * 1e3}
        row |= {"late_then": stood.hit(found.late_times)}
        if ride.load:
            row |= {"busy_cores": ride.load.busy, "other_cores": ride.load.others, "stolen_cores": ride.load.stolen}
        if ride.work:
            row |= {"beside": vars(ride.work)}
        rows.append(row)
    heads = {
        "build": "build",
        "cycles": "cycles",
        "late": "late",
        "bridged_on_end": "on end",
        "skipped": "skipped",
        "standstills": "machine stood",
    }
    heads |= {"longest_standstill_ms": "longest ms", "late_then": "late then", "median_ms": "median ms"}
    heads |= {"p99_ms": "p99 ms", "busy_cores": "cores busy", "other_cores": "by others", "stolen_cores": "stolen"}
    return Sheet("rides", "rides (cores: processor time over wall time)", heads | {"outcome": "ended"}, rows)


def use_sheet(rides: Sequence[Ridden]) -> Sheet:
    """Give processor time and context switches in a cycle, by process, in the mean of the rides of a build."""
    rows: list[dict[str, object]] = []
    for build in dict.fromkeys(ride.build for ride in rides):
        mine = [ride for ride in rides if ride.build == build and ride.shares]
        for name in PROCESSES if mine else ():
            several = [ride.shares[name] for ride in mine if name in ride.shares]
            if not several:
                continue
            time, switches = np.mean([[one.microseconds, one.switches] for one in several], axis=0)
            how = " / ".join(dict.fromkeys(ride.scheduling.get(name, "") for ride in mine))
            row = {"build": build, "process": name, "us_per_cycle": float(time), "switches_per_cycle": float(switches)}
            rows.append({**row, "scheduling": how})
    heads = {"build": "build", "process": "process", "us_per_cycle": "processor us/cycle"}
    heads |= {"switches_per_cycle": "context switches/cycle", "scheduling": "threads are scheduled"}
    return Sheet("use", "what a cycle costs", heads, rows)


def of_node(ride: Ridden, name: str) -> float:
    """Give the processor time in us that a node used in a cycle, with the process for its topics; 0 if unknown."""
    if name not in ride.shares:
        return 0.0
    topics = ride.shares.get(f"{name}, {OF_TOPICS}")
    return ride.shares[name].microseconds + (topics.microseconds if topics is not None else 0.0)


def goal_sheet(goals: Sequence[Goal], title: str) -> Sheet:
    """Give the goals with their verdicts."""
    heads = {"what": "", "value": "value", "goal": "at most", "holds": "verdict"}
    return Sheet("goals", title, heads, [goal.row() for goal in goals])


def comparison(rides: Sequence[Ridden], new: str, old: str) -> tuple[Sheet, list[Goal]]:
    """Compare two builds that rode in turns: pooled, and how far the pairs spread."""
    by = {build: [ride for ride in rides if ride.build == build] for build in (new, old)}
    pools = {build: pooled(several) for build, several in by.items()}
    rows: list[dict[str, object]] = []
    goals: list[Goal] = []
    for node in NODES:
        if node not in pools[new] or node not in pools[old]:
            continue
        for of, share in (("median", 50.0), ("p99", 99.0)):
            now, before = (float(np.percentile(pools[build][node], share)) * 1e3 for build in (new, old))
            ratios = [
                float(
                    np.percentile(a.figures.turnaround[node], share) / np.percentile(b.figures.turnaround[node], share)
                )
                for a, b in zip(by[new], by[old], strict=True)
                if a.figures.turnaround[node].size and b.figures.turnaround[node].size
            ]
            row = {"what": f"{named(node)}, {of}", "unit": "ms", "new": now, "old": before, "ratio": now / before}
            rows.append({**row, "smallest": min(ratios), "largest": max(ratios)})
            if node == RIG:
                goals.append(Goal(f"state out to command in, {of}: {new} / {old}", now / before, HALF))
    for name in (*NODES, RECORDER):
        pairs = [(of_node(a, name), of_node(b, name)) for a, b in zip(by[new], by[old], strict=True)]
        pairs = [pair for pair in pairs if min(pair) > 0.0]
        if pairs:
            now, before = np.mean(pairs, axis=0)
            ratios = [float(a / b) for a, b in pairs]
            row = {"what": f"{name}: processor time in a cycle", "unit": "us", "new": float(now), "old": float(before)}
            rows.append({**row, "ratio": float(now / before), "smallest": min(ratios), "largest": max(ratios)})
    heads = {"what": "", "unit": "unit", "new": new, "old": old, "ratio": "ratio", "smallest": "of pairs from"}
    return Sheet("comparison", f"{new} against {old}, in turns", heads | {"largest": "to"}, rows), goals


def draw_late(rides: Sequence[Ridden], cycle_time: float, path: Path) -> None:
    """Draw the rig's turnaround over the ride's time, the largest of each tenth of a second, with its late commands."""
    shown = rides[:SHOWN_RIDES]
    figure, several = subplots(
        len(shown), 1, figsize=(9, 1.2 + 1.8 * len(shown)), layout="constrained", sharex=True, squeeze=False
    )
    for axes, ride in zip(several[:, 0], shown, strict=True):
        times = ride.figures.turnaround.get(RIG, np.zeros(0)) * 1e3
        block = max(1, round(0.1 / cycle_time))
        starts = np.arange(0, times.size, block)
        if starts.size:
            axes.step(starts * cycle_time, np.maximum.reduceat(times, starts), where="post", lw=0.8, color="C0")
        late = (ride.figures.late_at - ride.figures.first) * cycle_time
        axes.plot(
            late, np.full(late.size, cycle_time * 1e3), "|", color="C3", ms=14, label=f"late: {ride.figures.late}"
        )
        axes.axhline(cycle_time * 1e3, color="0.6", lw=0.8)
        axes.set(yscale="log", ylabel="ms", title=f"{ride.build}: {ride.outcome}")
        axes.title.set_fontsize(9)
        axes.legend(fontsize=8, loc="upper right")
        axes.grid(alpha=0.3)
    several[-1, 0].set_xlabel("time in s; state out to command in, largest of each 0.1 s; grey: one cycle")
    save(figure, path)
