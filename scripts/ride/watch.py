"""What the run script sees of a ride while it goes on: a few decimated topics, and a line of progress."""

from __future__ import annotations

import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from phil_interfaces.msg import ConservedQuantities, ContactQuality, CycleTiming
from rclpy.node import Node
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from phil_node.qos import CYCLE

RIG, LANDED = "test_rig_sim", "stopped: landed"
"""Node and beginning of its message after a soft landing, with which a ride ends before or after its duration."""


class Watch:
    """Latest figures of the running ride; ``started`` and ``moved`` are on the monotonic clock in s."""

    def __init__(self, node: Node, cycle_time: float) -> None:
        self.quality: Any = None
        self.books: Any = None
        self.rig_timing: Any = None
        self.errors: dict[str, str] = {}
        self.warnings: dict[str, str] = {}
        self.landed = False
        self.cycle = -1
        self.moved = time.monotonic()
        self.started: float | None = None
        self._cycle_time = cycle_time
        node.create_subscription(ContactQuality, "energy_monitor/contact_quality", self._take_quality, CYCLE)
        node.create_subscription(ConservedQuantities, "energy_monitor/conserved_quantities", self._take_books, CYCLE)
        node.create_subscription(CycleTiming, "test_rig_sim/timing", self._take_timing, CYCLE)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, 10)

    @property
    def ridden(self) -> float:
        """Give the simulated time in s that the ride has come to."""
        return (self.cycle + 1) * self._cycle_time

    def through(self, last: int | None) -> bool:
        """Tell whether cycle ``last`` was ridden, answered and booked by the monitor; never for an endless ride."""
        if last is None or self.rig_timing is None or self.books is None:
            return False
        return bool(self.rig_timing.cycle >= last and self.books.cycle >= last)

    def _move_to(self, cycle: int) -> None:
        if cycle > self.cycle:
            self.cycle = cycle
            self.moved = time.monotonic()
            if self.started is None:
                self.started = self.moved

    def _take_quality(self, message: Any) -> None:
        self.quality = message
        self._move_to(message.cycle)

    def _take_books(self, message: Any) -> None:
        self.books = message
        self._move_to(message.cycle)

    def _take_timing(self, message: Any) -> None:
        self.rig_timing = message
        self._move_to(message.cycle)

    def _take_diagnostics(self, message: Any) -> None:
        for status in message.status:
            self.landed = self.landed or (status.hardware_id == RIG and status.message.startswith(LANDED))
            if status.level == DiagnosticStatus.ERROR:
                self.errors[status.hardware_id] = status.message
            elif status.level == DiagnosticStatus.WARN:
                self.warnings[status.hardware_id] = status.message


class Display:
    """Progress on the terminal: a live bar, or one line every two seconds where there is no terminal."""

    def __init__(self, console: Console, duration: float) -> None:
        self._console = console
        self._duration = duration
        self._next = 0.0
        self._live = console.is_terminal
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=30),
            TextColumn("{task.fields[figures]}"),
            TimeElapsedColumn(),
            console=console,
        )
        self._task = self._bar.add_task("riding", total=duration or None, figures="")

    def __enter__(self) -> Display:
        if self._live:
            self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._bar.stop()

    def show(self, watch: Watch) -> None:
        """Bring the display up to date."""
        line = f"{watch.ridden:6.1f} s"
        if self._duration:
            line += f" of {self._duration:g} s"
        if watch.quality is not None:
            line += f"   F {watch.quality.force:6.1f} N"
            if watch.quality.samples:
                line += f"   mean {watch.quality.mean:6.1f} N   sigma {watch.quality.sigma:5.1f} N"
        if watch.books is not None:
            line += f"   dE {watch.books.delta_e:+.3f} J"
        if watch.rig_timing is not None and watch.rig_timing.late:
            line += f"   late {watch.rig_timing.late}"
        if self._live:
            self._bar.update(self._task, completed=watch.ridden, figures=line)
        elif time.monotonic() >= self._next:
            self._next = time.monotonic() + 2.0
            self._console.print(line, highlight=False)
