"""The loop as a library and the direct coupling, each time in a fresh interpreter of a build."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from bench.realtime.goals import Goal
from bench.realtime.session import Build, MeasuringError
from bench.rides.alone import PARTS
from phil_study.outcome import Sheet

SCRIPT = Path(__file__).with_name("alone.py")
LOOP = 20.0
"""Times real time that a ride of the loop is asked for."""
COUPLING = 1.05
"""Share of the other build's time that the direct coupling may take: as much as it is, and what turns differ by."""
WORDS = 4


@dataclass(frozen=True)
class Alone:
    """One interpreter: times real time of the loop and of the coupling, s a cycle of the loop's parts (median)."""

    build: str
    loop: float
    coupling: float
    parts: Mapping[str, float]


def alone(build: Build, seconds: float) -> Alone:
    """Ride so many s in a build's environment.

    Raises
    ------
    MeasuringError
        It failed.
    """
    done = subprocess.run(
        ["python", "-c", SCRIPT.read_text(encoding="utf-8"), f"{seconds:g}"],
        cwd=build.root,
        env=dict(build.environment),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        said = "\n".join(done.stderr.strip().splitlines()[-WORDS:])
        raise MeasuringError(f"{build.label}: the loop without ROS failed:\n{said}")
    found = json.loads(done.stdout.strip().splitlines()[-1])
    return Alone(build.label, found["factor"], found["coupling"], {part: found[part] for part in PARTS})


def in_turns(builds: Sequence[Build], seconds: float, rounds: int) -> list[Alone]:
    """Ride with each build in turns; the first round, which compiles, is left out. The first build's come first."""
    found: list[Alone] = []
    for number in range(rounds + 1):
        several = [alone(build, seconds) for build in builds[:: (1, -1)[number % 2]]]
        found += several if number else []
    return by_build(found, [build.label for build in builds])


def by_build(found: Sequence[Alone], labels: Sequence[str]) -> list[Alone]:
    """Put what rode in turns into the order of the builds."""
    return sorted(found, key=lambda one: labels.index(one.build))


def library_sheet(found: Sequence[Alone]) -> Sheet:
    """Give times real time and where the time of a cycle goes, median of the rounds, a column for each build."""
    builds = list(dict.fromkeys(one.build for one in found))
    mine = {build: [one for one in found if one.build == build] for build in builds}
    rows: list[dict[str, object]] = []

    def row(what: str, values: Mapping[str, Sequence[float]]) -> None:
        one: dict[str, object] = {"what": what}
        for build, several in values.items():
            one[build] = median(several)
            one[f"{build}, range"] = f"{min(several):.4g} to {max(several):.4g}"
        rows.append(one)

    row("closed loop, times real time", {build: [one.loop for one in mine[build]] for build in builds})
    for part in PARTS:
        row(f"{part}, us a cycle", {build: [1e6 * one.parts[part] for one in mine[build]] for build in builds})
    row("direct coupling, times real time", {build: [one.coupling for one in mine[build]] for build in builds})
    heads = {"what": "without ROS"} | {
        f"{build}{more}": f"{build}{more}" for build in builds for more in ("", ", range")
    }
    return Sheet("library", "the loop as a library, and the direct coupling", heads, rows)


def library_goals(found: Sequence[Alone]) -> list[Goal]:
    """Hold the loop against real time and, with another build, the coupling against that build's."""
    builds = list(dict.fromkeys(one.build for one in found))
    loop = {build: median(one.loop for one in found if one.build == build) for build in builds}
    coupling = {build: median(one.coupling for one in found if one.build == build) for build in builds}
    new, *others = builds
    goals = [Goal(f"ride of the loop, {new} / real time", 1.0 / loop[new], 1.0 / LOOP)]
    return goals + [Goal(f"direct coupling, {new} / {old}", coupling[old] / coupling[new], COUPLING) for old in others]
