"""The examination from start to end: look, measure, judge."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from doctor import kernel, limits, processor, transport
from doctor.cyclictest import cyclictest, installed
from doctor.domain import discovery, environment, participants
from doctor.finding import CHANGE, OK, Finding, Machine, looked
from doctor.verdict import judged
from doctor.wake_up import WakeUps, measure, together
from phil_base.scheduling import CYCLE, highest_priority, why_not_first

OURS, THEIRS = "doctor", "cyclictest"
MATTERS = (
    "kernel",
    "time for SCHED_FIFO",
    "timer resolution",
    "governor",
    "idle states",
    "virtualisation",
    "processor quota",
    "other real-time processes",
    "stolen time",
    "free cores",
)
"""Findings that make wake-ups late."""


@dataclass
class Examined:
    """All that was found and measured."""

    seconds: float
    findings: list[Finding] = field(default_factory=list)
    wake_ups: list[tuple[str, WakeUps]] = field(default_factory=list)

    def document(self) -> dict[str, Any]:
        """Give it for the JSON file; times in s."""
        return {
            "name": "doctor",
            "machine": platform.machine(),
            "python": platform.python_version(),
            "seconds": self.seconds,
            "good": not any(found.verdict == CHANGE for found in self.findings),
            "findings": [found.row() for found in self.findings],
            "wake_ups": [{"measured_by": who, **row.row()} for who, row in self.wake_ups],
        }


def examine(seconds: float, bags: Path, progress: Console, machine: Machine | None = None) -> Examined:
    """Look at the machine and measure for ``seconds`` in each class; ``bags`` is the folder that rides go to."""
    machine = machine or Machine()
    examined = Examined(seconds)
    found = examined.findings
    found += looked((*kernel.LOOKS, *limits.LOOKS, *processor.LOOKS, *transport.LOOKS), machine)
    found += looked([lambda m: transport.disk(m, bags)], machine)
    found += environment(os.environ)
    found.append(discovery(os.environ))
    priority = min(CYCLE, highest_priority())
    before = processor.Spent.now(machine)
    measured = [(parts, level == priority) for level, parts in _measured(examined, priority, progress)]
    check = list(_checked(examined, priority, progress))
    shares = processor.Spent.now(machine).shares_since(before)
    found += processor.spent(machine, shares, may_go_first=priority > 0)
    advice = _advice(found, priority)
    found += [judged(parts, counts, advice) for parts, counts in measured]
    found += check
    if not any(line.name == "ROS environment" and line.verdict == CHANGE for line in found):
        found += _neighbours()
    return examined


def _neighbours() -> list[Finding]:
    try:
        return list(participants())
    except Exception as error:  # of rclpy's own kind: the middleware cannot start, and a ride could not either
        lines = str(error).splitlines() or [type(error).__name__]
        why = f"ROS cannot start: {lines[0]}"
        return [Finding("other nodes on the domain", "unknown", CHANGE, why, "mend that first, then look again")]


def _advice(found: list[Finding], priority: int) -> str:
    """Say what makes wake-ups late here, by the names of what was found."""
    if not priority:
        return why_not_first()
    named = [line.name for line in found if line.name in MATTERS and line.verdict != OK]
    if named:
        return f"what is said of {', '.join(named)}; then look again"
    return (
        "end what else runs here (top -o %CPU); look for the firmware's own work: sudo hwlatdetect (package rt-tests)"
    )


def _measured(examined: Examined, priority: int, progress: Console) -> Iterator[tuple[int, list[WakeUps]]]:
    """Measure as granted, and in the ordinary class."""
    for level in (priority, 0) if priority else (0,):
        what = f"SCHED_FIFO {level}" if level else "ordinary"
        try:
            with _shown(progress, f"wake-ups, {what}") as tell:
                parts = measure(examined.seconds, level, os.sched_getaffinity(0), tell)
        except (OSError, RuntimeError) as error:
            why, do = f"{error}: out of processes or memory, or not on all CPUs", "look again on a machine at rest"
            examined.findings.append(Finding(f"wake-up, {what}", "not measured", CHANGE, why, do))
            continue
        examined.wake_ups += [(OURS, part) for part in (*parts, *([together(parts)] if len(parts) > 1 else []))]
        yield level, parts


def _checked(examined: Examined, priority: int, progress: Console) -> Iterator[Finding]:
    """Let cyclictest do the first measurement once more."""
    if not installed():
        yield Finding("cross check", "no cyclictest here", OK, "for a second opinion: sudo apt-get install rt-tests")
        return
    try:
        with _shown(progress, "wake-ups, by cyclictest"):
            theirs = cyclictest(examined.seconds, priority, os.sched_getaffinity(0))
    except (OSError, RuntimeError, ValueError, subprocess.TimeoutExpired) as error:
        yield Finding("cross check", "cyclictest failed", OK, str(error))
        return
    examined.wake_ups += [(THEIRS, part) for part in theirs]
    largest = max(part.figures()["max"] for part in theirs)
    p999 = max(part.figures()["p99.9"] for part in theirs)
    yield Finding("cross check", f"cyclictest: p99.9 {p999 * 1e3:.3f} ms, largest {largest * 1e3:.3f} ms")


@contextmanager
def _shown(console: Console, what: str) -> Iterator[Callable[[float], None]]:
    """Show how far a measurement is, without a thread of the display's: the processes are forked from this one."""
    if not console.is_terminal:
        console.print(f"{what} ...", highlight=False)
        yield lambda share: None
        return
    with Progress(console=console, auto_refresh=False, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        bar.refresh()

        def tell(share: float) -> None:
            bar.update(task, completed=share)
            bar.refresh()

        yield tell
