"""The node's end of the process that speaks and listens on its topics (`phil_node.topics_process`)."""

from __future__ import annotations

import os
import pickle
import select
import socket
import subprocess
import sys
import threading
from collections.abc import Callable
from importlib import import_module
from time import monotonic
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from phil_base.forked import Forked, fork
from phil_base.scheduling import schedule_as_others
from phil_node.link import LONGEST, Peer, joined, messages_of

MESSAGES, COMMAND, ACKNOWLEDGED = 0, 1, 2
"""First byte of what goes between the two processes."""

NAMESAKES = 0
"""Where `TopicsProcess.counts` has the number of nodes of this name on the domain; of a further node of the process
behind it, with a minus: -1, -2, ..."""

Command = tuple[Any, ...]
Counts = dict[int, int]
Kind = tuple[str, str]
Profile = tuple[int, int, int, int]

END = 2.0
"""Time in s that the process has to end when it is left."""


def name_of(kind: Any) -> Kind:
    """Give module and name of a class of messages."""
    return kind.__module__.rsplit(".", 1)[0] if "._" in kind.__module__ else kind.__module__, kind.__name__


def kind_of(name: Kind) -> Any:
    """Give the class of messages of `name_of`."""
    return getattr(import_module(name[0]), name[1])


def policies_of(profile: QoSProfile) -> Profile:
    """Give what is different among the profiles of this package's topics, as numbers."""
    return profile.history.value, profile.depth, profile.reliability.value, profile.durability.value


def profile_of(policies: Profile) -> QoSProfile:
    """Give the profile of `policies_of`."""
    history, depth, reliability, durability = policies
    return QoSProfile(
        history=HistoryPolicy(history),
        depth=depth,
        reliability=ReliabilityPolicy(reliability),
        durability=DurabilityPolicy(durability),
    )


def _serve(file: int) -> None:
    from phil_node.topics_process import serve

    serve(file)


class TopicsProcess:
    """Starts the process, tells it what to speak and listen on, and hands messages over both ways.

    A process that is killed is started again by `revive`, with all that it was told; what it had not published is lost
    for those who listen by DDS, and for nobody else.
    """

    def __init__(self, forked: bool = False) -> None:
        """Start it; it gets ready while the node does. It can be ``forked`` before ROS is initialised."""
        self.lock = threading.Lock()
        self.counts: Counts = {}
        """By number: subscriptions that are matched, or publishers of what is listened to."""
        self.deaths = 0
        self._lost = 0
        self._entries: dict[int, Command] = {}
        self._states: dict[str, Command] = {}
        self._ears: dict[int, Callable[[bytes], None]] = {}
        self._next = 1
        self._room = memoryview(bytearray(LONGEST))
        self._hellos: list[Command] = []
        self._receiving = threading.Lock()
        self._dead: list[subprocess.Popen[bytes] | Forked] = []
        self._start(forked)

    def _start(self, forked: bool = False) -> None:
        from phil_base.real_time import let_go  # with all of its parameters: nothing that the process itself needs

        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            file = theirs.fileno()
            command = [sys.executable, "-m", "phil_node.topics_process", str(file)]
            self._child: subprocess.Popen[bytes] | Forked
            if forked:
                self._child = fork(lambda: _serve(file), command, "topics", keep=(file,))
            else:
                self._child = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, pass_fds=(file,), start_new_session=True
                )
        self._end = os.pidfd_open(self._child.pid)
        let_go(self._child.pid)  # a node's thread that starts it again may come before others, on the cycle's CPU
        ours.setblocking(False)
        self._connection = ours
        self._peer = Peer(ours)

    @property
    def file(self) -> int:
        """Give the file by which it speaks."""
        return self._connection.fileno()

    @property
    def pid(self) -> int:
        """Give the process id."""
        return self._child.pid

    @property
    def dropped(self) -> int:
        """Give the number of batches that it could not take any more."""
        return self._lost + self._peer.dropped

    @property
    def behind(self) -> bool:
        """Tell whether something waits to be handed over."""
        return bool(self._peer.waiting)

    @property
    def gone(self) -> bool:
        """Tell whether the process is over; it is not taken off the system's list, see `close`."""
        return self._peer.gone or bool(select.select([self._end], [], [], 0.0)[0])

    def name(self, node: str, namespace: str) -> int:
        """Tell whose process it is, the first thing to be said; give the number of this node among several."""
        owner = len(self._hellos)
        self._hellos.append(("name", owner, node, namespace))
        self._tell(self._hellos[owner])
        return owner

    def speak(self, kind: Any, name: str, profile: QoSProfile, owner: int = 0) -> int:
        """Have a publisher of node ``owner`` made on a topic (full name); give its number."""
        return self._enter(("publish", self._number(), name_of(kind), name, policies_of(profile), owner))

    def hear(self, kind: Any, name: str, profile: QoSProfile, callback: Callable[[bytes], None], owner: int = 0) -> int:
        """Have a topic (full name) listened to, unless it is linked; give its number. Messages come by `receive`."""
        number = self._number()
        self._ears[number] = callback
        return self._enter(("listen", number, name_of(kind), name, policies_of(profile), owner))

    def drop(self, number: int) -> None:
        """End a publisher or a subscription."""
        self._entries.pop(number, None)
        self._states.pop(f"linked {number}", None)
        self._ears.pop(number, None)
        self._tell(("drop", number))

    def linked(self, number: int, yes: bool) -> None:
        """Tell whether the sender of a topic that is listened to is linked."""
        self._state(f"linked {number}", ("linked", number, yes))

    def active(self, yes: bool, owner: int = 0) -> None:
        """Tell whether the node takes messages."""
        self._state(f"active {owner}", ("active", yes, owner))

    def schedule(self, priority: int, owner: int = 0) -> None:
        """Have its threads scheduled by SCHED_FIFO, and messages handed over at once; 0: the node needs neither."""
        command, key = ("schedule", priority, owner), f"schedule {owner}"
        if self._states.get(key) != command:
            self._state(key, command)

    def publish(self, parts: list[bytes]) -> None:
        """Have messages published, each by the publisher of its number; they are given as to `link.joined`."""
        with self.lock:
            for batch in joined(parts):
                self._peer.send(bytes([MESSAGES]) + batch)

    def go_on(self) -> None:
        """Hand over what had to wait."""
        if self._peer.waiting:
            with self.lock:
                self._peer.go_on()

    def receive(self) -> bool:
        """Take all that came: call back with what was heard, keep what was counted; False if the process is gone."""
        with self._receiving:  # of several nodes in one process one may be beginning while another one takes
            while True:
                try:
                    size = self._connection.recv_into(self._room)
                except BlockingIOError:
                    return True
                except OSError:
                    size = 0
                if not size:
                    return False
                self._take(self._room[0], bytes(self._room[1:size]))

    def acknowledged(self, seconds: float, owner: int = 0) -> None:
        """Wait until those who listen to a node have all that it published, at most ``seconds``."""
        end = monotonic() + seconds
        self._answered = False
        self._tell(("acknowledge", seconds, owner))
        while not self._answered and monotonic() < end and not self.gone:
            self.go_on()
            select.select([self._connection], [], [], min(0.05, seconds))
            if not self.receive():
                return

    def revive(self) -> None:
        """Start it again after it was killed, and tell it all anew."""
        self.deaths += 1
        self._lost += self._peer.dropped
        with self.lock:
            self._peer.close()
        os.close(self._end)
        self._dead.append(self._child)
        self.counts = {}
        self._start()
        for command in (*self._hellos, *self._entries.values(), *self._states.values()):
            self._tell(command)

    def close(self) -> None:
        """Leave it: it ends by itself, or is ended; this thread gives up SCHED_FIFO, see `schedule_as_others`."""
        with self.lock:
            self._peer.close()
        schedule_as_others([threading.get_native_id()])
        os.close(self._end)
        for child in (*self._dead, self._child):
            try:
                child.wait(END)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()

    def _number(self) -> int:
        self._next += 1
        return self._next

    def _enter(self, command: Command) -> int:
        self._entries[command[1]] = command
        self._tell(command)
        return int(command[1])

    def _state(self, key: str, command: Command) -> None:
        self._states[key] = command
        self._tell(command)

    def _tell(self, command: Command) -> None:
        with self.lock:
            self._peer.send(bytes([COMMAND]) + pickle.dumps(command))

    def _take(self, sort: int, content: bytes) -> None:
        if sort == MESSAGES:
            for index, _, data in messages_of(content):
                callback = self._ears.get(index)
                if callback is not None:
                    callback(data)
        elif sort == ACKNOWLEDGED:
            self._answered = True
        elif sort == COMMAND:
            self.counts = pickle.loads(content)[1]  # from the process that this one started
