"""What goes on beside a ride, as a process: ``outside.py PARENT view NUMBER [STAY [FILE]] | parameters | busy``.

Plain rclpy with nothing of this project: what an engineer's own tools do. It ends by SIGTERM, or when its parent dies.
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import time
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any

NODES = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor")
VISITS = (3.0, 4.0, 5.0)
"""s, lengths of a viewer's visits, by its number."""
PAUSE = 0.5
"""s between a viewer's visits."""
DEPTH = 10
LOOK = 0.25
"""s between two looks at the graph for topics."""
ANSWER = 2.0
"""s in which a node has to answer about its parameters."""
PR_SET_PDEATHSIG = 1

_ended = False


def _end(number: int, frame: FrameType | None) -> None:
    global _ended
    _ended = True


def say(**found: object) -> None:
    """Hand one line to whoever started this."""
    print(json.dumps(found), flush=True)


def view(number: int, stay: float | None = None, file: str = "") -> None:
    """Join, read all topics of a ride for ``stay`` s or as VISITS says, leave; again and again.

    With ``file`` it joins once that is there, and has loaded all that it needs by then.

    Even numbers ask for reliable, odd ones for best effort; each second pair for what is kept, where it is offered, as
    `ros2 topic echo` does.
    """
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    stay = stay or VISITS[number % len(VISITS)]
    say(ready=True)
    while file and not (_ended or Path(file).exists()):
        time.sleep(0.02)
    while not _ended:
        begun = time.monotonic()
        context = rclpy.Context()
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(f"viewer_{number}_{os.getpid()}", context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        counts: dict[str, int] = {}
        look = 0.0
        while not _ended and time.monotonic() - begun < stay:
            if time.monotonic() >= look:
                _subscribe(node, number, counts)
                look = time.monotonic() + LOOK
            executor.spin_once(timeout_sec=0.1)
        executor.shutdown(timeout_sec=0.0)
        node.destroy_node()
        context.try_shutdown()
        say(topics=sum(count > 0 for count in counts.values()), messages=sum(counts.values()))
        time.sleep(PAUSE)


def _subscribe(node: Any, number: int, counts: dict[str, int]) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    for topic, types in node.get_topic_names_and_types():
        if topic in counts or not (topic == "/diagnostics" or topic.split("/")[1] in NODES):
            continue
        publishers = node.get_publishers_info_by_topic(topic)
        if not publishers:
            continue
        kept = number % 4 > 1 and all(
            one.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in publishers
        )
        profile = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.BEST_EFFORT if number % 2 else ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        )
        counts[topic] = 0
        node.create_subscription(_message(types[0]), topic, lambda _, name=topic: _count(counts, name), profile)


def _message(kind: str) -> Any:
    """Give the class of "package/msg/Name"."""
    package, _, name = kind.split("/")
    return getattr(import_module(f"{package}.msg"), name)


def _count(counts: dict[str, int], topic: str) -> None:
    counts[topic] += 1


def parameters() -> None:
    """List, describe and get all parameters of all nodes, every second, as `ros2 param dump` does for one."""
    import rclpy
    from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters
    from rclpy.signals import SignalHandlerOptions

    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(f"parameter_reader_{os.getpid()}")
    kinds = {"list": ListParameters, "describe": DescribeParameters, "get": GetParameters}
    clients = {
        (name, verb): node.create_client(kind, f"/{name}/{verb}_parameters")
        for name in NODES
        for verb, kind in kinds.items()
    }

    def ask(name: str, verb: str, request: Any) -> Any:
        future = clients[name, verb].call_async(request)
        deadline = time.monotonic() + ANSWER
        while not (_ended or future.done()) and time.monotonic() < deadline:
            rclpy.spin_once(node, timeout_sec=0.1)
        return future.result() if future.done() else None

    say(ready=True)
    while not _ended:
        begun = time.monotonic()
        read = silent = 0
        for name in NODES:
            listed = ask(name, "list", ListParameters.Request())
            names = listed.result.names if listed else []
            told = ask(name, "describe", DescribeParameters.Request(names=names)) if names else None
            values = ask(name, "get", GetParameters.Request(names=names)) if told else None
            read += len(values.values) if values else 0
            silent += values is None
        if not _ended:
            say(parameters=read, silent=silent)
        while not _ended and time.monotonic() - begun < 1.0:
            time.sleep(0.05)
    node.destroy_node()
    rclpy.try_shutdown()


def busy() -> None:
    """Use a core."""
    say(ready=True)
    while not _ended:
        pass


def main() -> None:
    """Do what the command line says, by ordinary priority."""
    parent, what = int(sys.argv[1]), sys.argv[2]
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    signal.signal(signal.SIGTERM, _end)
    if os.getppid() != parent:
        return  # it died before we could ask
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    if what == "view":
        stay, file = (*sys.argv[4:6], *("0", "")[len(sys.argv[4:6]) :])
        view(int(sys.argv[3]), float(stay), file)
    elif what == "parameters":
        parameters()
    else:
        busy()


if __name__ == "__main__":
    main()
