"""What the run script takes from the topics of a ride, and from those who are no part of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue  # noqa: E402
from phil_interfaces.msg import ConservedQuantities, CycleTiming  # noqa: E402

from ride.watch import AWAKE, Watch  # noqa: E402

PROCESSES = {"test_rig_sim": 11, "impedance_mpc": 12, "energy_monitor": 13}
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
STALE = DiagnosticStatus.STALE


@pytest.fixture(scope="module")
def node() -> Iterator[Any]:
    rclpy.init()
    made = rclpy.create_node("ride", start_parameter_services=False)
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


@pytest.fixture
def watch(node: Any) -> Watch:
    return Watch(node, 0.002, PROCESSES, 499)


def say(watch: Watch, level: bytes, hardware: str, message: str, before: str = "", **values: str) -> None:
    pairs = [KeyValue(key=key.replace("_", " "), value=value) for key, value in values.items()]
    status = DiagnosticStatus(
        level=level, name=f"{before}{hardware}: cycle", hardware_id=hardware, message=message, values=pairs
    )
    watch._take_diagnostics(DiagnosticArray(status=[status]))


@pytest.mark.parametrize(
    ("hardware", "process"),
    [
        ("nuc7", ""),  # another device
        ("test_rig_sim", ""),  # a rig of before full names were given, or somebody who imitates one
        ("/rig_b/test_rig_sim", "11"),  # a rig in a namespace
        ("/test_rig_sim", "7"),  # the rig of a ride before, or a bag that is played
        ("/test_rig_sim", ""),
    ],
)
def test_others_end_no_ride(watch: Watch, hardware: str, process: str) -> None:
    say(watch, OK, hardware, "stopped: landed", process=process, mode="stopped", outcome="landed")
    say(watch, ERROR, hardware, "retracting: emergency stop", process=process, mode="retracting")
    say(watch, WARN, hardware, "hot", process=process)
    assert not watch.landed and not watch.retracts("test_rig_sim")
    assert (watch.errors, watch.warnings, watch.reasons) == ({}, {}, "")


def test_an_aggregator_does_not_speak_for_our_nodes(watch: Watch) -> None:
    """It says again what they said, under a name and a level of its own."""
    say(watch, ERROR, "/test_rig_sim", "stale", before="/rigs", process="11", mode="stopped", outcome="landed")
    assert (watch.errors, watch.said, watch.landed) == ({}, {}, False)


def test_a_ride_is_over_when_the_rig_says_so_and_the_monitor_is_not_held_up(watch: Watch) -> None:
    say(watch, OK, "/energy_monitor", "active", process="13", phase="ended")
    for phase, over in (("waiting for a command", False), ("ticking", False), ("ended", True)):
        say(watch, OK, "/test_rig_sim", "stopped, ended", process="11", phase=phase)
        assert watch.over is over
    watch.said["energy_monitor"].at -= AWAKE
    assert not watch.over


def test_a_monitor_that_catches_up_is_heard(watch: Watch) -> None:
    watch._take_timing(CycleTiming(cycle=499))
    watch.moved = watch.heard = 0.0
    watch._take_books(ConservedQuantities(cycle=100))
    assert watch.moved == 0.0 < watch.heard


def test_the_state_of_our_nodes_is_in_keys(watch: Watch) -> None:
    say(watch, ERROR, "/test_rig_sim", "whatever", process="11", mode="retracting", outcome="")
    assert watch.retracts("test_rig_sim") and not watch.landed
    assert watch.errors == {"test_rig_sim": "whatever"}
    say(watch, OK, "/test_rig_sim", "stopped: landed", process="11", mode="hold", outcome="")
    assert not watch.landed
    say(watch, OK, "/test_rig_sim", "whatever", process="11", mode="stopped", outcome="landed")
    assert watch.landed


def test_reasons_stand_once_with_their_number(watch: Watch) -> None:
    text = "state 300 of the rig was refused: f_tr is not finite"
    say(watch, WARN, "/impedance_mpc", text, process="12", refused="7")
    watch.said["impedance_mpc"].values[f"reason: {text}"] = "7"
    say(watch, OK, "/test_rig_sim", "hold", process="11", phase="waiting for listeners", listeners="1 matched of 3")
    wanted = f"impedance_mpc: {text} (7 times); test_rig_sim is waiting for listeners (1 matched of 3)"
    assert watch.reasons == wanted


@pytest.mark.parametrize("level", [WARN, STALE])
def test_only_an_error_ends_a_ride(watch: Watch, level: bytes) -> None:
    """STALE has the largest number, but says only that nothing comes for now."""
    say(watch, level, "/impedance_mpc", "no command since cycle 7", process="12")
    assert watch.errors == {} and watch.warnings == {"impedance_mpc": "no command since cycle 7"}
    assert watch.reasons == "impedance_mpc: no command since cycle 7"


@pytest.mark.parametrize(
    ("heard_by", "named"),
    [
        ("energy_monitor, ride_recorder", ": impedance_mpc not among them"),
        ("-", ": impedance_mpc and energy_monitor not among them"),
        ("energy_monitor, impedance_mpc, plotjuggler", ""),
    ],
)
def test_a_rig_without_listeners_is_told_by_their_names(watch: Watch, heard_by: str, named: str) -> None:
    values = {"phase": "waiting for listeners", "listeners": "1 matched of 3", "heard_by": heard_by}
    say(watch, OK, "/test_rig_sim", "hold", process="11", **values)
    assert watch.reasons == f"test_rig_sim is waiting for listeners (1 matched of 3){named}"


def test_a_rig_that_nobody_answers_is_a_reason_where_there_is_no_other(watch: Watch) -> None:
    say(watch, OK, "/test_rig_sim", "tracking", process="11", phase="waiting for a command", cycle="300")
    assert watch.reasons.startswith("test_rig_sim is waiting for a command (cycle 300)")
    say(watch, WARN, "/impedance_mpc", "state 300 of the rig was refused", process="12")
    assert watch.reasons == "impedance_mpc: state 300 of the rig was refused"


def test_cycles_beyond_the_last_are_not_of_this_ride(watch: Watch) -> None:
    watch._take_timing(CycleTiming(cycle=2000))
    watch._take_books(ConservedQuantities(cycle=2000))
    assert watch.cycle == -1 and not watch.through()
    watch._take_timing(CycleTiming(cycle=499))
    watch._take_books(ConservedQuantities(cycle=499))
    assert watch.through()
