"""What listens: nodes, recorder and viewers of one machine find each other, and the network reaches none of them."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from sockets import Socket, sockets_of

from phil_node.surroundings import OF_TRANSPORTS, RANGE, addresses

pytestmark = pytest.mark.integration

UNIX_PREFIXES = ("@phil-catenary/", "@phil")
"""How the names of Unix sockets between nodes of one ride may begin."""
LOOPBACK = "127.0.0.1"
VIEWER = """
import sys, time, rclpy
rclpy.init()
node = rclpy.create_node("viewer")
end = time.monotonic() + 15.0
wanted = {"energy_monitor", "ride_recorder"}
while time.monotonic() < end and not wanted <= set(node.get_node_names()):
    rclpy.spin_once(node, timeout_sec=0.1)
print(*sorted(set(node.get_node_names()) & wanted))
"""


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory, node_environment: dict[str, str]) -> Iterator[list[int]]:
    """Start a node and a recorder as somebody does who set nothing."""
    logs = tmp_path_factory.mktemp("sockets")
    plain = {key: value for key, value in node_environment.items() if key not in (RANGE, *OF_TRANSPORTS)}
    commands = (["energy_monitor.node"], ["energy_monitor.record", "--out", str(logs / "bag")])
    started = [
        subprocess.Popen([sys.executable, "-m", *command], env=plain, stdout=log, stderr=log)
        for command in commands
        for log in [(logs / f"{command[0]}.log").open("w")]
    ]
    deadline = time.monotonic() + 30.0
    try:
        while any(len([one for one in sockets_of(child.pid) if one.address == LOOPBACK]) < 4 for child in started):
            assert all(child.poll() is None for child in started) and time.monotonic() < deadline
            time.sleep(0.1)
        yield [child.pid for child in started]
    finally:
        for child in started:
            child.terminate()
        for child in started:
            child.wait(20.0)


def send_to(bound: Socket) -> None:
    """Send a word to a socket."""
    address = bound.address if bound.address != "0.0.0.0" else LOOPBACK
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(b"is anybody there?", (address, bound.port))


def test_nothing_listens_to_the_network(processes: list[int]) -> None:
    for pid in processes:
        found = sockets_of(pid)
        assert {one.kind for one in found} <= {"udp", "unix"}
        assert all(one.path.startswith(UNIX_PREFIXES) for one in found if one.kind == "unix")
        internet = [one for one in found if one.kind == "udp"]
        # Discovery and messages, at the ports of DDS (7400 + 250 domain + ...): for this machine alone.
        listening = [one for one in internet if 7000 <= one.port < 32768 or one.address == LOOPBACK]
        assert len(listening) >= 3 and {one.address for one in listening} == {LOOPBACK}
        # The others only send: what comes to them is read by nobody.
        others = [one for one in internet if one not in listening]
        for one in others:
            send_to(one)
        time.sleep(0.3)
        later = {one.port: one.waiting for one in sockets_of(pid)}
        assert all(later[one.port] > one.waiting for one in others)


def test_no_node_shares_memory_with_viewers(processes: list[int]) -> None:
    for pid in processes:
        assert "/dev/shm/fastrtps" not in Path(f"/proc/{pid}/maps").read_text()
        threads = [(task / "comm").read_text() for task in Path(f"/proc/{pid}/task").iterdir()]
        assert any(name.startswith("dds.udp") for name in threads)
        assert not any(name.startswith("dds.shm") for name in threads)


def test_viewers_of_this_machine_need_no_setting(processes: list[int], node_environment: dict[str, str]) -> None:
    surroundings = {key: value for key, value in node_environment.items() if key not in (RANGE, *OF_TRANSPORTS)}
    surroundings[RANGE] = "SUBNET"  # what ROS takes where nothing is set
    seen = subprocess.run([sys.executable, "-c", VIEWER], env=surroundings, capture_output=True, text=True, check=True)
    assert seen.stdout.split() == ["energy_monitor", "ride_recorder"]


def test_the_machine_knows_its_addresses() -> None:
    shown = Path("/proc/net/fib_trie").read_text() if os.access("/proc/net/fib_trie", os.R_OK) else ""
    for address in addresses():
        assert not address.startswith("127.") and (not shown or address in shown)
