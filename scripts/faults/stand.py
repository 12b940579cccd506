"""One loop of real nodes in real time, to which faults are done: its processes, and how they are brought up again."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import rclpy
from std_msgs.msg import String

from energy_monitor.topics import RECORDED
from faults.observer import Observer
from faults.relay import DONE, LATCHED_ORDERS, LINKS, ORDERS
from faults.wall_clock import WallClock
from phil_base.enumerations import Mode
from phil_base.scheduling import highest_priority, priority_of, schedule, threads_of
from phil_node.executor import events_executor
from ride.lifecycle import DEACTIVATE, RideError
from ride.processes import Process, end_all
from ride.rearm import change, configure, rearm, state_of
from ride.settings import NODES, Settings, line_text, resolve, write

RECORDER = "recorder"
UP_SECONDS = 60.0
FOLLOW_SECONDS = 20.0
INNER_RATE = 5000.0
"""Hz of the rig's inner loop, whatever the rate of the cycles."""


RELAYED = "relayed-"
"""Before the name of a link: the kind of the stand on which the relay is in that link."""
KINDS: Mapping[str, Mapping[str, Mapping[str, Any]]] = {
    "plain": {},
    **{f"{RELAYED}{link}": {} for link in LINKS},
    "clock": {},
    "full": {},
    "solver": {"impedance_mpc": {"qp_max_iterations": 1}},
}
"""Kinds of a stand, and what is set in its nodes."""


def settings_for(rate: float, kind: str) -> Settings:
    """Give an endless ride in real time with ``rate`` cycles a second on a stand of a kind.

    Raises
    ------
    ParameterError
        The nodes do not run at that rate.
    """
    period = 1.0 / rate
    rig = {"mode": "realtime", "duration": 0.0, "inner_steps": max(1, round(period * INNER_RATE))}
    own = {name: {"cycle_time": period, **KINDS[kind].get(name, {})} for name in NODES}
    own["test_rig_sim"] |= rig
    return resolve(None, own)


class Stand:
    """The four nodes, a recorder for each ride, and an observer; ``kind`` is one of `KINDS`.

    On "full" no ride was before: what the nodes keep for late listeners would fill a small disk at once.
    With "relayed-LINK" the messages of that link go through a relay, with "clock" all have a wall clock that can be
    set.
    """

    def __init__(self, folder: Path, rate: float, kind: str) -> None:
        """Make ready; `mend` starts the nodes."""
        self.kind = kind
        self._link = LINKS.get(kind.removeprefix(RELAYED))
        self.settings = settings_for(rate, kind)
        self.period = 1.0 / rate
        self.folder = folder
        self.processes: dict[str, Process] = {}
        self._node = node = rclpy.create_node("faults", start_parameter_services=False, enable_rosout=False)
        self._executor = events_executor()
        self._executor.add_node(node)
        self.observer = Observer(node)
        self.begun = 0.0
        """When the fault that is done now began, monotonic clock in s."""
        self._starts = 0
        self._done: list[dict[str, Any]] = []
        self._orders = node.create_publisher(String, ORDERS, LATCHED_ORDERS)
        node.create_subscription(String, DONE, lambda m: self._done.append(json.loads(m.data)), LATCHED_ORDERS)
        self.logs = folder / "logs"
        self.logs.mkdir(parents=True, exist_ok=True)
        write(self.settings, line_text(self.settings), folder)
        self.clock = WallClock(folder) if kind == "clock" else None

    # Processes -------------------------------------------------------------------------------------------------

    def start(self, name: str) -> None:
        """Start the process of a node (or the relay)."""
        if name == "relay":
            self.processes[name] = self._process(name, "faults.relay", [self.kind.removeprefix(RELAYED)])
            return
        words = ["--ros-args", "--params-file", str(self.folder / "params.yaml")]
        if self._link is not None and self._link.listener == name:
            words += ["-r", self._link.remapping]
        self.processes[name] = self._process(name, f"{name}.node", words)

    def _process(self, name: str, module: str, words: list[str]) -> Process:
        self._starts += 1
        environment = self.clock.environment if self.clock else {}
        with _environment(environment):
            return Process(name, module, words, self.logs / f"{self._starts:03d}-{name}.log")

    def record(self, bag: Path) -> None:
        """Start a recorder, and wait until it hears all topics.

        Raises
        ------
        RideError
            It does not.
        """
        ready = self.logs / "recorder.ready"
        ready.unlink(missing_ok=True)
        words = ["--out", str(bag), "--ready-file", str(ready), "--expect-topics", *RECORDED]
        self.processes[RECORDER] = self._process(RECORDER, "energy_monitor.record", words)
        self.until(ready.exists, UP_SECONDS, "the recorder did not become ready")

    @property
    def dead(self) -> list[str]:
        """Name the processes that are over."""
        return [name for name, process in self.processes.items() if process.ended]

    def mend(self) -> list[str]:
        """Start those nodes that are not running, and configure those that are not; name what was started."""
        wanted = [*(["relay"] if self._link is not None else []), *NODES]
        fresh = [name for name in wanted if name not in self.processes or self.processes[name].ended]
        for name in fresh:
            self.start(name)
        configure(self._node, self.spin)
        return fresh

    def arm(self) -> None:
        """Begin a ride with cycle 0, and wait until the drive follows.

        Raises
        ------
        RideError
            It does not come to that.
        """
        self.mend()
        self.rest()
        self.observer.clear()
        rearm(self._node, self.spin)
        if highest_priority():
            # The nodes have theirs from their activation, as in any ride.
            self._place(RECORDER, "listen")
            self._place("relay", "transport")
            _see_first()
        self.until(self._follows, FOLLOW_SECONDS, "the drive did not follow")

    def _place(self, name: str, role: str) -> None:
        """Give a process beside the nodes its place among them."""
        process = self.processes.get(name)
        if process is not None and not process.ended:
            schedule(threads_of(process.pid), priority_of(role))

    def _follows(self) -> bool:
        newest = self.observer.newest
        if newest is not None and self.kind == "solver":
            return True  # whose fault begins with the ride
        return newest is not None and newest.mode == Mode.TRACKING and newest.cycle * self.period > 0.5

    def rest(self) -> None:
        """Let the drive rest where it is: deactivates the rig if it is active."""
        if not self.processes["test_rig_sim"].ended and state_of(self._node, "test_rig_sim", self.spin) == "active":
            change(self._node, "test_rig_sim", DEACTIVATE, self.spin)

    def stop_recording(self) -> int | None:
        """End the recorder as the run script does; give its exit code."""
        recorder = self.processes.get(RECORDER)
        if recorder is None:
            return None
        recorder.ask_to_end()
        end = time.monotonic() + 15.0
        while not recorder.ended and time.monotonic() < end:
            self.spin()
        end_all([recorder], patience=0.0)
        return recorder.code

    def close(self) -> None:
        """End all processes."""
        with suppress(RideError):
            self.rest()
        self.stop_recording()
        for process in self.processes.values():
            process.ask_to_end(signal.SIGCONT)
            process.ask_to_end(signal.SIGINT)
        end_all(list(self.processes.values()))
        self._executor.shutdown()
        self._node.destroy_node()

    # What faults are made of -----------------------------------------------------------------------------------

    def spin(self) -> None:
        """Let messages in for a moment."""
        self._executor.spin_once(timeout_sec=0.02)

    def wait(self, seconds: float) -> None:
        """Let time go by; as exactly as it goes."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.05:
            self.spin()
        time.sleep(max(0.0, left))

    def until(self, condition: Callable[[], bool], seconds: float, otherwise: str) -> None:
        """Wait for something.

        Raises
        ------
        RideError
            It did not come within ``seconds``.
        """
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                raise RideError(otherwise)
            self.spin()

    def begin(self) -> None:
        """Note that the fault begins now."""
        self.begun = time.monotonic()

    def signal(self, name: str, number: int) -> None:
        """Send a signal to a process."""
        self.processes[name].ask_to_end(number)

    def order(self, kind: str, share: float = 1.0, delay: float = 0.0) -> int:
        """Tell the relay what to do to its link; give how many messages the order before was done to."""
        self._done.clear()
        self._orders.publish(String(data=json.dumps({"kind": kind, "share": share, "delay": delay})))
        self.until(lambda: bool(self._done), 5.0, "the relay does not answer")
        return int(self._done[0]["done"])


def _see_first() -> None:
    """Let the threads of this process go before ordinary ones, but behind the ride: an observer that waits sees gaps.

    What it starts is ordinary again.
    """
    for task in Path("/proc/self/task").iterdir():
        with suppress(ProcessLookupError):
            os.sched_setscheduler(int(task.name), os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(1))


@contextmanager
def _environment(changes: Mapping[str, str]) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(changes)
    try:
        yield
    finally:
        for name in changes:
            if name in before:
                os.environ[name] = before[name]
            else:
                del os.environ[name]
