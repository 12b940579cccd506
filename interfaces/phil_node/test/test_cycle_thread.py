"""The timers of the cycle's thread."""

from __future__ import annotations

import threading
import time

import pytest

pytest.importorskip("rclpy")
from phil_node.cycle_thread import CycleThread, CycleTimer

PERIOD = 0.05


class Clockwork:
    """A thread with one timer, and what it called."""

    def __init__(self) -> None:
        self.errors: list[BaseException] = []
        self.dues: list[float] = []
        self.thread = CycleThread(threading.RLock(), self.errors.append, lambda: None)
        self.timer = self.thread.timer(PERIOD, self.call)
        self.plan: dict[int, tuple[str, float]] = {}
        """What the n-th call asks for: a method of the timer, and how much later than now."""

    def call(self) -> None:
        self.dues.append(time.monotonic())
        method, later = self.plan.get(len(self.dues), ("", 0.0))
        if method:
            getattr(self.timer, method)(self.dues[-1] + later)

    def run(self, calls: int) -> list[float]:
        self.thread.start()
        self.timer.reset()
        end = time.monotonic() + 5.0
        while len(self.dues) < calls and time.monotonic() < end:
            time.sleep(0.005)
        self.thread.stop()
        assert not self.errors
        return self.dues[:calls]


def test_a_call_in_between_leaves_the_others_on_their_grid() -> None:
    clockwork = Clockwork()
    clockwork.plan[2] = ("also", 0.4 * PERIOD)
    dues = clockwork.run(5)
    grid = [dues[0] + k * PERIOD for k in range(4)]
    # Nothing is earlier than asked for; how much later is the machine's business.
    for due, asked in zip(dues, [grid[0], grid[1], dues[1] + 0.4 * PERIOD, grid[2], grid[3]], strict=True):
        assert due >= asked - 0.3 * PERIOD
    assert dues[2] - dues[1] >= 0.4 * PERIOD


def test_a_call_after_the_next_one_is_no_call_in_between() -> None:
    timer = CycleTimer(CycleThread(threading.RLock(), print, lambda: None), PERIOD, lambda: None)
    timer.also(1.0)
    assert timer.due == float("inf")  # it stands still
    timer.reset()
    before = timer.due
    timer.also(before + 1.0)
    assert timer.due == before


def test_once_is_once() -> None:
    clockwork = Clockwork()
    clockwork.plan[1] = ("once", 0.2 * PERIOD)
    dues = clockwork.run(2)
    assert dues[1] - dues[0] >= 0.2 * PERIOD
    assert clockwork.timer.due == float("inf")
    assert len(clockwork.dues) == 2
