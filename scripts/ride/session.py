"""A ride from start to end: bring up, watch, take down."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from types import FrameType

import rclpy
from rclpy.signals import SignalHandlerOptions
from rich.console import Console

from energy_monitor.record import DISK_FULL
from energy_monitor.topics import RECORDED
from phil_base.scheduling import highest_priority, priority_of, schedule, schedule_as_others, threads_of, why_not_first
from phil_node.executor import events_executor
from ride.lifecycle import ACTIVATE, CONFIGURE, DEACTIVATE, Managed, RideError
from ride.options import Options
from ride.processes import Nursery, Process, end_all
from ride.settings import NODES, Settings
from ride.shared_memory import remove_litter, snapshot
from ride.watch import RIG, Display, Watch

START_SECONDS = 60.0
CONFIGURE_SECONDS = 180.0
"""The very first start compiles the kernels."""
STALL_SECONDS = 20.0
MOST_LISTENERS = 100
"""Listeners that the rig's parameter allows."""
OVER_SECONDS = 5.0
"""Time without a message of a cycle after which a ride whose rig has ended it is over, whatever was not booked."""
RETRACT_SECONDS = 10.0
REASON_SECONDS = 0.5
"""Time in which a node that refuses says why."""
DISCOVERY_SECONDS = 0.4
"""Time in which a neighbour on the same machine or network is seen: its name within some 10 ms, its topics in 0.2 s."""
OWN_TOPICS = tuple(topic for topic in RECORDED if not topic.startswith("/"))
"""Topics on which nobody but the ride's nodes may speak; the first part of the name is the node that does."""
COMPOSED = "the process of all four nodes"
CONTROLLER = "impedance_mpc"
TAKE_DOWN_ORDER = tuple(reversed(NODES))


class RideInterrupt(Exception):  # noqa: N818 - no error: the operator's wish
    """The operator wants the ride to end."""


class Ride:
    """The four nodes, the recorder, and what is seen of them."""

    def __init__(self, settings: Settings, options: Options, console: Console) -> None:
        self._settings = settings
        self._out = options.out
        self._bag = options.bag
        self._ordinary = options.ordinary_scheduling
        self._composed = options.composed
        self._console = console
        self._nodes: dict[str, Process] = {}
        self._recorder: Process | None = None
        self._managed: dict[str, Managed] = {}
        self._interrupts = 0
        self._shm: frozenset[str] = frozenset()
        self._look_at = 0.0
        self._strangers: set[tuple[str, str]] = set()
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
        handlers = {number: signal.signal(number, self._interrupt) for number in _SIGNALS if not _nohup(number)}
        remove_litter()  # of killed processes, before there are five that might take up the names of its ports
        self._shm = snapshot()
        nursery = Nursery()
        Process.nursery = nursery
        try:
            self._start_processes()
        finally:
            Process.nursery = None
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("ride", start_parameter_services=False)
        self._executor = events_executor()
        self._executor.add_node(self._node)
        try:
            self._refuse_neighbours(0)
            nursery.open()
            self._ride()
        finally:
            nursery.close()
            try:
                self._take_down()
            finally:
                self._executor.shutdown()
                self._node.destroy_node()
                rclpy.try_shutdown()
                end_all(self._processes, patience=0.5)
                remove_litter(self._shm)
                for number, handler in handlers.items():
                    signal.signal(number, handler)

    @property
    def _processes(self) -> list[Process]:
        return [*dict.fromkeys(self._nodes.values()), *([self._recorder] if self._recorder else [])]

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self._interrupts += 1
        if self._interrupts == 1:
            self._console.print("\nending the ride (again: at once)", highlight=False)

    def _start_processes(self) -> None:
        """Fork them, while this process has no threads of ROS; they begin when the nursery is opened."""
        logs = self._out / "logs"
        logs.mkdir(parents=True, exist_ok=True)
        parameters = str(self._out / "params.yaml")
        if self._bag:
            self._ready = logs / "recorder.ready"
            self._ready.unlink(missing_ok=True)
            arguments = ["--out", str(self.bag_path), "--ready-file", str(self._ready)]
            self._recorder = Process("recorder", "energy_monitor.record", arguments, logs / "recorder.log")
        if self._composed:
            arguments = ["--ros-args", "--params-file", parameters]
            arguments += ["-p", f"test_rig_sim:wait_for_subscribers:={self._listeners}"]
            process = Process(COMPOSED, "ride.composed", arguments, logs / "composed.log")
            self._nodes = dict.fromkeys(NODES, process)
            return
        for name in NODES:
            arguments = ["--ros-args", "--params-file", parameters]
            if name == "test_rig_sim":
                # Cycle 0 waits for controller, monitor and recorder: none of them may miss it.
                arguments += ["-p", f"wait_for_subscribers:={self._listeners}"]
            self._nodes[name] = Process(name, f"{name}.node", arguments, logs / f"{name}.log")

    @property
    def _listeners(self) -> int:
        wanted: int = self._settings["test_rig_sim"]["wait_for_subscribers"]
        return min(wanted + (self._recorder is not None), MOST_LISTENERS)

    def _ride(self) -> None:
        self._managed = {name: Managed(self._node, name, self._spin) for name in NODES}
        rig = self._settings["test_rig_sim"]
        duration = rig["duration"]
        last = max(1, round(duration / rig["cycle_time"])) - 1 if duration and not rig["land_at_end"] else None
        processes = {name: process.pid for name, process in self._nodes.items()}
        self.watch = Watch(self._node, rig["cycle_time"], processes, last)
        for managed in self._managed.values():
            managed.wait(START_SECONDS)
        self._refuse_neighbours(1)
        with self._busy("configuring (the first time compiles the kernels)"):
            # The controller waits for the catenary's model.
            self._go(CONFIGURE, CONFIGURE_SECONDS, [name for name in NODES if name != CONTROLLER])
            self._go(CONFIGURE, CONFIGURE_SECONDS, [CONTROLLER])
            self._wait_for_recorder()
        self._go_first()
        # The drive moves when all others are there.
        self._go(ACTIVATE, START_SECONDS, [name for name in NODES if name != RIG])
        self._go(ACTIVATE, START_SECONDS, [RIG])
        watch = self.watch
        watch.moved = watch.heard = time.monotonic()
        with Display(self._console, duration) as display:
            while not (watch.through() or watch.landed):
                self._spin()
                display.show(watch)
                self._raise_errors()
                self._name_strangers()
                patience = OVER_SECONDS if watch.over else STALL_SECONDS
                if time.monotonic() - watch.heard > patience:
                    if watch.cycle == last:
                        break  # all cycles were ridden; what the monitor still lacks, the report will say
                    text = f"no cycle for {patience:g} s, the last one was {watch.cycle}"
                    raise RideError(f"{text}: {watch.reasons}" if watch.reasons else text)
            display.show(watch)
        self.seconds = watch.moved - (watch.started or watch.moved)

    def _go(self, transition: int, seconds: float, names: Sequence[str]) -> None:
        """Make one transition of several nodes at once; one that refuses says why on /diagnostics, soon."""
        several = [self._managed[name] for name in names]
        for managed in several:
            managed.begin(transition)
        refused: dict[str, RideError] = {}
        for managed in several:
            try:
                managed.end(seconds)
            except RideError as error:
                refused[managed.name] = error
        if not refused:
            return
        deadline = time.monotonic() + REASON_SECONDS
        while time.monotonic() < deadline:
            self._spin()
        assert self.watch is not None
        name, first = next(iter(refused.items()))
        said = self.watch.said.get(name)
        reason = f": {said.message}" if said is not None and "cannot" in said.message else ""
        raise RideError(f"{first}{reason}")

    def _go_first(self) -> None:
        """Give the recorder its place behind the nodes, which ask for theirs when they are activated.

        Without real-time scheduling the ride is the same, but slower, and more commands are late: that is said.
        """
        in_real_time = self._settings["test_rig_sim"]["mode"] == "realtime"
        recorder = threads_of(self._recorder.pid) if self._recorder else []
        if self._ordinary:
            schedule_as_others(recorder)  # it goes first by itself
        elif highest_priority():
            schedule(recorder, priority_of("listen", level=not in_real_time))
        elif in_real_time:
            self._console.print(f"expect late commands, no real-time scheduling: {why_not_first()}", soft_wrap=True)

    def _raise_errors(self) -> None:
        """End the ride when a node reports an error; a rig that retracts is let come to rest first."""
        assert self.watch is not None
        if not self.watch.errors:
            return
        name = next(iter(self.watch.errors))
        deadline = time.monotonic() + RETRACT_SECONDS
        while self.watch.retracts(name) and time.monotonic() < deadline:
            self._spin()
        raise RideError(f"{name}: {self.watch.errors[name]}")

    def _name_strangers(self) -> None:
        """Say once who else publishes on a topic of the ride; looks every two seconds."""
        if time.monotonic() < self._look_at:
            return
        self._look_at = time.monotonic() + 2.0
        for topic in OWN_TOPICS:
            for info in self._node.get_publishers_info_by_topic(topic):
                stranger = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
                if info.node_name != topic.split("/")[0] and (stranger, topic) not in self._strangers:
                    self._strangers.add((stranger, topic))
                    self._console.print(f"note: {stranger} publishes on {topic} as well", highlight=False)

    def _busy(self, text: str) -> contextlib.AbstractContextManager[object]:
        return self._console.status(text) if self._console.is_terminal else contextlib.nullcontext()

    def _refuse_neighbours(self, own: int) -> None:
        """Refuse to command nodes that somebody else started; ``own`` of each name are ours."""
        deadline = time.monotonic() + DISCOVERY_SECONDS
        while time.monotonic() < deadline and not own:
            self._spin()
        # A rig of another namespace is no neighbour.
        here = self._node.get_namespace()
        names = [name for name, namespace in self._node.get_node_names_and_namespaces() if namespace == here]
        for name in NODES:
            if names.count(name) > own or self._node.count_services(f"/{name}/change_state") > own:
                domain = os.environ.get("ROS_DOMAIN_ID", "0")
                raise RideError(f"another {name} already runs on ROS domain {domain}: end it, or set ROS_DOMAIN_ID")
        # Our own nodes publish only when they are configured.
        for topic in OWN_TOPICS:
            if publishers := self._node.get_publishers_info_by_topic(topic):
                who = publishers[0].node_name
                raise RideError(f"{who} already publishes on {topic}: end it, or set ROS_DOMAIN_ID")

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
        for process in self._processes:
            if process.ended:
                if process is self._recorder and process.code == DISK_FULL:
                    raise RideError(self._full)
                words = process.last_words()
                raise RideError(f"{process.name} ended with code {process.code}" + (f":\n{words}" if words else ""))

    @property
    def _full(self) -> str:
        return f"the disk is full: {self.bag_path} holds what was recorded up to then; make room and ride again"

    def _spin_down(self) -> None:
        """Spin without caring who is still alive; a second interrupt cuts it short."""
        self._executor.spin_once(timeout_sec=0.05)
        if self._interrupts > 1:
            raise RideInterrupt

    def _take_down(self) -> None:
        """Rig first, so that nothing moves when the others go; then the recorder, then the processes."""
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
                told = self._recorder.ended
                self._recorder.ask_to_end()
                self._recorder.wait(15.0)
                if self._recorder.code == DISK_FULL and not told:
                    self._console.print(self._full, highlight=False, soft_wrap=True)
            if alive and self._composed and all(managed.state == "unconfigured" for managed in alive):
                self._nodes[alive[0].name].ask_to_end(signal.SIGTERM)
            for managed in alive:
                if managed.state == "unconfigured" and not self._composed:
                    # Nothing to undo, and it may still be importing or compiling.
                    self._nodes[managed.name].ask_to_end(signal.SIGTERM)
                    continue
                with contextlib.suppress(RideError):
                    managed.shut_down(5.0)
            end_all(list(dict.fromkeys(self._nodes.values())))


def _nohup(number: signal.Signals) -> bool:
    return number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN


_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
