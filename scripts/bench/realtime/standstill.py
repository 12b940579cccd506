"""When the machine itself stands still: who comes first on a CPU and sleeps for a cycle, wakes late.

A virtual machine that its host does not run, firmware that takes a core away, a driver with interrupts off: no program
can be in time then. A process for each CPU, before all others (SCHED_FIFO) where that is allowed, notes such times
beside a ride, so that it can be said which late commands are no fault of the loop. They count as late all the same.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

PRIORITY = 90
SHARE = 0.5
"""Share of a cycle by which a wake-up has to be late, to be noted."""
AFTER = 20_000_000
"""Time in ns behind a standstill in which a state was logged that it made late: the recorder takes them in batches."""


@dataclass(frozen=True)
class Standstills:
    """Begin and end in ns of the wall clock of each time in which a CPU stood still."""

    begin: NDArray[np.int64]
    end: NDArray[np.int64]

    def within(self, begin: int, end: int) -> Standstills:
        """Give those that have something in common with a time."""
        kept = (self.end >= begin) & (self.begin <= end)
        return Standstills(self.begin[kept], self.end[kept])

    @property
    def longest(self) -> float:
        """Give the longest in s."""
        return float((self.end - self.begin).max(initial=0)) * 1e-9

    def hit(self, times: NDArray[np.int64]) -> int:
        """Count the times, in ns, that lie in a standstill or shortly behind."""
        if not self.begin.size:
            return 0
        inside = (times[:, None] >= self.begin[None, :]) & (times[:, None] <= self.end[None, :] + AFTER)
        return int(inside.any(axis=1).sum())


def read(lines: Sequence[str]) -> Standstills:
    """Read what the watching processes wrote: begin and length in ns, one line each."""
    rows = [words for words in (line.split() for line in lines) if len(words) == 2 and all(map(str.isdigit, words))]
    numbers = [[int(word) for word in words] for words in rows]
    found = np.array(sorted(numbers), np.int64).reshape(-1, 2)
    return Standstills(found[:, 0], found[:, 0] + found[:, 1])


class Watching:
    """The watching processes, one for each CPU; to be used by `with`."""

    def __init__(self, cycle_time: float, environment: Mapping[str, str]) -> None:
        self._period, self._environment = cycle_time, environment
        self._children: list[subprocess.Popen[str]] = []
        self._lines: list[str] = []

    def __enter__(self) -> Watching:
        for cpu in sorted(os.sched_getaffinity(0)):
            command = [sys.executable, "-m", "bench.realtime.standstill", str(cpu), f"{self._period:.9g}"]
            self._children.append(
                subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, env=dict(self._environment)
                )
            )
        return self

    def __exit__(self, *reason: object) -> None:
        for child in self._children:
            child.terminate()
        for child in self._children:
            self._lines += child.communicate()[0].splitlines()

    @property
    def pids(self) -> list[int]:
        """Give the process numbers."""
        return [child.pid for child in self._children]

    def found(self) -> Standstills:
        """Give what was seen; after the end."""
        return read(self._lines)


def watch(cpu: int, period: int) -> None:
    """Sleep for ``period`` ns again and again, and print each wake-up that is late, until SIGTERM."""
    os.sched_setaffinity(0, {cpu})
    for priority in (PRIORITY, 1):
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            break
    gc.disable()
    kept: list[tuple[int, int]] = []

    def end(number: int, frame: object) -> None:
        for begin, length in kept:
            print(begin, length)
        sys.stdout.flush()
        os._exit(0)

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the ride
    least, due = round(SHARE * period), time.monotonic_ns() + period
    while True:
        time.sleep(max(0, due - time.monotonic_ns()) * 1e-9)
        late = time.monotonic_ns() - due
        if late >= least:
            kept.append((time.time_ns() - late, late))
        due += period * (1 + late // period)


if __name__ == "__main__":
    watch(int(sys.argv[1]), round(float(sys.argv[2]) * 1e9))
