"""A ride with its four nodes in one process: the numbers of four processes, the same topics, nodes that are seen."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from client import Client
from rosbags.rosbag2 import Reader

from energy_monitor.bag import read_bag

pytestmark = pytest.mark.integration

NODES = ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim")
OF_THE_MACHINE = ("/diagnostics", *(f"/{name}/timing" for name in NODES))
"""Topics that tell how long something took, or go by the wall clock."""


def messages(bag: Path) -> dict[str, list[str]]:
    """Give what was said on each topic but those of the machine, each message once, every number to the last bit.

    As text, not as bytes: what rclpy leaves between two fields is not told from what was there before.
    """
    from rclpy.serialization import deserialize_message

    found: dict[str, dict[str, None]] = {}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            if connection.topic not in OF_THE_MACHINE:
                message = deserialize_message(bytes(data), kind_of(connection.msgtype))
                found.setdefault(connection.topic, {})[repr(message)] = None
    return {topic: list(several) for topic, several in found.items()}


def kind_of(name: str) -> Any:
    package, _, short = name.split("/")
    return getattr(import_module(f"{package}.msg"), short)


def topics(bag: Path) -> dict[str, str]:
    with Reader(bag) as reader:
        return {connection.topic: connection.msgtype for connection in reader.connections}


def assert_same(one: Path, other: Path) -> None:
    ours, theirs = messages(one), messages(other)
    assert topics(one) == topics(other)
    assert ours.keys() == theirs.keys()
    for topic in theirs:
        assert len(ours[topic]) == len(theirs[topic]), topic
        assert ours[topic] == theirs[topic], topic


def test_a_composed_ride_gives_the_bag_of_four_processes_to_the_last_bit(composed_ride, lockstep_ride):
    assert composed_ride.code == 0, composed_ride.text
    assert_same(composed_ride.out / "bag", lockstep_ride.out / "bag")


def test_every_turnaround_is_in_the_bag_as_with_four_processes(composed_ride, lockstep_ride):
    ours, theirs = (read_bag(done.out / "bag").tables for done in (composed_ride, lockstep_ride))
    for topic in OF_THE_MACHINE[1:]:
        cycles = [sum(len(batch) for batch in tables[topic].entries("turnaround")) for tables in (ours, theirs)]
        assert cycles[0] == cycles[1] > 0, topic
        assert all(int(ours[topic][name][-1]) == 0 for name in ("messages_late", "messages_lost", "messages_swapped"))


def test_nothing_is_left_of_a_composed_ride(composed_ride, leftovers):
    assert leftovers(composed_ride.out) == []


def test_with_finite_differences_the_numbers_are_the_same_too(ride):
    arguments = ("--duration", "1", "--discretisation", "fd", "--no-report")
    rides = [ride(*arguments, name="four"), None]
    rides[0].finish(240.0)
    rides[1] = ride(*arguments, "--composed", name="one")
    rides[1].finish(240.0)
    assert [done.code for done in rides] == [0, 0], rides[0].text + rides[1].text
    assert_same(rides[1].out / "bag", rides[0].out / "bag")


@pytest.mark.alone
def test_the_nodes_are_seen_asked_and_alone_on_the_machine_and_an_interrupt_ends_them_in_order(
    ride, node_environment, leftovers
):
    from lifecycle_msgs.srv import GetState
    from rcl_interfaces.srv import GetParameters
    from std_srvs.srv import Trigger

    going = ride("--mode", "realtime", "--duration", "0", "--composed", "--no-report")
    going.wait_until_riding()
    viewer = Client(node_environment, "viewer", {})
    try:
        wanted = {*NODES, *(f"topics/{name}" for name in NODES)}

        def seen() -> set[str]:
            graph = viewer.node.get_node_names_and_namespaces()
            return {f"{namespace}/{name}".strip("/") for name, namespace in graph}

        assert viewer.until(lambda: wanted <= seen()), seen()
        for name in NODES:
            state = viewer.call(GetState, f"{name}/get_state", GetState.Request()).current_state.label
            assert state == "active", name
            values = viewer.call(GetParameters, f"{name}/get_parameters", GetParameters.Request(names=["cycle_time"]))
            assert values.values[0].double_value == 0.002, name
            refused = viewer.call(Trigger, f"{name}/reset", Trigger.Request())
            assert not refused.success and "ride is going on" in refused.message
        assert viewer.until(lambda: viewer.status.keys() >= set(NODES))
        processes = {entry.value for name in NODES for entry in viewer.status[name].values if entry.key == "process"}
        assert len(processes) == 1
        publishers = viewer.node.get_publishers_info_by_topic("/test_rig_sim/state")
        assert [(info.node_name, info.node_namespace) for info in publishers] == [("test_rig_sim", "/topics")]
        assert viewer.set_on("impedance_mpc", environment="mass_spring_damper").successful
        for name in NODES:
            second = subprocess.run(
                [sys.executable, "-m", f"{name}.node"], env=node_environment, capture_output=True, text=True, timeout=60
            )
            assert second.returncode == 2 and "already runs" in second.stderr, (name, second.stderr)
    finally:
        viewer.close()
    os.killpg(going.process.pid, signal.SIGINT)
    going.finish()
    assert going.code == 130, going.text
    assert read_bag(going.out / "bag").tables["/test_rig_sim/state"]["cycle"].size > 0
    assert leftovers(going.out) == []


def test_the_end_of_the_process_ends_the_ride_with_one_clear_line_and_the_bag_is_kept(ride, leftovers):
    going = ride("--duration", "0", "--composed", "--no-report")
    going.wait_until_riding()
    (process,) = [p for p in leftovers(going.out) if "ride.composed" in command_line(p)]
    os.kill(process, signal.SIGKILL)
    going.finish()
    assert going.code == 1
    assert "the ride failed: the process of all four nodes ended with code -9" in going.text
    cycles = read_bag(going.out / "bag").tables["/test_rig_sim/state"]["cycle"]
    assert sorted(set(cycles.tolist())) == list(range(max(cycles) + 1))
    assert until(lambda: leftovers(going.out) == [])


@pytest.mark.alone
def test_who_shuts_one_node_down_ends_all_and_is_told(ride, node_environment):
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    going = ride("--mode", "realtime", "--duration", "0", "--composed", "--no-report")
    going.wait_until_riding()
    viewer = Client(node_environment, "viewer", {})
    try:
        request = ChangeState.Request()
        request.transition.id = Transition.TRANSITION_ACTIVE_SHUTDOWN
        assert viewer.call(ChangeState, "energy_monitor/change_state", request).success
    finally:
        viewer.close()
    going.finish()
    assert going.code == 1
    assert "/energy_monitor was shut down, and with it the other nodes of its process" in going.text


def command_line(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace")
    except OSError:
        return ""


def until(done: Callable[[], bool], seconds: float = 10.0) -> bool:
    end = time.monotonic() + seconds
    while not done() and time.monotonic() < end:
        time.sleep(0.05)
    return done()
