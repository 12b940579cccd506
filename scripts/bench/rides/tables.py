"""Tables of rides in lockstep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

from bench.realtime.goals import Goal
from bench.rides.importing import MODULES, Import
from bench.rides.processes import MIB, Memory, ordered
from bench.rides.session import Kind, Ridden
from phil_study.outcome import Sheet

FASTER, FASTER_COMPOSED, SOONER = 1 / 2, 1 / 4, 0.6
"""Shares of the other build's time: of a ride, of one composed, and from the command to cycle 0."""


def ride_sheet(rides: Sequence[Ridden]) -> Sheet:
    """Give a row a ride."""
    rows: list[dict[str, object]] = [
        {
            "kind": one.kind,
            "factor": one.factor,
            "seconds": one.seconds,
            "us_per_cycle": 1e6 * one.seconds / one.cycles,
            "processor_us_per_cycle": sum(one.microseconds.values()),
            "start": one.start,
            "whole": one.whole,
            "cycles": one.cycles,
        }
        for one in rides
    ]
    heads = {"kind": "ride", "factor": "times real time", "seconds": "cycle 0 to last, s", "us_per_cycle": "us/cycle"}
    heads |= {"processor_us_per_cycle": "processor us/cycle", "start": "command to cycle 0, s"}
    return Sheet("rides", "rides", heads | {"whole": "whole command, s", "cycles": "cycles"}, rows)


def figure_sheet(rides: Sequence[Ridden]) -> Sheet:
    """Give median, smallest and largest of the rounds, by kind of ride."""
    rows: list[dict[str, object]] = []
    for kind in dict.fromkeys(one.kind for one in rides):
        mine = [one for one in rides if one.kind == kind]
        for what, values in {
            "times real time": [one.factor for one in mine],
            "cycle 0 to last cycle, s": [one.seconds for one in mine],
            "command to cycle 0, s": [one.start for one in mine],
            "whole command, s": [one.whole for one in mine],
            "processor time of all processes, us/cycle": [sum(one.microseconds.values()) for one in mine],
        }.items():
            row = {"kind": kind, "what": what, "median": median(values), "smallest": min(values)}
            rows.append({**row, "largest": max(values), "rounds": len(values)})
    heads = {"kind": "ride", "what": "", "median": "median", "smallest": "smallest", "largest": "largest"}
    return Sheet("figures", "over all rounds", heads | {"rounds": "rounds"}, rows)


def use_sheet(rides: Sequence[Ridden]) -> Sheet:
    """Give what a cycle costs each process, median of the rounds, a column for each kind of ride."""
    kinds = list(dict.fromkeys(one.kind for one in rides))
    rows: list[dict[str, object]] = []
    for name in ordered({name: None for one in rides for name in one.microseconds}):
        row: dict[str, object] = {"process": name}
        for kind in kinds:
            values = [one.microseconds[name] for one in rides if one.kind == kind and name in one.microseconds]
            row[kind] = median(values) if values else None
        rows.append(row)
    heads = {"process": "processor time, us/cycle"} | {kind: kind for kind in kinds}
    return Sheet("use", "what a cycle costs", heads, rows)


def memory_sheet(seen: Mapping[str, Mapping[str, Memory]]) -> Sheet:
    """Give resident memory in MiB at the end of a ride, by process, two columns for each kind of ride."""
    rows: list[dict[str, object]] = []
    for name in ordered({name: None for several in seen.values() for name in several}):
        row: dict[str, object] = {"process": name}
        for kind, several in seen.items():
            one = several.get(name)
            row[f"{kind}, RSS"] = None if one is None else one.resident / MIB
            row[f"{kind}, PSS"] = None if one is None else one.proportional / MIB
        rows.append(row)
    total: dict[str, object] = {"process": "all of them"}
    for kind, several in seen.items():
        total[f"{kind}, RSS"] = sum(one.resident for one in several.values()) / MIB
        total[f"{kind}, PSS"] = sum(one.proportional for one in several.values()) / MIB
    heads = {"process": "resident memory, MiB"}
    heads |= {f"{kind}, {what}": f"{kind}, {what}" for kind in seen for what in ("RSS", "PSS")}
    return Sheet("memory", "memory at the end of a ride (PSS: what is shared, in equal parts)", heads, [*rows, total])


def import_sheet(found: Sequence[Import]) -> Sheet:
    """Give the time of an interpreter that imports a module, in ms, median over all, by build."""
    builds = list(dict.fromkeys(one.build for one in found))
    rows: list[dict[str, object]] = []
    for module in MODULES:
        row: dict[str, object] = {"module": module}
        for build in builds:
            mine = [one for one in found if one.module == module and one.build == build]
            row[f"{build}, wall"] = 1e3 * median(one.wall for one in mine)
            row[f"{build}, processor"] = 1e3 * median(one.processor for one in mine)
        if len(builds) > 1:
            new, old = (row[f"{build}, wall"] for build in builds)
            assert isinstance(new, float) and isinstance(old, float)
            row["ratio"] = new / old
        rows.append(row)
    heads = {"module": "a fresh interpreter imports, ms"}
    heads |= {f"{build}, {what}": f"{build}, {what}" for build in builds for what in ("wall", "processor")}
    return Sheet("imports", "imports", heads | ({"ratio": "wall, ratio"} if len(builds) > 1 else {}), rows)


def comparison(rides: Sequence[Ridden], kinds: Sequence[Kind], old: Kind) -> tuple[Sheet, list[Goal]]:
    """Compare each kind of ride with that of the other build: ratio of the medians, and the range of the rounds."""
    rows: list[dict[str, object]] = []
    goals: list[Goal] = []
    theirs = [one for one in rides if one.kind == old.label]
    for kind in kinds:
        mine = [one for one in rides if one.kind == kind.label]
        for key, what in (("seconds", "cycle 0 to last cycle"), ("start", "command to cycle 0"), ("whole", "whole")):
            pairs = [(getattr(new, key), getattr(before, key)) for new, before in zip(mine, theirs, strict=True)]
            new, before = median(pair[0] for pair in pairs), median(pair[1] for pair in pairs)
            ratios = [a / b for a, b in pairs]
            row = {"what": f"{what}, {kind.label}", "unit": "s", "new": new, "old": before, "ratio": new / before}
            rows.append({**row, "smallest": min(ratios), "largest": max(ratios)})
            if key == "seconds":
                most = FASTER_COMPOSED if kind.composed else FASTER
                goals.append(Goal(f"time of a ride, {kind.label} / {old.label}", new / before, most))
            elif key == "start" and not kind.composed:
                goals.append(Goal(f"command to cycle 0, {kind.label} / {old.label}", new / before, SOONER))
    heads = {"what": "", "unit": "unit", "new": "new", "old": old.label, "ratio": "ratio", "smallest": "of rounds from"}
    return Sheet("comparison", f"against {old.label}, in turns", heads | {"largest": "to"}, rows), goals


def goal_sheet(goals: Sequence[Goal]) -> Sheet:
    """Give the goals with their verdicts."""
    heads = {"what": "", "value": "value", "goal": "at most", "holds": "verdict"}
    return Sheet("goals", "goals", heads, [goal.row() for goal in goals])
