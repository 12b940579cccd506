"""What the run script sees of a ride while it goes on: a few decimated topics, and a line of progress."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from phil_interfaces.msg import ConservedQuantities, ContactQuality, CycleTiming
from rclpy.node import Node
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from phil_node.qos import CYCLE
from phil_node.timing import REASON

RIG = "test_rig_sim"
MONITOR = "energy_monitor"
LISTENERS = ("impedance_mpc", MONITOR)
"""Nodes of a ride that listen to the rig's state."""
AWAKE = 2.5
"""Time in s for which a node that spoke on /diagnostics, as it does each second, counts as one that runs."""
RESTING = {"mode": "stopped", "outcome": "landed"}
"""What the rig's status says after a soft landing, with which a ride ends before or after its duration."""


@dataclass
class Said:
    """What a node of the ride said last on /diagnostics, and when, on the monotonic clock in s."""

    level: bytes
    message: str
    values: dict[str, str] = field(default_factory=dict)
    at: float = field(default_factory=time.monotonic)

    def __str__(self) -> str:
        """Give its sentence, with the number of times behind what happened more than once."""
        text = self.message
        for key, value in self.values.items():
            reason = key.removeprefix(REASON)
            if reason != key and value.isdigit() and int(value) > 1:
                text = text.replace(reason, f"{reason} ({value} times)")
        return text


class Watch:
    """Latest figures of the running ride; ``started``, ``moved`` and ``heard`` are on the monotonic clock in s.

    The ride ``moved`` when a cycle came that none had come to, and was ``heard`` of also when a node caught up.

    /diagnostics belongs to everybody: a status is of this ride only if it carries the name of one of its nodes, as name
    and as hardware_id, and the number of the process that was started as that node.
    """

    def __init__(self, node: Node, cycle_time: float, processes: Mapping[str, int], last: int | None = None) -> None:
        """Watch the nodes that run as ``processes`` (name and process id), up to cycle ``last``, None: endless."""
        namespace = node.get_namespace().rstrip("/")
        self._ours = {f"{namespace}/{name}": (name, str(number)) for name, number in processes.items()}
        self._last = last
        self.said: dict[str, Said] = {}
        self.quality: Any = None
        self.books: Any = None
        self.rig_timing: Any = None
        self.errors: dict[str, str] = {}
        self.warnings: dict[str, str] = {}
        self.cycle = -1
        self.moved = self.heard = time.monotonic()
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

    @property
    def landed(self) -> bool:
        """Tell whether the rig rests after a soft landing."""
        values = self.said[RIG].values if RIG in self.said else {}
        return all(values.get(key) == value for key, value in RESTING.items())

    @property
    def over(self) -> bool:
        """Tell whether no cycle will come any more: the rig has ended its ride, and the monitor is not held up."""
        rig, monitor = self.said.get(RIG), self.said.get(MONITOR)
        awake = monitor is not None and time.monotonic() - monitor.at < AWAKE
        return awake and rig is not None and rig.values.get("phase") == "ended"

    def retracts(self, name: str) -> bool:
        """Tell whether that node is a rig that is on its way to its safe position."""
        return name in self.said and self.said[name].values.get("mode") == "retracting"

    @property
    def reasons(self) -> str:
        """Give what the nodes know about why nothing goes on; empty if they know nothing."""
        found = [f"{name}: {said}" for name, said in self.said.items() if said.level != DiagnosticStatus.OK]
        rig = self.said[RIG].values if RIG in self.said else {}
        phase = rig.get("phase", "")
        if phase == "waiting for listeners":
            found.append(f"{RIG} is {phase} ({rig.get('listeners', 'none known')}){self._deaf(rig.get('heard by'))}")
        elif phase == "waiting for a command" and not found:
            found.append(f"{RIG} is {phase} (cycle {rig.get('cycle', 'unknown')}), nobody says why it does not come")
        return "; ".join(found)

    def _deaf(self, heard_by: str | None) -> str:
        """Name the nodes of the ride that should listen to the rig's state and do not, as far as the rig knows."""
        there = None if heard_by is None else heard_by.split(", ")
        deaf = [name for name, _ in self._ours.values() if there and name in LISTENERS and name not in there]
        return f": {' and '.join(deaf)} not among them" if deaf else ""

    def through(self) -> bool:
        """Tell whether the last cycle was ridden, answered and booked by the monitor; never for an endless ride."""
        last = self._last
        if last is None or self.rig_timing is None or self.books is None:
            return False
        return bool(self.rig_timing.cycle >= last and self.books.cycle >= last)

    def _believes(self, cycle: int) -> bool:
        """Tell whether a message can be of this ride."""
        return self._last is None or cycle <= self._last

    def _move_to(self, cycle: int) -> None:
        self.heard = time.monotonic()
        if cycle > self.cycle:
            self.cycle = cycle
            self.moved = self.heard
            if self.started is None:
                self.started = self.moved

    def _take_quality(self, message: Any) -> None:
        if self._believes(message.cycle):
            self.quality = message
            self._move_to(message.cycle)

    def _take_books(self, message: Any) -> None:
        if self._believes(message.cycle):
            self.books = message
            self._move_to(message.cycle)

    def _take_timing(self, message: Any) -> None:
        if self._believes(message.cycle):
            self.rig_timing = message
            self._move_to(message.cycle)

    def _take_diagnostics(self, message: Any) -> None:
        for status in message.status:
            name, process = self._ours.get(status.hardware_id, ("", ""))
            if status.name != f"{status.hardware_id}: cycle" or not name:
                continue  # another device, or an aggregator: what ours said, under a name and a level of its own
            said = Said(status.level, status.message, {entry.key: entry.value for entry in status.values})
            if said.values.get("process") != process:
                continue  # somebody else's node of that name, or one of an earlier ride
            self.said[name] = said
            if status.level == DiagnosticStatus.ERROR:
                self.errors[name] = str(said)
            elif status.level != DiagnosticStatus.OK:  # STALE ends no ride: the rig retracts, or goes on
                self.warnings[name] = str(said)


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
