"""Start-up and shut-down of the nodes by themselves: in any order, twice, without a peer, with signals."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from client import Client

pytestmark = [pytest.mark.integration, pytest.mark.alone]

NODES = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor")
CATENARY, CONTROLLER, RIG, MONITOR = NODES
SHORT = 0.2
"""s, length of a ride."""
ORDER = (RIG, CONTROLLER, CATENARY, MONITOR)
"""It and its reverse have every pair of nodes in both orders."""


class Stand(Client):
    """The four nodes in processes of their own."""

    def __init__(self, environment: dict[str, str]) -> None:
        from ride.lifecycle import Managed

        self.environment = environment
        rig = ["-p", f"duration:={SHORT}", "-p", "wait_for_subscribers:=2"]
        controller = ["-p", "model_timeout:=0.5"]
        words = {RIG: ["--ros-args", *rig], CONTROLLER: ["--ros-args", *controller]}
        super().__init__(environment, "stand", {name: words.get(name, []) for name in NODES})
        self.managed = {name: Managed(self.node, name, self.spin) for name in NODES}
        for managed in self.managed.values():
            managed.wait(60.0)

    def go(self, name: str, transition: int) -> None:
        self.managed[name].go(transition, 120.0)

    def says(self, name: str, level: bytes, text: str, seconds: float = 20.0) -> None:
        """Wait until a node says that, at that level."""
        found = self.until(lambda: self._says(name, level, text), seconds)
        assert found, f"{name}: {self.status[name].level!r} {self.status[name].message}"

    def _says(self, name: str, level: bytes, text: str) -> bool:
        status = self.status.get(name)
        return status is not None and status.level == level and text in status.message

    def value(self, name: str, key: str) -> str:
        """Give what a node said last, empty if it has said nothing of it yet."""
        status = self.status.get(name)
        return next((entry.value for entry in status.values if entry.key == key), "") if status is not None else ""

    def reset(self, *names: str) -> None:
        from std_srvs.srv import Trigger

        for name in names:
            answer = self.call(Trigger, f"{name}/reset", Trigger.Request())
            assert answer.success, answer.message


def segments(stand: Stand) -> set[str]:
    """Give the names of the middleware's shared memory that the nodes have mapped."""
    maps = [Path(f"/proc/{process.pid}/maps").read_text() for process in stand.processes]
    return {Path(line.split()[-1]).name for text in maps for line in text.splitlines() if "/dev/shm/fast" in line}


@pytest.fixture(scope="module")
def stand(node_environment: dict[str, str]) -> Iterator[Stand]:
    made = Stand(node_environment)
    yield made
    made.close()


def test_the_controller_alone_says_whom_it_lacks(stand: Stand) -> None:
    from ride.lifecycle import CONFIGURE, RideError

    for name in (RIG, MONITOR):
        stand.go(name, CONFIGURE)
    with pytest.raises(RideError, match="refused to configure"):
        stand.go(CONTROLLER, CONFIGURE)
    stand.says(CONTROLLER, b"\x01", "cannot configure: no message on catenary_model/impedance_model")
    assert stand.set_on(CONTROLLER, model_timeout=30.0).successful
    for name in (CATENARY, CONTROLLER):
        stand.go(name, CONFIGURE)
    stand.says(CONTROLLER, b"\x00", "configured")


def test_the_nodes_ride_in_whatever_order_they_are_activated(stand: Stand) -> None:
    """Two rides with the same nodes, deactivated in the order in which they were activated."""
    from ride.lifecycle import ACTIVATE, DEACTIVATE

    for order in (ORDER, ORDER[::-1]):
        for name in order:
            stand.go(name, ACTIVATE)
        assert stand.until(lambda: stand.value(RIG, "outcome") == "through"), stand.status[RIG].message
        stand.says(MONITOR, b"\x00", "ride complete, books agree")
        levels = {name: stand.status[name].level for name in NODES}
        assert levels == dict.fromkeys(NODES, b"\x00"), [stand.status[name].message for name in NODES]
        if order is not ORDER:  # nobody tells the catenary that the ride is over
            stand.says(CATENARY, b"\x03", "no usable command since cycle 99: the ride is over")
        for name in order:
            stand.go(name, DEACTIVATE)


def test_a_second_node_of_a_name_does_not_start(stand: Stand) -> None:
    command = [sys.executable, "-m", f"{RIG}.node"]
    began = time.monotonic()
    second = subprocess.run(command, env=stand.environment, capture_output=True, text=True, timeout=60, check=False)
    assert second.returncode == 2 and time.monotonic() - began < 30.0
    assert second.stderr.count("\n") == 1
    number = stand.processes[NODES.index(RIG)].pid
    assert f"/{RIG} already runs on this machine" in second.stderr and f"(process {number})" in second.stderr
    stand.says(RIG, b"\x00", "configured")


def test_a_catenary_that_goes_and_comes_back_takes_part_after_resets(stand: Stand) -> None:
    from ride.lifecycle import ACTIVATE, CONFIGURE, Managed

    # The machine may be busy: 0.8 s without a command.
    assert stand.set_on(RIG, duration=0.0, mode="realtime", late_limit=400).successful
    for name in NODES:
        stand.go(name, ACTIVATE)
    assert stand.until(lambda: stand.value(RIG, "in contact") == "yes" and int(stand.value(RIG, "cycle")) > 500)
    place = NODES.index(CATENARY)
    stand.processes[place].send_signal(signal.SIGHUP)  # the terminal is gone
    assert stand.processes[place].wait(20.0) == 0
    stand.says(RIG, b"\x02", "successive cycles without a usable command")
    assert "catenary_model" in stand.value(RIG, "to go on")
    stand.says(CONTROLLER, b"\x03", f"of {CATENARY}")
    command = [sys.executable, "-m", f"{CATENARY}.node"]
    assert stand.until(lambda: stand.node.count_services(f"{CATENARY}/change_state") == 0)
    stand.processes[place] = subprocess.Popen(command, env=stand.environment, start_new_session=True)
    stand.managed[CATENARY] = managed = Managed(stand.node, CATENARY, stand.spin)
    managed.wait(60.0)
    stand.says(RIG, b"\x02", "stopped: ")
    for transition in (CONFIGURE, ACTIVATE):
        stand.go(CATENARY, transition)
    before = int(stand.value(RIG, "cycle"))
    stand.reset(RIG)  # alone: the controller says that it was left behind, and nothing moves
    stand.says(CONTROLLER, b"\x03", "call impedance_mpc/reset")
    stand.reset(MONITOR, CONTROLLER)  # the controller last: with it the ride begins, and a monitor in a ride refuses
    assert stand.until(lambda: stand.value(RIG, "phase") == "ticking" and int(stand.value(RIG, "cycle")) < before)
    stand.says(CONTROLLER, b"\x00", "active")


def test_nodes_end_in_order_on_any_signal_and_leave_nothing(stand: Stand) -> None:
    """While they ride; a second signal at once is the first one come twice."""
    from phil_node.instance import claimed
    from phil_node.shared_memory import litter, snapshot

    before = snapshot() - segments(stand)
    kinds = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGINT)
    for process, kind in zip(stand.processes, kinds, strict=True):
        process.send_signal(kind)
    stand.processes[3].send_signal(signal.SIGINT)
    assert [process.wait(20.0) for process in stand.processes] == [0, 0, 0, 0]
    domain = int(os.environ["PHIL_TEST_DOMAIN_RIDES"])
    assert not any(claimed(f"/{name}", domain) for name in NODES)
    unused = [name for name in litter(before) if "port" not in name]
    assert not unused, "shared memory was left behind"
