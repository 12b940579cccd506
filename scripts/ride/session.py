"""A ride from start to end: bring up, watch, take down."""

from __future__ import annotations

import contextlib
import shutil
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from types import FrameType
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from ride.lifecycle import ACTIVATE, CONFIGURE, DEACTIVATE, Managed, RideError
from ride.processes import Process, end_all
from ride.settings import NODES
from ride.shared_memory import remove_litter, snapshot
from ride.watch import Display, Watch

START_SECONDS = 60.0
CONFIGURE_SECONDS = 180.0
"""The very first start compiles the kernels."""
STALL_SECONDS = 20.0
TAKE_DOWN_ORDER = tuple(reversed(NODES))


class RideInterrupt(Exception):  # noqa: N818 - no error: the operator's wish
    """The operator wants the ride to end."""


class Ride:
    """The four nodes, the recorder, and what is seen of them."""

    def __init__(self, settings: Mapping[str, Mapping[str, Any]], out: Path, bag: bool, console: Console) -> None:
        self._settings = settings
        self._out = out
        self._bag = bag
        self._console = console
        self._nodes: dict[str, Process] = {}
        self._recorder: Process | None = None
        self._managed: dict[str, Managed] = {}
        self._interrupts = 0
        self._shm = snapshot()
        self.watch: Watch | None = None
        self.seconds = 0.0

    @property
    def bag_path(self) -> Path:
        """Give the folder of the bag."""
        return self._out / "bag"

    def run(self) -> None:
        """Ride to the end, and leave nothing running, whatever happens.

        Raises
        ------
        RideError
            A node could not be brought up, died, stalled or reported an error.
        RideInterrupt
            Ctrl-C or a signal ended the ride early; the bag is complete up to there.
        """
        handlers = {number: signal.signal(number, self._interrupt) for number in _SIGNALS}
        try:
            # Children first: what they run between fork and exec must not meet the threads of the middleware.
            self._start_processes()
            rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
            try:
                self._ride()
            finally:
                self._take_down()
                self._executor.shutdown()
                self._node.destroy_node()
                rclpy.try_shutdown()
        finally:
            end_all([*self._nodes.values(), *([self._recorder] if self._recorder else [])], patience=0.5)
            remove_litter(self._shm)
            for number, handler in handlers.items():
                signal.signal(number, handler)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._interrupts += 1
        if self._interrupts == 1:
            self._console.print("\nending the ride (again: at once)", highlight=False)

    def _start_processes(self) -> None:
        logs = self._out / "logs"
        logs.mkdir(parents=True, exist_ok=True)
        parameters = str(self._out / "params.yaml")
        if self._bag:
            shutil.rmtree(self.bag_path, ignore_errors=True)
            self._ready = logs / "recorder.ready"
            self._ready.unlink(missing_ok=True)
            arguments = ["-m", "energy_monitor.record", "--out", str(self.bag_path), "--ready-file", str(self._ready)]
            self._recorder = Process("recorder", arguments, logs / "recorder.log")
        for name in NODES:
            arguments = ["-m", f"{name}.node", "--ros-args", "--params-file", parameters]
            self._nodes[name] = Process(name, arguments, logs / f"{name}.log")

    def _ride(self) -> None:
        self._node = rclpy.create_node("ride", start_parameter_services=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._managed = {name: Managed(self._node, name, self._spin) for name in NODES}
        rig = self._settings["test_rig_sim"]
        self.watch = Watch(self._node, rig["cycle_time"])
        for managed in self._managed.values():
            managed.wait(START_SECONDS)
        self._refuse_neighbours()
        with self._busy("configuring (the first time compiles the kernels)"):
            for managed in self._managed.values():
                managed.go(CONFIGURE, CONFIGURE_SECONDS)
            self._wait_for_recorder()
        for managed in self._managed.values():
            managed.go(ACTIVATE, START_SECONDS)
        duration = rig["duration"]
        self.watch.moved = time.monotonic()
        with Display(self._console, duration) as display:
            last = round(duration / rig["cycle_time"]) - 1
            while self.watch.cycle < last or last < 0:
                self._spin()
                display.show(self.watch)
                if self.watch.errors:
                    name, text = next(iter(self.watch.errors.items()))
                    raise RideError(f"{name}: {text}")
                if time.monotonic() - self.watch.moved > STALL_SECONDS:
                    raise RideError(f"no cycle for {STALL_SECONDS:g} s, the last one was {self.watch.cycle}")
            display.show(self.watch)
        self.seconds = time.monotonic() - (self.watch.started or time.monotonic())

    def _busy(self, text: str) -> contextlib.AbstractContextManager[object]:
        return self._console.status(text) if self._console.is_terminal else contextlib.nullcontext()

    def _refuse_neighbours(self) -> None:
        """Refuse to command nodes that somebody else started."""
        names = self._node.get_node_names()
        for name in NODES:
            if names.count(name) > 1 or self._node.count_services(f"/{name}/change_state") > 1:
                raise RideError(
                    f"another {name} already runs on this ROS domain: end it, or set ROS_DOMAIN_ID to another number"
                )

    def _wait_for_recorder(self) -> None:
        deadline = time.monotonic() + START_SECONDS
        while self._recorder is not None and not self._ready.exists():
            self._spin()
            if time.monotonic() > deadline:
                raise RideError(f"the recorder did not become ready: see {self._recorder.log}")

    def _spin(self) -> None:
        """Let messages in for a moment; notice interrupts and the death of a process.

        Raises
        ------
        RideError, RideInterrupt
        """
        self._executor.spin_once(timeout_sec=0.05)
        if self._interrupts:
            raise RideInterrupt
        for process in [*self._nodes.values(), *([self._recorder] if self._recorder else [])]:
            if process.ended:
                words = process.last_words()
                raise RideError(f"{process.name} ended with code {process.code}" + (f":\n{words}" if words else ""))

    def _spin_down(self) -> None:
        """Spin without caring who is still alive; a second interrupt cuts it short."""
        self._executor.spin_once(timeout_sec=0.05)
        if self._interrupts > 1:
            raise RideInterrupt

    def _take_down(self) -> None:
        """Rig first, so that nothing moves when the others go; then the recorder, then the processes."""
        if not hasattr(self, "_executor"):
            return
        names = [name for name in TAKE_DOWN_ORDER if name in self._managed and not self._nodes[name].ended]
        alive = [self._managed[name] for name in names]
        for managed in alive:
            managed.spin = self._spin_down
        with contextlib.suppress(RideInterrupt):
            for managed in alive:
                if managed.state == "active":
                    with contextlib.suppress(RideError):
                        managed.go(DEACTIVATE, 5.0)
            if self._recorder is not None:
                self._recorder.ask_to_end()
                self._recorder.wait(15.0)
            for managed in alive:
                with contextlib.suppress(RideError):
                    managed.shut_down(5.0)
            end_all(list(self._nodes.values()))


_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
