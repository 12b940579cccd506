"""One ride in real time by a build of this project, looked at from outside."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bench.realtime.child import running
from bench.realtime.disturbance import Disturbance, Work
from bench.realtime.figures import NODES, Measured, measured
from bench.realtime.options import RealtimeOptions, WrongUse
from bench.realtime.standstill import Standstills, Watching
from bench.realtime.usage import Load, Sample, Share, children, load, sample, scheduling, shares, within
from energy_monitor.bag import BagError, read_bag

EVERY = 0.5
"""s between two looks at the processes."""
LOOK = 0.1
LOOKS = 20
"""Looks from the start in which processes for topics are looked for."""
BEGUN_BYTES = 1_000_000
"""Size of a bag that has cycles in it; before them it holds definitions and a few diagnostics."""
START_SECONDS = 300.0
"""A build that was never used compiles its kernels first."""
RECORDER = "recorder"
TOPICS, OF_TOPICS = "phil_node.topics_process", "its topics"
FIELDS = {
    "RigState": ("header.stamp.sec", "header.stamp.nanosec", "cycle", "mode", "late_commands"),
    "CycleTiming": ("cycle", "turnaround"),
}
WRONG, WORDS = 2, 8
"""Exit code of a ride whose parameters are wrong; lines that are repeated of one that failed."""
FAILED = "the ride failed: "
THROUGH = "through"
FOREVER = (0, 2**63 - 1)


class MeasuringError(Exception):
    """There is nothing to be measured: the ride did not come to its first cycle."""


@dataclass(frozen=True)
class Build:
    """A checkout with its environment, and what it is called."""

    label: str
    root: Path
    environment: Mapping[str, str]


@dataclass(frozen=True)
class Ridden:
    """One ride, measured."""

    build: str
    figures: Measured
    outcome: str
    """"through", "retracted after N cycles: reason", or why else it ended early."""
    shares: Mapping[str, Share]
    load: Load | None
    scheduling: Mapping[str, str]
    work: Work | None
    standstills: Standstills
    """Times in which the machine itself stood still."""


class _Watch:
    """Looks at the processes of a ride while it goes on."""

    def __init__(self, child: subprocess.Popen[bytes]) -> None:
        self._child = child
        self._processes: dict[str, int] = {}
        self._due = 0.0
        self.own = [os.getpid(), child.pid]
        self.samples: list[Sample] = []
        self.scheduling: dict[str, str] = {}
        self.end = FOREVER[1]

    def going(self) -> bool:
        """Look if it is time to; tell whether the ride goes on, and the time to be measured."""
        if self._child.poll() is not None or time.time_ns() >= self.end:
            return False
        if time.monotonic() >= self._due:
            self._due = time.monotonic() + EVERY
            self._look()
        return True

    def _look(self) -> None:
        if len(self._processes) < len(NODES) + 1:
            self._processes = processes(children(self._child.pid))
            return
        # They come one after the other, and an older build has none.
        if len(self._processes) < 2 * len(NODES) + 1 and len(self.samples) < LOOKS:
            self._processes |= topics_of({name: pid for name, pid in self._processes.items() if name in NODES})
        self.samples.append(sample(self._processes, self.own))
        # The ride asks for it before the first cycle; what is seen last counts, so it is not looked at often.
        if len(self.samples) % 10 == 0:
            seen = {name: scheduling(pid) for name, pid in self._processes.items()}
            self.scheduling = self.scheduling | {name: how for name, how in seen.items() if how}


def ride(build: Build, options: RealtimeOptions, folder: Path) -> Ridden:
    """Ride and measure; a ride that ends by a retract is a result.

    Raises
    ------
    WrongUse
        A parameter is wrong.
    MeasuringError
        It did not come to a first cycle, or its bag cannot be read.
    DisturbanceError
        What was to disturb it did not come up.
    """
    folder.mkdir(parents=True)
    out, begin = folder / "ride", FOREVER[0]
    with contextlib.ExitStack() as stack:
        watching = stack.enter_context(Watching(options.cycle_time, os.environ))
        child = stack.enter_context(_riding(build, options, out, folder / "ride.log"))
        watch, disturbance = _Watch(child), None
        watch.own += watching.pids
        if options.disturbed and _cycles_came(out, watch):
            disturbance = stack.enter_context(Disturbance(folder / "beside", build.environment))
            begin = time.time_ns()
            disturbance.begin(watch.going)
            watch.own += disturbance.pids
            watch.end = time.time_ns() + round(options.seconds * 1e9)
        while watch.going():
            time.sleep(LOOK)
    said = (folder / "ride.log").read_text(encoding="utf-8", errors="replace")
    try:
        figures = _figures(out / "bag", begin, watch.end)
    except (BagError, ValueError) as error:
        if child.returncode == WRONG:
            raise WrongUse(said.strip()) from None
        words = "\n".join(said.strip().splitlines()[-WORDS:])
        raise MeasuringError(f"{error}; the ride said:\n{words}") from None
    seen = within(watch.samples, figures.begin, figures.end)
    return Ridden(
        build=build.label,
        figures=figures,
        outcome=outcome(figures, child.returncode, options.disturbed, said),
        shares=shares(*seen, options.cycle_time) if seen else {},
        load=load(*seen) if seen else None,
        scheduling=watch.scheduling,
        work=disturbance.work() if disturbance else None,
        standstills=watching.found().within(figures.begin, figures.end),
    )


def _figures(bag: Path, begin: int, end: int) -> Measured:
    """Measure from ``begin`` on; all of a ride that had ended before that."""
    tables = read_bag(bag, fields=FIELDS).tables
    try:
        return measured(tables, begin, end)
    except ValueError:
        return measured(tables, *FOREVER)


def outcome(figures: Measured, code: int | None, interrupted: bool, said: str) -> str:
    """Say how a ride ended, from its exit code and what it printed."""
    reason = next((line.removeprefix(FAILED) for line in said.splitlines() if line.startswith(FAILED)), "")
    if figures.retracted:
        return f"retracted after {figures.first + figures.cycles} cycles: {reason or 'no reason given'}"
    if code in ((0, 130) if interrupted else (0,)):
        return THROUGH
    return reason or f"ended with code {code}"


def _riding(
    build: Build, options: RealtimeOptions, out: Path, log: Path
) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    """Start the ride and see to its end."""
    duration = "0" if options.disturbed else f"{options.seconds:g}"
    command = ["python", "-m", "ride.child", str(os.getpid()), "ride", "--mode", "realtime", "--duration", duration]
    for node in NODES:
        command += ["--set", f"{node}.cycle_time={options.cycle_time:.9g}"]
    for parameter in options.parameters:
        command += ["--set", parameter]
    command += ["--no-report", "--out", str(out)]
    return running(command, build.root, build.environment, log)


def _cycles_came(out: Path, watch: _Watch) -> bool:
    """Wait for the first cycles; a rig that waits for listeners begins only when they stay."""
    deadline = time.monotonic() + START_SECONDS
    while watch.going() and time.monotonic() < deadline:
        if sum(file.stat().st_size for file in (out / "bag").glob("*.mcap")) > BEGUN_BYTES:
            return True
        time.sleep(LOOK)
    return False


def topics_of(nodes: Mapping[str, int]) -> dict[str, int]:
    """Find the processes that speak on the nodes' topics, where a build has such."""
    found = {}
    for name, pid in nodes.items():
        for child, line in children(pid).items():
            if TOPICS in line:
                found[f"{name}, {OF_TOPICS}"] = child
    return found


def processes(found: Mapping[int, list[str]]) -> dict[str, int]:
    """Tell nodes and recorder among the children of a ride by their command lines."""
    wanted = {f"{node}.node": node for node in NODES} | {"energy_monitor.record": RECORDER}
    return {wanted[word]: pid for pid, line in found.items() for word in line if word in wanted}
