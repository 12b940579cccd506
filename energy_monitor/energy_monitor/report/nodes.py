"""What each node did: modes of the rig, solver, catenary, timing, and the warnings that were raised."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Bag, Diagnostic
from energy_monitor.report.alignment import Aligned, last_ride, unique
from energy_monitor.report.results import Catenary, Floats, ModeChange, Solver, Timing, Warned
from energy_monitor.report.wall_clock import stamps
from energy_monitor.topics import NODES, RIG_STATE
from phil_base.enumerations import FOLLOWING, EnvironmentKind, Mode, Named, SolverStatus

NUMBER = re.compile(r"-?\b\d+(\.\d+)?(e[-+]?\d+)?\b")
AROUND = 600_000_000_000
"""Time in ns before and after the ride in which its nodes speak; a stamp beyond is not by the clock of the ride."""
COUNTED = (
    *("late", "missing", "stale", "refused"),
    *("messages_late", "messages_lost", "messages_doubled", "messages_swapped"),
)
"""What a node counts since cycle 0 and sends with its turnaround; the second four are not in bags of before them."""
LEVELS = ("OK", "WARN", "ERROR", "STALE")


def counts(values: NDArray[Any], kind: type[Named]) -> dict[str, int]:
    """Count how often each named constant occurs, those that do only; an unknown one by its number."""
    found, number = np.unique(values, return_counts=True)
    return {_name(kind, int(v)): int(n) for v, n in zip(found, number, strict=True)}


def modes(aligned: Aligned, ts: float) -> list[ModeChange]:
    """List the rig's first mode and every change of it."""
    mode = aligned.rig["mode"].astype(np.int64)
    at = np.concatenate([[0], np.flatnonzero(np.diff(mode)) + 1])
    return [ModeChange(int(aligned.cycle[i]), _name(Mode, int(mode[i])), float(aligned.cycle[i] * ts)) for i in at]


def retracted(aligned: Aligned) -> int:
    """Count the cycles in which the rig retracted or had stopped; one that landed and rests did not retract."""
    mode = aligned.rig["mode"]
    retracting, landing = mode == Mode.RETRACTING, mode == Mode.LANDING
    if landing.any() and not retracting.any():
        return 0
    return int((retracting | (mode == Mode.STOPPED)).sum())


def counted(aligned: Aligned) -> NDArray[np.bool_]:
    """Tell in which cycles the rig followed the catenary: only these are in the books."""
    of_catenary = aligned.command["environment"] == EnvironmentKind.CATENARY
    return np.asarray(of_catenary & np.isin(aligned.rig["mode"], FOLLOWING), dtype=np.bool_)


def left_the_catenary(aligned: Aligned) -> int | None:
    """Give the first cycle in which the rig was to behave like something else than the catenary; None: in none."""
    others = np.flatnonzero(aligned.command["environment"] != EnvironmentKind.CATENARY)
    return int(aligned.cycle[others[0]]) if len(others) else None


def bridged(aligned: Aligned) -> int:
    """Count the cycles in which the rig had no command of that cycle and went on by itself."""
    mode = aligned.rig["mode"]
    return int(((mode == Mode.BRIDGING) | (mode == Mode.HOLDING)).sum())


def mismatches(aligned: Aligned) -> int:
    """Count the cycles in which a force is not the one that was sent, up to the rounding of one addition.

    The command has to carry the rig's F_tr of its cycle, and F_cat = predicted force + F_cor (3.45; without F_cor while
    the rig follows another environment); the force on the catenary has to be the F_cat of the cycle before.
    """

    def differs(one: Floats, other: Floats) -> NDArray[np.bool_]:
        return ~np.isclose(one, other, rtol=1e-9, atol=1e-9)

    f_tr, f_predicted, f_cor, f_cat = (aligned.command.real(name) for name in ("f_tr", "f_predicted", "f_cor", "f_cat"))
    f_cor = np.where(aligned.command["environment"] == EnvironmentKind.CATENARY, f_cor, 0.0)
    wrong = differs(f_tr, aligned.rig.real("f_tr")) | differs(f_cat, f_predicted + f_cor)
    felt = differs(aligned.catenary.real("f_cat")[1:], f_cat[:-1]) & (np.diff(aligned.cycle) == 1)
    wrong[1:] |= felt
    return int(wrong.sum())


def solver(aligned: Aligned) -> Solver:
    """Sum up how the quadratic programs (3.56) were solved."""
    iterations = aligned.command.real("iterations")
    status = aligned.command["status"]
    return Solver(
        iterations_mean=float(iterations.mean()),
        iterations_p99=float(np.percentile(iterations, 99.0)),
        iterations_max=int(iterations.max()),
        fallbacks=int((status == SolverStatus.FALLBACK).sum()),
        status=counts(status, SolverStatus),
    )


def catenary(aligned: Aligned, used: NDArray[np.bool_]) -> Catenary:
    """Sum up slack droppers and the iterations for a consistent slack state (thesis 3.1.3)."""
    slack = aligned.catenary.real("slack_droppers")[used]
    iterations = aligned.catenary.real("iterations")[used]
    return Catenary(
        droppers=int(aligned.catenary["droppers"][used].max()),
        slack_mean=float(slack.mean()),
        slack_max=int(slack.max()),
        slack_share=float((slack > 0).mean()),
        iterations_mean=float(iterations.mean()),
        iterations_max=int(iterations.max()),
    )


def turnaround(bag: Bag) -> Mapping[str, Floats]:
    """Give each node's turnaround of all recorded cycles in s, by node."""
    found = {}
    for table in bag.of_type("CycleTiming"):
        batches = unique(last_ride(table)).entries("turnaround")
        found[_node(table.topic)] = np.concatenate(batches).astype(np.float64)
    return {node: values for node, values in found.items() if len(values)}


def timing(bag: Bag) -> list[Timing]:
    """Sum up the turnaround of each node that reported it."""
    measured = turnaround(bag)
    found = []
    for table in bag.of_type("CycleTiming"):
        node = _node(table.topic)
        values = measured.get(node)
        if values is None:
            continue
        last = {name: int(table[name][-1]) for name in COUNTED if name in table.columns}
        budget = float(table["budget"][-1])
        found.append(
            Timing(
                node=node,
                cycles=len(values),
                budget=budget,
                median=float(np.median(values)),
                p99=float(np.percentile(values, 99.0)),
                largest=float(values.max()),
                over_budget=int((values > budget).sum()),
                **last,
            )
        )
    return found


def warnings(bag: Bag, aligned: Aligned, ts: float, jumped: bool) -> tuple[list[Warned], list[str]]:
    """List what the ride's nodes said of level WARN or worse, and name the others who did.

    Texts that differ in their numbers only are one, the latest; times are of the ride, from the stamps. In a bag whose
    diagnostics are not stamped by the clock of the ride they are from the log times, unless that clock `jumped`.
    """
    ours = _ours(bag, aligned)
    at = _ride_times(bag, aligned, ts, jumped)
    found: dict[tuple[int, str, str], Warned] = {}
    others: dict[str, None] = {}
    for entry in bag.diagnostics:
        if not ours(entry):
            others[f"{entry.name} ({entry.hardware})" if entry.hardware else entry.name] = None
            continue
        key, time = (entry.level, entry.name, NUMBER.sub("#", entry.message)), at(entry)
        before = found.get(key)
        first, count = (before.first, before.count) if before else (time, 0)
        found[key] = Warned(_level(entry.level), entry.name, entry.message, count + 1, first, time)
    return list(found.values()), list(others)


def several_processes(bag: Bag, aligned: Aligned) -> list[str]:
    """Say which of the ride's nodes more than one process claimed to be on /diagnostics: a bag that was played, say."""
    found = {name: bag.speakers.get(name, set()) for name in sorted(_full_names(aligned))}
    return [
        f"{len(processes)} processes said to be {name} on /diagnostics: not all its warnings need be of this ride."
        for name, processes in found.items()
        if len(processes) > 1
    ]


def _full_names(aligned: Aligned) -> set[str]:
    topic = "/" + aligned.rig.topic.strip("/")
    prefix = topic[: -len(RIG_STATE)] if topic.endswith(f"/{RIG_STATE}") else "/"
    return {prefix + node for node in NODES}


def _ours(bag: Bag, aligned: Aligned) -> Callable[[Diagnostic], bool]:
    """Tell the ride's own nodes from all others on /diagnostics: by their full names.

    In bags of before they gave these it is the plain ones.
    """
    full = _full_names(aligned)
    known = full if full & bag.speakers.keys() else full | set(NODES)

    def ours(entry: Diagnostic) -> bool:
        name = entry.name.split(":")[0]
        return name in known and entry.hardware in ("", name)

    return ours


def _ride_times(bag: Bag, aligned: Aligned, ts: float, jumped: bool) -> Callable[[Diagnostic], float]:
    """Give the function that tells the time of the ride in s at which a status was sent; NaN where nobody knows."""
    rig, begin = aligned.rig, float(aligned.cycle[0]) * ts
    start, end = (int(at) for at in stamps(rig)[[0, -1]])
    log, time = rig.log_time, aligned.cycle * ts

    def at(entry: Diagnostic) -> float:
        if abs(entry.stamp - start) < end - start + AROUND:
            return begin + (entry.stamp - start) * 1e-9
        if jumped:
            return float("nan")
        if entry.log_time <= log[0]:
            return begin + float(entry.log_time - log[0]) * 1e-9
        return float(np.interp(entry.log_time, log, time)) + max(0.0, float(entry.log_time - log[-1]) * 1e-9)

    return at


def _node(topic: str) -> str:
    parts = topic.strip("/").split("/")
    return parts[-2] if len(parts) > 1 else parts[0]


def _name(kind: type[Named], value: int) -> str:
    return next((known.words for known in kind if known == value), f"unknown ({value})")


def _level(level: int) -> str:
    return LEVELS[level] if 0 <= level < len(LEVELS) else f"unknown ({level})"
