"""How late a thread wakes up that sleeps until a time, at 1 kHz on every CPU: the manner of cyclictest.

A process for each CPU sleeps until t_k = t_0 + k T (clock_nanosleep, CLOCK_MONOTONIC, absolute) and takes the time when
it is awake; the difference is the lateness of k. It is compiled, so that the interpreter is not what is measured. A
wake-up that comes after further periods have gone by counts for each of them, by what it was late for it: a cycle of a
ride that was slept through is a late one (cyclictest leaves those out).
"""

from __future__ import annotations

import ctypes
import mmap
import os
import signal
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phil_base.memory import lock_memory

PERIOD = 0.001
"""s."""
SLACK = 1000
"""Timer slack in ns, as the nodes ask for (real_time.timer_slack)."""
PR_SET_PDEATHSIG, PR_SET_TIMERSLACK = 1, 29
LEAD = 0.05
"""Time in s from the start of a process to its first period."""
BARS = " ▁▂▃▄▅▆▇█"
EDGES = tuple(m * 10.0**e for e in range(-6, 0) for m in (1.0, 2.0, 5.0))
"""Edges of the histogram in s, three a decade from 1 us to 0.5 s."""


@dataclass(frozen=True)
class WakeUps:
    """Lateness in s of the wake-ups of one class on one CPU, or on all of them."""

    scheduling: str
    cpu: str
    late: NDArray[np.float64]

    def figures(self) -> dict[str, float]:
        """Give median, p99, p99.9 and the largest lateness, in s."""
        median, p99, p999 = np.percentile(self.late, (50.0, 99.0, 99.9))
        return {"median": median, "p99": p99, "p99.9": p999, "max": float(self.late.max())}

    def histogram(self) -> list[int]:
        """Count by EDGES: below the first, between two of them, above the last."""
        return [int(n) for n in np.histogram(self.late, (-np.inf, *EDGES, np.inf))[0]]

    def line(self) -> str:
        """Draw the histogram as one line; heights are logarithmic, so that one of a million is seen."""
        counts = self.histogram()
        most = np.log1p(max(counts))
        return "".join(BARS[int(np.ceil(np.log1p(count) / most * (len(BARS) - 1)))] for count in counts)

    def row(self) -> dict[str, Any]:
        """Give it for the JSON file, times in s."""
        return {
            "scheduling": self.scheduling,
            "cpu": self.cpu,
            "periods": int(self.late.size),
            **self.figures(),
            "histogram_edges": list(EDGES),
            "histogram": self.histogram(),
        }


def together(parts: Iterable[WakeUps]) -> WakeUps:
    """Put the CPUs of one class together."""
    given = list(parts)
    return WakeUps(given[0].scheduling, "all", np.concatenate([part.late for part in given]))


@cache
def sleeper() -> Callable[[int, int, int, NDArray[np.int64]], None]:
    """Compile the loop: (t_0, T, periods, lateness out), all in ns."""
    from numba import njit, types

    pointer = types.intp
    sleep = types.ExternalFunction("clock_nanosleep", types.int32(types.int32, types.int32, pointer, pointer))
    read = types.ExternalFunction("clock_gettime", types.int32(types.int32, pointer))
    monotonic, absolute, second = 1, 1, 1_000_000_000

    @njit  # type: ignore[untyped-decorator]
    def sleep_and_look(start: int, period: int, periods: int, late: NDArray[np.int64]) -> None:
        until, now = np.zeros(2, np.int64), np.zeros(2, np.int64)
        k = 0
        while k < periods:
            due = start + k * period
            until[0], until[1] = due // second, due % second
            while sleep(monotonic, absolute, until.ctypes.data, 0) != 0:
                pass  # interrupted by a signal
            read(monotonic, now.ctypes.data)
            awake = now[0] * second + now[1]
            late[k] = awake - due
            k += 1
            while k < periods and start + k * period < awake:
                late[k] = awake - (start + k * period)
                k += 1

    result: Callable[[int, int, int, NDArray[np.int64]], None] = sleep_and_look
    result(time.monotonic_ns(), 1000, 2, np.zeros(2, np.int64))
    return result


def measure(
    seconds: float, priority: int, cpus: Iterable[int], progress: Callable[[float], None] = lambda share: None
) -> list[WakeUps]:
    """Measure on all CPUs at once; give the wake-ups of each.

    Args:
        seconds: length
        priority: of SCHED_FIFO, 0: ordinary class
        cpus: that this process may use
        progress: is told the share that is done, some ten times a second

    Raises:
    ------
    RuntimeError
        A process of the measurement ended before its time.
    """
    periods, places = max(1, round(seconds / PERIOD)), sorted(cpus)
    sleeper()  # before the fork: once for all
    memory = mmap.mmap(-1, 8 * periods * len(places))
    late = np.frombuffer(memory, dtype=np.int64).reshape(len(places), periods)
    late[:] = 0  # touched, so that nobody waits for a page
    begun = time.monotonic()
    children = [_fork(cpu, priority, periods, row) for cpu, row in zip(places, late, strict=True)]
    left = set(children)
    try:
        while left:
            time.sleep(0.1)
            for child in list(left):
                done, status = os.waitpid(child, os.WNOHANG)
                if done:
                    left.discard(child)
                    if status:
                        raise RuntimeError(f"a process of the measurement ended with status {status}")
            progress(min(1.0, (time.monotonic() - begun) / seconds))
    finally:
        for child in left:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
    name = f"SCHED_FIFO {priority}" if priority else "ordinary"
    return [WakeUps(name, str(cpu), row.astype(np.float64) * 1e-9) for cpu, row in zip(places, late, strict=True)]


def _fork(cpu: int, priority: int, periods: int, late: NDArray[np.int64]) -> int:
    parent = os.getpid()
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        libc = ctypes.CDLL(None)
        libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        libc.prctl(PR_SET_TIMERSLACK, ctypes.c_ulong(SLACK))
        if os.getppid() == parent:
            os.sched_setaffinity(0, {cpu})
            lock_memory()
            if priority:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
            sleeper()(time.monotonic_ns() + round(LEAD * 1e9), round(PERIOD * 1e9), periods, late)
            code = 0
    finally:
        os._exit(code)
