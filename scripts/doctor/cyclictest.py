"""The same measurement by cyclictest (package rt-tests), where it is installed: a cross check of our own."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterable

import numpy as np

from doctor.wake_up import PERIOD, WakeUps
from phil_base.scheduling import cpus_in_words

LARGEST = 100_000
"""us, the histogram's end; what is beyond goes by the largest one seen."""


def installed() -> bool:
    """Tell whether there is a cyclictest."""
    return shutil.which("cyclictest") is not None


def cyclictest(seconds: float, priority: int, cpus: Iterable[int]) -> list[WakeUps]:
    """Run it with the period, class and CPUs of our own measurement, and no tuning of the system by it.

    Raises
    ------
    RuntimeError
        It failed; the text is its own.
    """
    places = sorted(cpus)
    policy = ["--policy=fifo", f"-p{priority}"] if priority else ["--policy=other"]
    command = ["cyclictest", "-q", "-m", "--default-system", *policy, f"-t{len(places)}", f"-a{cpus_in_words(places)}"]
    command += [f"-i{round(PERIOD * 1e6)}", "-d0", f"-D{max(1, round(seconds))}", f"-h{LARGEST}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + 30.0)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines()
        raise RuntimeError(lines[-1] if lines else f"cyclictest ended with code {done.returncode}")
    return parsed(done.stdout, places, f"SCHED_FIFO {priority}" if priority else "ordinary")


def parsed(text: str, places: list[int], name: str) -> list[WakeUps]:
    """Read the histogram: a line for each microsecond, a column for each CPU. Raises ValueError."""
    rows = [line.split() for line in text.splitlines() if re.match(r"\d+\s+\d", line)]
    largest = [int(word) for word in _after(text, "# Max Latencies:")]
    if not len(largest) == len(_after(text, "# Histogram Overflows:")) == len(places):
        raise ValueError(f"cyclictest has not measured on {len(places)} CPUs")
    found = []
    for column, place in enumerate(places):
        counts = np.array([int(row[1 + column]) for row in rows])
        late = np.repeat(np.array([int(row[0]) for row in rows], dtype=np.float64), counts)
        beyond = int(_after(text, "# Histogram Overflows:")[column])
        found.append(WakeUps(name, str(place), np.append(late, [float(largest[column])] * beyond) * 1e-6))
    return found


def _after(text: str, head: str) -> list[str]:
    for line in text.splitlines():
        if line.startswith(head):
            return line.removeprefix(head).split()
    raise ValueError(f"cyclictest has written no line '{head}': another version?")
