"""One ride in lockstep, as a user types it, looked at from outside."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.realtime.against import ROOT, before
from bench.realtime.child import running
from bench.realtime.session import MeasuringError
from bench.rides.options import RidesOptions
from bench.rides.processes import Look, Memory, look, memory, rides_of, used
from energy_monitor.bag import BagError, Table, read_bag

RIG_STATE = "/test_rig_sim/state"
FIELDS = {"RigState": ("cycle",)}
EVERY = 0.1
"""s between two looks at the processes."""
FIRST = 60
"""Of SCHED_FIFO, for the looks: a ride's nodes have 45 at most."""
WORDS = 8
"""Lines that are repeated of a ride that failed."""
THROUGH = "through"


@dataclass(frozen=True)
class Kind:
    """What rides: a build, with its nodes in four processes or in one."""

    build: str
    root: Path
    composed: bool = False

    @property
    def label(self) -> str:
        """Say what it is called in tables."""
        return f"{self.build}, composed" if self.composed else self.build


@dataclass(frozen=True)
class Ridden:
    """One ride; times in s."""

    kind: str
    cycles: int
    seconds: float
    """From cycle 0 to the last cycle, as the recorder got them."""
    start: float
    """From the command to cycle 0."""
    whole: float
    """From the command to its end."""
    factor: float
    """Times real time, from cycle 0 to the last cycle."""
    microseconds: Mapping[str, float]
    """Processor time in us a cycle, by process."""
    memory: Mapping[str, Memory] = field(default_factory=dict)
    """As it was last seen before the last cycle."""


class _Watch:
    """Looks at the processes of a ride while it goes on."""

    def __init__(self, command: int, memory: bool) -> None:
        self._command, self._memory = command, memory
        self._processes: dict[str, int] = {}
        self.looks: dict[str, list[Look]] = {}
        self.memory: list[tuple[int, dict[str, Memory]]] = []

    def look(self, again: bool) -> None:
        """Look at all of them; ``again``: find out as well who has come."""
        if again:
            self._processes = rides_of(self._command) | self._processes
        for name, pid in self._processes.items():
            self.looks.setdefault(name, []).append(look(pid))
        if self._memory:
            now = time.time_ns()
            seen = {name: memory(pid) for name, pid in self._processes.items()}
            self.memory.append((now, {name: one for name, one in seen.items() if one is not None}))


def ride(kind: Kind, options: RidesOptions, folder: Path, look_at_memory: bool = False) -> Ridden:
    """Ride by the build's own run script, and measure.

    Raises
    ------
    MeasuringError
        It did not go through, or its bag cannot be read.
    """
    folder.mkdir(parents=True)
    out, log = folder / "ride", folder / "ride.log"
    begun = time.time_ns()
    with _riding(kind, options, out, log) as child:
        watch, looks = _Watch(child.pid, look_at_memory), 0
        while child.poll() is None:
            with before_the_nodes():
                watch.look(again=looks % 5 == 0)
            looks += 1
            time.sleep(EVERY)
    ended = time.time_ns()
    said = log.read_text(encoding="utf-8", errors="replace")
    if child.returncode:
        raise MeasuringError(_failed(kind, f"ended with code {child.returncode}", said))
    try:
        tables = read_bag(out / "bag", fields=FIELDS).tables
        first, last, cycles = span(tables)
    except (BagError, ValueError) as error:
        raise MeasuringError(_failed(kind, str(error), said)) from None
    return Ridden(
        kind=kind.label,
        cycles=cycles,
        seconds=(last - first) * 1e-9,
        start=(first - begun) * 1e-9,
        whole=(ended - begun) * 1e-9,
        factor=options.seconds / max(1e-9, (last - first) * 1e-9),
        microseconds={name: 1e6 * used(seen, first, last) / cycles for name, seen in watch.looks.items()},
        memory=next((seen for wall, seen in reversed(watch.memory) if wall <= last), {}),
    )


@contextlib.contextmanager
def before_the_nodes() -> Iterator[None]:
    """Come before the nodes of a ride for one look, where that is allowed: else it would come when they rest."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(FIRST))
    except OSError:
        yield
        return
    try:
        yield
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def span(tables: Mapping[str, Table]) -> tuple[int, int, int]:
    """Give when the first and the last state of the rig were logged, in ns, and how many cycles these were.

    Raises
    ------
    ValueError
        There are no two of them.
    """
    if RIG_STATE not in tables or np.unique(tables[RIG_STATE]["cycle"]).size < 2:
        raise ValueError("there are no cycles in the bag")
    states = tables[RIG_STATE]
    return int(states.log_time.min()), int(states.log_time.max()), int(np.unique(states["cycle"]).size)


def knows_composed(root: Path) -> bool:
    """Tell whether a build can have its nodes in one process."""
    return (root / "scripts" / "ride" / "composed.py").exists()


def environment() -> dict[str, str]:
    """Give the environment of the shell in which a user types the command."""
    return before(os.environ, ROOT)


def _failed(kind: Kind, why: str, said: str) -> str:
    words = "\n".join(said.strip().splitlines()[-WORDS:])
    return f"a ride of {kind.label}: {why}; it said:\n{words}"


def _riding(
    kind: Kind, options: RidesOptions, out: Path, log: Path
) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    """Start the ride and see to its end."""
    command = ["bash", str(kind.root / "scripts" / "run.sh"), "--duration", f"{options.seconds:g}", "--no-report"]
    command += [*(["--composed"] if kind.composed else []), "--out", str(out)]
    return running(command, kind.root, environment(), log)
