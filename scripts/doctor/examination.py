"""The examination from start to end: look, measure, judge."""

from __future__ import annotations

import os
import platform
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
from doctor.finding import CHANGE, NOTE, OK, Finding, Machine, looked
from doctor.verdict import judged
from doctor.wake_up import WakeUps, measure, together
from phil_node.scheduling import CYCLE, highest_priority, why_not_first

OURS, THEIRS = "doctor", "cyclictest"
TUNE = (
    "change what the lines above say of kernel, governor, idle states, processor quota and stolen time; end what else "
    "runs here (top -o %CPU), then look again"
)


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
    found += _measured(examined, priority, progress)
    shares = processor.Spent.now(machine).shares_since(before)
    found += processor.spent(machine, shares, may_go_first=priority > 0)
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


def _measured(examined: Examined, priority: int, progress: Console) -> Iterator[Finding]:
    """Measure as granted and in the ordinary class, and let cyclictest do the first once more."""
    cpus, seconds = os.sched_getaffinity(0), examined.seconds
    for level in (priority, 0) if priority else (0,):
        what = f"SCHED_FIFO {level}" if level else "ordinary"
        with _shown(progress, f"wake-ups, {what}") as tell:
            parts = measure(seconds, level, cpus, tell)
        examined.wake_ups += [(OURS, part) for part in (*parts, *([together(parts)] if len(parts) > 1 else []))]
        counts = level == priority
        yield judged(parts, counts, TUNE if level else why_not_first())
    if not installed():
        yield Finding("cross check", "no cyclictest here", OK, "for a second opinion: sudo apt-get install rt-tests")
        return
    try:
        with _shown(progress, "wake-ups, by cyclictest"):
            theirs = cyclictest(seconds, priority, cpus)
    except (OSError, RuntimeError, ValueError) as error:
        yield Finding("cross check", "cyclictest failed", NOTE, str(error))
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
