"""How long a process takes to import its node: a fresh interpreter each time."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass

from bench.realtime.session import Build, MeasuringError

MODULES = (
    "test_rig_sim.node",
    "impedance_mpc.node",
    "catenary_model.node",
    "energy_monitor.node",
    "energy_monitor.record",
    "phil_node.topics_process",
    "ride.session",
)


@dataclass(frozen=True)
class Import:
    """One interpreter from its start to its end, in s: on the wall clock, and of processor time."""

    build: str
    module: str
    wall: float
    processor: float


def once(build: Build, module: str) -> Import:
    """Start an interpreter in a build's environment that imports one module.

    Raises
    ------
    MeasuringError
        It cannot be imported.
    """
    begun = time.perf_counter()
    child = subprocess.Popen(
        ["python", "-c", f"import {module}, os; os._exit(0)"],
        cwd=build.root,
        env=dict(build.environment),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    )
    _, status, spent = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode:
        raise MeasuringError(f"{build.label}: {module} cannot be imported")
    return Import(build.label, module, time.perf_counter() - begun, spent.ru_utime + spent.ru_stime)


def imports(builds: Sequence[Build], times: int) -> list[Import]:
    """Import each module so many times, the builds in turns; the first round, which fills the caches, is left out."""
    found: list[Import] = []
    for number in range(times + 1):
        several = [once(build, module) for module in MODULES for build in builds[:: (1, -1)[number % 2]]]
        found += several if number else []
    return found
