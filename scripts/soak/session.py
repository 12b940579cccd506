"""A long ride with recording and viewers, sampled once a second from outside."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bench.realtime.child import running
from bench.realtime.disturbance import OUTSIDE, Work, plain, work_of
from bench.realtime.session import BEGUN_BYTES, START_SECONDS, processes, topics_of
from bench.realtime.tables import PROCESSES
from bench.realtime.usage import children
from phil_node.shared_memory import litter, remove_litter, snapshot
from soak.looks import Sample, sample
from soak.options import Options

EVERY = 1.0
"""s between two looks at the processes."""
CLOSELY = 10
"""Every so many looks one that costs the processes more."""
SAID = 10.0
"""s between two lines of progress."""
STAYS = (20.0, 27.0)
"""s for which a viewer stays before it leaves and comes again, by its number."""
LATE_SECONDS = 120.0
"""A ride in real time that has not ended so long after its time is ended."""
WORDS = 8
MIB = 1024.0


class SoakError(Exception):
    """There is nothing to be judged: the ride did not come to its first cycle."""


@dataclass(frozen=True)
class Soaked:
    """What was seen of a ride: its samples, exit code, last words, what viewers read, what stayed in /dev/shm."""

    samples: list[Sample]
    code: int | None
    said: str
    work: Work | None
    left: list[str]


def soak(options: Options, say: Callable[[str], None]) -> Soaked:
    """Ride to the end; ``say`` takes lines of progress.

    Raises
    ------
    SoakError
        It did not come to a first cycle.
    """
    before = snapshot()
    ride, samples, begun = options.out / "ride", list[Sample](), options.out / "begun"
    begun.unlink(missing_ok=True)
    log = options.out / "ride.log"
    viewers: list[subprocess.Popen[bytes]] = []
    with contextlib.ExitStack() as stack:
        child = stack.enter_context(_child(_ride_command(options, ride), log, _environment(options)))
        for number in range(options.viewers):
            # They load what they need now, and join with the first cycles: in lockstep half a minute is over in 3 s.
            command = [sys.executable, str(OUTSIDE), str(os.getpid()), "view", str(number)]
            command += [f"{STAYS[number % len(STAYS)]:g}", str(begun)]
            viewers.append(stack.enter_context(_child(command, _viewer_log(options, number), plain(os.environ))))
        _wait_for_cycles(child, ride, log)
        begun.touch()
        found = _processes(child.pid)
        began = due = told = time.monotonic()
        while child.poll() is None:
            if len(found) < len(PROCESSES):
                found = _processes(child.pid)
            samples.append(sample(found, logs(options), closely=len(samples) % CLOSELY == 0))
            now = time.monotonic()
            if now - told >= SAID:
                told = now
                say(_progress(options, now - began, samples[-1]))
            if options.mode == "realtime" and now - began > options.seconds + LATE_SECONDS:
                break
            due = max(due + EVERY, now)
            _sleep_until(due, child)
        left = _left(samples, before)  # viewers that still hold what was the ride's would leave it themselves
    remove_litter(before)
    texts = [
        _viewer_log(options, number).read_text(encoding="utf-8", errors="replace") for number in range(len(viewers))
    ]
    return Soaked(
        samples=samples,
        code=child.returncode,
        said=log.read_text(encoding="utf-8", errors="replace"),
        work=work_of(texts, "", None) if viewers else None,
        left=left,
    )


def _processes(ride: int) -> dict[str, int]:
    """Find nodes, recorder and the processes that speak on the nodes' topics."""
    found = processes(children(ride))
    return found | topics_of(found)


def logs(options: Options) -> tuple[Path, Path]:
    """Give the folders of the ride's logs: of the nodes' output, and of ROS."""
    return options.out / "ride" / "logs", options.out / "ros-logs"


def _left(samples: list[Sample], before: frozenset[str]) -> list[str]:
    """Name what the ride's processes used of /dev/shm, was not there before, and is held by nobody now."""
    used = frozenset(name for one in samples for deep in one.deep.values() for name in deep.segments)
    return [name for name in litter(before) if name in used]


def _viewer_log(options: Options, number: int) -> Path:
    return options.out / f"viewer-{number}.log"


def _environment(options: Options) -> dict[str, str]:
    return {**os.environ, "ROS_LOG_DIR": str(logs(options)[1])}


def _ride_command(options: Options, ride: Path) -> list[str]:
    command = [sys.executable, "-m", "ride.child", str(os.getpid()), "ride", "--mode", options.mode]
    command += ["--duration", f"{options.seconds:.9g}", "--no-report", "--out", str(ride)]
    for node in ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor"):
        command += ["--set", f"{node}.cycle_time={options.cycle_time:.9g}"]
    for parameter in options.parameters:
        command += ["--set", parameter]
    return command


def _child(
    command: list[str], log: Path, environment: dict[str, str]
) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    """Start a process and see to its end; one of a viewer or a busy loop does not hear Ctrl-C."""
    ask = signal.SIGTERM if str(OUTSIDE) in command else signal.SIGINT
    return running(command, Path.cwd(), environment, log, ask)


def _wait_for_cycles(child: subprocess.Popen[bytes], ride: Path, log: Path) -> None:
    """Wait for the first cycles: a rig that waits for its listeners is not to count viewers among them."""
    deadline = time.monotonic() + START_SECONDS
    while sum(file.stat().st_size for file in (ride / "bag").glob("*.mcap")) < BEGUN_BYTES:
        if child.poll() is not None or time.monotonic() > deadline:
            said = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
            raise SoakError("the ride did not come to its first cycles:\n" + "\n".join(said[-WORDS:]))
        time.sleep(0.1)


def _sleep_until(due: float, child: subprocess.Popen[bytes]) -> None:
    while child.poll() is None and (rest := due - time.monotonic()) > 0.0:
        time.sleep(min(rest, 0.2))


def _progress(options: Options, ridden: float, last: Sample) -> str:
    memory = ", ".join(f"{name} {one.resident / MIB:.1f}" for name, one in last.looks.items())
    left = max(0.0, options.seconds - ridden)
    when = f"{ridden:6.0f} s" + (f", {left:.0f} s left" if options.mode == "realtime" else "")
    return f"{when}   resident MiB: {memory}"
