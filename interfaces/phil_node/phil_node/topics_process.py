"""The process that speaks and listens on a node's topics: ``python -m phil_node.topics_process SOCKET``.

A node that is in the loop has nothing of DDS in its cycle's process but services and parameters. What it publishes goes
to this process in batches, and what strangers publish comes from it: their number, their pace and the locks of DDS are
no matter of the cycle. It is a ROS node of its own, ``/topics/NODE``, and ends with the process that started it.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import socket
import sys
import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from phil_node.executor import events_executor
from phil_node.link import LONGEST, batches, messages_of
from phil_node.publish import publish_bytes
from phil_node.qos import NO_PUBLISHER_EVENTS, NO_SUBSCRIPTION_EVENTS
from phil_node.topics import ACKNOWLEDGED, COMMAND, MESSAGES, NAMESAKES, Command, Counts, kind_of, profile_of

EVERY = 0.004
"""Time in s from one batch of what was heard to the next, when nobody waits for it."""
LOOK = 0.1
"""Time in s from one look at the graph to the next."""
GRACE = 0.5
"""Time in s that a link has to come, before the topic is listened to by DDS as well."""
HELD = 5000
"""Messages that wait for the node: as many as a topic keeps for a slow listener."""
NICE = -10
FOREVER = 3600.0


@dataclass
class Ear:
    """A topic that is listened to by DDS, unless the only one who speaks there is linked."""

    index: int
    name: str
    kind: Any
    profile: QoSProfile
    owner: int = 0
    linked: bool = False
    since: float = field(default_factory=monotonic)
    subscription: Any = None


class Topics:
    """The process's nodes, each with the publishers and subscriptions that it was told to have.

    It has one for each node of the process that started it: one, or several that share that process.
    """

    def __init__(self, connection: socket.socket, name: str, namespace: str) -> None:
        self._connection = connection
        self._executor = events_executor()
        self._nodes: dict[int, Any] = {}
        self._resets: dict[int, str] = {}
        self._name(0, name, namespace)
        self._publishers: dict[int, Any] = {}
        self._owners: dict[int, int] = {}
        """Publishers and subscriptions by number to the node whose they are."""
        self._ears: dict[int, Ear] = {}
        self._heard: deque[tuple[int, int, bytes]] = deque(maxlen=HELD)
        self._counts: Counts = {}
        self._sending = threading.Lock()
        self._wake = threading.Event()
        self._at_once = False
        self._priorities: dict[int, int] = {}
        self._active: set[int] = set()
        self._over = Future()
        self._timer = self._nodes[0].create_timer(LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def run(self) -> None:
        """Serve until the node's process closes its end."""
        for loop in (self._take, self._hand_on):
            threading.Thread(target=loop, daemon=True).start()
        while not self._over.done():
            self._executor.spin_until_future_complete(self._over, timeout_sec=FOREVER)

    def _name(self, owner: int, name: str, namespace: str) -> None:
        self._resets[owner] = f"{namespace.rstrip('/')}/{name}/reset"
        self._nodes[owner] = rclpy.create_node(
            name,
            namespace=f"{namespace.rstrip('/')}/topics",
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor.add_node(self._nodes[owner])

    # From the node ----------------------------------------------------------------------------------------------

    def _take(self) -> None:
        """Publish what comes, and do what is told, in its order."""
        room = memoryview(bytearray(LONGEST))
        try:
            while size := self._connection.recv_into(room):
                sort, content = room[0], bytes(room[1:size])
                if sort == MESSAGES:
                    self._publish(content)
                elif sort == COMMAND:
                    self._in_executor(partial(self._do, pickle.loads(content)))  # from who started this process
        except OSError:
            pass
        finally:
            leave()

    def _publish(self, batch: bytes) -> None:
        for index, _, data in messages_of(batch):
            publisher = self._publishers.get(index)
            if publisher is not None:
                handle = publisher.handle
                with handle:
                    publish_bytes(handle.pointer, data)

    def _in_executor(self, action: Callable[[], None]) -> None:
        """Have something done by the thread that owns the node, and wait for it."""
        done = threading.Event()

        def do() -> None:
            try:
                action()
            except Exception as error:
                print(f"{self._nodes[0].get_fully_qualified_name()}: {error}", file=sys.stderr, flush=True)
            finally:
                done.set()

        self._executor.create_task(do)
        done.wait()

    def _do(self, command: Command) -> None:
        verb, rest = command[0], command[1:]
        if verb == "name":
            self._name(*rest)
        elif verb == "publish":
            index, kind, name, profile, owner = rest
            self._owners[index] = owner
            self._publishers[index] = self._nodes[owner].create_publisher(
                kind_of(kind), name, profile_of(profile), event_callbacks=NO_PUBLISHER_EVENTS
            )
        elif verb == "listen":
            index, kind, name, profile, owner = rest
            self._ears[index] = Ear(index, name, kind_of(kind), profile_of(profile), owner)
        elif verb == "drop":
            self._drop(rest[0])
        elif verb == "linked":
            ear = self._ears.get(rest[0])
            if ear is not None:
                ear.linked, ear.since = rest[1], monotonic()
        elif verb == "active":
            yes, owner = rest
            self._active = self._active | {owner} if yes else self._active - {owner}
            for ear in self._ears.values():
                if ear.owner == owner:
                    ear.since = monotonic()
        elif verb == "schedule":
            self._priorities[rest[1]] = rest[0]
            highest = max(self._priorities.values())
            self._at_once = bool(highest)
            schedule(highest)
        elif verb == "acknowledge":
            self._acknowledge(*rest)
        self._look()

    def _drop(self, index: int) -> None:
        publisher, ear = self._publishers.pop(index, None), self._ears.pop(index, None)
        if publisher is not None:
            self._nodes[self._owners.pop(index)].destroy_publisher(publisher)
        if ear is not None and ear.subscription is not None:
            self._nodes[ear.owner].destroy_subscription(ear.subscription)
        self._counts.pop(index, None)

    def _acknowledge(self, seconds: float, owner: int) -> None:
        """Wait until listeners have what a node published, and say so. A dead one costs all of the time."""
        end = monotonic() + seconds
        for index, publisher in self._publishers.items():
            if self._owners[index] == owner:
                publisher.wait_for_all_acked(Duration(seconds=max(0.0, end - monotonic())))
        self._send(bytes([ACKNOWLEDGED]))

    # To the node ------------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Listen where that is called for, and tell how many listen."""
        now = monotonic()
        node = self._nodes[0]  # all see the same graph
        counts: Counts = {NAMESAKES - owner: node.count_services(name) for owner, name in self._resets.items()}
        for ear in self._ears.values():
            counts[ear.index] = int(node.count_publishers(ear.name))
            alone = ear.linked and counts[ear.index] <= 1
            wanted = ear.owner in self._active and not alone
            if ear.subscription is None and wanted and (ear.linked or now - ear.since >= GRACE):
                ear.subscription = self._nodes[ear.owner].create_subscription(
                    ear.kind,
                    ear.name,
                    self._hearer(ear.index, ear.owner),
                    ear.profile,
                    raw=True,
                    event_callbacks=NO_SUBSCRIPTION_EVENTS,
                )
            elif ear.subscription is not None and alone and now - ear.since >= 2.0 * GRACE:
                self._nodes[ear.owner].destroy_subscription(ear.subscription)
                ear.subscription = None
        counts |= {index: int(each.get_subscription_count()) for index, each in self._publishers.items()}
        if counts != self._counts:
            self._counts = counts
            self._send(bytes([COMMAND]) + pickle.dumps(("counts", counts)))

    def _hearer(self, index: int, owner: int) -> Callable[[bytes], None]:
        heard, wake = self._heard, self._wake

        def hear(data: bytes) -> None:
            if owner not in self._active:
                return  # nobody would take it, and then it would stand in the way
            heard.append((index, 0, data))
            if self._at_once:
                self._flush()
            else:
                wake.set()

        return hear

    def _hand_on(self) -> None:
        while True:
            self._wake.wait()
            self._wake.clear()
            self._flush()
            sleep(EVERY)

    def _flush(self) -> None:
        with self._sending:
            found = []
            with suppress(IndexError):
                while True:
                    found.append(self._heard.popleft())
            for batch in batches(found):
                self._put(bytes([MESSAGES]) + batch)

    def _send(self, data: bytes) -> None:
        with self._sending:
            self._put(data)

    def _put(self, data: bytes) -> None:
        try:
            self._connection.send(data)
        except OSError:
            leave()


def schedule(priority: int) -> None:
    """Give all threads that priority of SCHED_FIFO; 0: the ordinary class, somewhat before others if allowed."""
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            number = int(task.name)
            if priority:
                os.sched_setscheduler(number, os.SCHED_FIFO, os.sched_param(priority))
            else:
                os.sched_setscheduler(number, os.SCHED_OTHER, os.sched_param(0))
                os.setpriority(os.PRIO_PROCESS, number, NICE)


def leave() -> None:
    """Say good-bye to the graph and end, whatever hangs."""
    threading.Timer(1.0, os._exit, (0,)).start()
    with suppress(Exception):
        rclpy.try_shutdown()
    os._exit(0)


def serve(file: int) -> None:
    """Wait for the node's name, then serve what comes by a socket, until its other end is closed."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends with the node's process, which decides when that is
    ctypes.CDLL(None).prctl(15, b"topics")  # PR_SET_NAME, for who looks with ps or top
    connection = socket.socket(fileno=file)
    first = connection.recv(LONGEST)
    if not first:
        os._exit(0)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    _, _, name, namespace = pickle.loads(first[1:])
    Topics(connection, name, namespace).run()


def main() -> None:
    """Serve the socket that is named on the command line."""
    serve(int(sys.argv[1]))


if __name__ == "__main__":
    main()
