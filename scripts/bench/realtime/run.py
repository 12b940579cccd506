"""The bench ``realtime``: rides, one build or two in turns, and what is told of them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from bench.realtime.against import measuring, say
from bench.realtime.disturbance import VIEWERS
from bench.realtime.figures import NODES, RIG
from bench.realtime.goals import goals
from bench.realtime.options import RealtimeOptions
from bench.realtime.session import THROUGH, Build, Ridden, ride
from bench.realtime.tables import comparison, draw_late, goal_sheet, named, pooled, ride_sheet, use_sheet
from phil_study.distribution import distribution
from phil_study.outcome import Outcome


def turns(pairs: int) -> list[int]:
    """Give the order of two builds (0, 1) in turns, either one first as often as the other: 0 1 1 0 0 1 1 0 ..."""
    return [build for pair in range(pairs) for build in ((0, 1), (1, 0))[pair % 2]]


def run(options: RealtimeOptions, keep: Path | None = None) -> Outcome:
    """Ride in real time with the four nodes and the recorder; turnaround, late commands, what a cycle costs.

    What a ride left that did not go through (bag, logs) is moved to ``keep``.

    Raises
    ------
    WrongUse
        There is no such revision or parameter.
    AgainstError, DisturbanceError, MeasuringError
        There is nothing to be measured.
    KeyboardInterrupt
        Ctrl-C or a signal; nothing is left running.
    """
    with measuring(options.against) as (builds, folder):
        order = turns(options.pairs) if len(builds) > 1 else [0]
        rides = []
        for number, which in enumerate(order):
            what = f"ride {number + 1} of {len(order)}, {builds[which].label}: " if len(order) > 1 else "riding "
            say(f"{what}{options.seconds:g} s at {options.rate:g} Hz{', disturbed' if options.disturbed else ''}")
            rides.append(ride(builds[which], options, folder / f"ride-{number}"))
            if keep is not None and rides[-1].outcome != THROUGH:
                _keep(folder / f"ride-{number}", keep / f"bench-realtime-ride-{number + 1}")
    return outcome(options, builds, rides)


def outcome(options: RealtimeOptions, builds: Sequence[Build], rides: Sequence[Ridden]) -> Outcome:
    """Put all rides into tables."""
    labels = [one.label for one in builds]
    by = {label: [one for one in rides if one.build == label] for label in labels}
    pools = {label: pooled(several) for label, several in by.items()}
    samples = {
        (f"{label}, " if len(labels) > 1 else "") + named(node): times
        for label, pool in pools.items()
        for node, times in pool.items()
    }
    goal = (options.cycle_time * 1e3, "p99", "one cycle")
    rows = [
        distribution(name, times, *(goal if name.endswith(named(RIG)) else (None, "median", "")))
        for name, times in samples.items()
    ]
    held = goals([one.figures for one in by[labels[0]]], options.rate, options.disturbed)
    sheets = [ride_sheet(rides), use_sheet(rides)]
    if len(labels) > 1:
        sheet, twice = comparison(rides, *labels)
        sheets.append(sheet)
        held += twice
    if held:
        sheets.append(goal_sheet(held, f"goals, {labels[0]}"))
    late, cycles = (sum(getattr(one.figures, key) for one in by[labels[0]]) for key in ("late", "cycles"))
    title = (
        f"real time{', disturbed' if options.disturbed else ''}, {cycles} cycles of {options.cycle_time * 1e3:g} ms, "
    )
    pictures = {"late": lambda path: draw_late(rides, options.cycle_time, path)}
    return Outcome(
        f"{title}late commands: {late}", rows, notes(options, rides), sheets=sheets, samples=samples, pictures=pictures
    )


def notes(options: RealtimeOptions, rides: Sequence[Ridden]) -> list[str]:
    """Say what the figures mean and under which circumstances they came about."""
    said = [
        f"{len(os.sched_getaffinity(0))} cores, load average at the end {os.getloadavg()[0]:.2f}. By others: what was "
        "used by none of the processes of this bench. Stolen: what the host gave to other machines. Machine stood: "
        "times in which a process that comes before all others (SCHED_FIFO 90) woke up late by half a cycle or more, "
        "the longest, and the late commands in them or within 20 ms behind; these count as late like all others. "
        "Skipped: cycles that the rig left out because it did not run itself for longer than test_rig_sim.catch_up.",
    ]
    if options.parameters:
        said.append(f"ridden with {', '.join(options.parameters)}")
    if any("FIFO" not in how for one in rides for name, how in one.scheduling.items() if name in NODES):
        said.append("SCHED_FIFO was not granted to all nodes (see: ulimit -r): expect more late commands.")
    for number, one in enumerate(rides):
        if one.work is not None:
            work = one.work
            whole = "whole" if work.recorder == 0 else f"ended with code {work.recorder}: {work.recorder_said}"
            said.append(
                f"beside ride {number + 1}: {VIEWERS} viewers, {work.visits} visits, {work.messages} messages, "
                f"{work.topics} topics; parameters read {work.rounds} times, {work.parameters} of them, "
                f"{work.silent} without an answer; second recording {whole}"
            )
    return said


def _keep(ride: Path, folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.move(ride, folder)
    say(f"kept, for it did not go through: {folder}")
