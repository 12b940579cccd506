"""The bench ``rides``: rides in lockstep, of one build or of two in turns, and what is told of them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np

from bench.realtime.against import measuring, say
from bench.rides.importing import Import, imports
from bench.rides.library import Alone, in_turns, library_goals, library_sheet
from bench.rides.options import RidesOptions
from bench.rides.processes import Memory
from bench.rides.session import Kind, Ridden, knows_composed, ride
from bench.rides.tables import comparison, figure_sheet, goal_sheet, import_sheet, memory_sheet, ride_sheet, use_sheet
from phil_study.distribution import distribution
from phil_study.outcome import Outcome

IMPORTS, QUICK_IMPORTS = 5, 1


def order(kinds: int, rounds: int) -> list[int]:
    """Give the kinds of rides in turns, forwards and backwards: 0 1 2 2 1 0 0 1 2 ..."""
    there = list(range(kinds))
    return [kind for number in range(rounds) for kind in there[:: (1, -1)[number % 2]]]


def run(options: RidesOptions, quick: bool = False) -> Outcome:
    """Ride in lockstep with nodes and recorder, and without ROS; speed, start, processor time, memory, imports.

    Raises
    ------
    WrongUse
        There is no such revision.
    AgainstError, MeasuringError
        There is nothing to be measured.
    KeyboardInterrupt
        Ctrl-C or a signal; nothing is left running.
    """
    with measuring(options.against) as (builds, folder):
        kinds = [Kind(one.label, one.root) for one in builds]
        if options.composed and knows_composed(builds[0].root):
            kinds.insert(1, Kind(builds[0].label, builds[0].root, composed=True))
        seen: dict[str, Mapping[str, Memory]] = {}
        for kind in kinds:
            say(f"riding twice to warm up, {kind.label}: {options.seconds:g} s")
            ride(kind, options, folder / f"warm-{len(seen)}-1")
            seen[kind.label] = ride(kind, options, folder / f"warm-{len(seen)}-2", look_at_memory=True).memory
        rides = []
        turns = order(len(kinds), options.rounds)
        for number, which in enumerate(turns):
            say(f"ride {number + 1} of {len(turns)}, {kinds[which].label}: {options.seconds:g} s")
            rides.append(ride(kinds[which], options, folder / f"ride-{number}"))
        say("importing")
        found = imports(builds, QUICK_IMPORTS if quick else IMPORTS)
        say("riding without ROS")
        loops = in_turns(builds, options.seconds, options.rounds)
    return outcome(options, kinds, rides, seen, found, loops)


def outcome(
    options: RidesOptions,
    kinds: Sequence[Kind],
    rides: Sequence[Ridden],
    seen: Mapping[str, Mapping[str, Memory]],
    found: Sequence[Import],
    loops: Sequence[Alone],
) -> Outcome:
    """Put all rides into tables."""
    samples = {
        f"{kind.label}: {what}": np.array([getattr(one, key) for one in rides if one.kind == kind.label])
        for kind in kinds
        for key, what in (("seconds", "cycle 0 to last cycle"), ("start", "command to cycle 0"))
    }
    rows = [distribution(name, times) for name, times in samples.items()]
    sheets = [ride_sheet(rides), figure_sheet(rides), use_sheet(rides), memory_sheet(seen), import_sheet(found)]
    sheets.append(library_sheet(loops))
    goals = library_goals(loops)
    if options.against is not None:
        old = kinds[-1]
        sheet, compared = comparison(rides, kinds[:-1], old)
        sheets.append(sheet)
        goals = compared + goals
    sheets.append(goal_sheet(goals))
    title = f"rides of {options.seconds:g} s in lockstep, with a recording, {options.rounds} rounds"
    return Outcome(title, rows, notes(options, kinds), sheets=sheets, samples=samples)


def notes(options: RidesOptions, kinds: Sequence[Kind]) -> list[str]:
    """Say what the figures mean and under which circumstances they came about."""
    said = [
        f"{len(os.sched_getaffinity(0))} cores, load average at the end {os.getloadavg()[0]:.2f}. A ride is what "
        "scripts/run.sh does with the defaults, warm; its cycles are timed as the recorder gets them. Processor time "
        "is read ten times a second and belongs to the time from cycle 0 to the last cycle; memory was read in a ride "
        "that does not count for the times."
    ]
    if options.composed and not any(kind.composed for kind in kinds):
        said.append("this build cannot have its nodes in one process: --composed was left out")
    return said
