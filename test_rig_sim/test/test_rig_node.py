"""The node itself, in this process, against a partner that plays the impedance controller."""

import math
import time
from typing import Any

import pytest

pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")
pytest.importorskip("rclpy")

from phil_interfaces.msg import ImpedanceCommand
from rig_ride import CYCLES, after, rides_of_a_node, sine  # noqa: F401
from std_srvs.srv import Trigger

from phil_node.services import QUIET, reset
from test_rig_sim.node import ASKING, ENDED, WAITING
from test_rig_sim.supervisor import Mode

pytestmark = pytest.mark.integration


def test_lockstep_ride_is_complete_and_ends_after_its_last_command(ride: Any) -> None:
    found = ride(sine)
    found.run()
    assert [s[0] for s in found.states] == list(range(CYCLES))
    assert [s[2] for s in found.states] == [False] * (CYCLES - 1) + [True]
    assert [s[1] for s in found.states] == [Mode.HOLD] + [Mode.TRACKING] * (CYCLES - 1)
    assert found.states[7][3] == (0, 14_000_000)
    assert found.rig._drive.supervisor.mode is Mode.STOPPED
    assert found.rig.timing.late == found.rig.timing.stale == found.rig.timing.refused == 0
    answer = found.rig._serve_emergency_stop(Trigger.Request(), Trigger.Response())
    assert answer.success and answer.message == "the ride is over, drive rests"


def test_two_lockstep_rides_are_equal(ride: Any) -> None:
    first = ride(sine)
    first.run()
    first.close()
    second = ride(sine)
    second.run()
    assert first.states == second.states


def test_nan_and_out_of_limit_commands_are_refused_and_bridged(ride: Any) -> None:
    bad = {20: (math.nan, 0.0), 21: (0.0, math.inf), 22: (5.0, 5.0)}
    found = ride(lambda k: bad.get(k, sine(k)))
    found.run()
    assert found.rig.timing.refused == 3
    assert [s[1] for s in found.states[20:25]] == [
        Mode.TRACKING,
        Mode.BRIDGING,
        Mode.HOLDING,
        Mode.HOLDING,
        Mode.TRACKING,
    ]
    assert len(found.states) == CYCLES


def test_emergency_stop_retracts_and_ends_the_ride(ride: Any) -> None:
    answers: list[Any] = []

    def answer(k: int) -> tuple[float, float]:
        if k == 30:
            answers.append(found.rig._serve_emergency_stop(Trigger.Request(), Trigger.Response()))
        return sine(k)

    found = ride(answer, duration=10.0)
    found.run()
    assert answers[0].success
    assert found.states[31][1] == Mode.RETRACTING
    assert found.states[-1][1:3] == (Mode.STOPPED, True)
    assert "emergency stop" in found.rig.diagnose().message


def test_state_without_an_answer_is_repeated(ride: Any) -> None:
    silent = {10: 2}

    def answer(k: int) -> tuple[float, float] | None:
        silent[k] = silent.get(k, 0) - 1
        return None if silent[k] >= 0 else sine(k)

    found = ride(answer)
    found.run()
    assert len(found.states) == CYCLES
    assert found.rig.timing.stale == 0


@pytest.mark.alone
def test_realtime_ride_of_a_silent_partner_is_bridged_held_and_retracted(ride: Any) -> None:
    found = ride(lambda k: sine(k) if k < 20 else None, mode="realtime", duration=10.0, late_limit=10)
    found.run()
    modes = [s[1] for s in found.states]
    # Late commands before cycle 20 depend on the machine; that the last nine before the retract were bridged or held
    # does not.
    end = modes.index(Mode.RETRACTING)
    assert 20 < end <= 30
    assert set(modes[end - 9 : end]) <= {Mode.BRIDGING, Mode.HOLDING}
    assert modes[-1] == Mode.STOPPED
    assert found.states[-1][2]
    assert found.states[-1][8] >= 10
    assert "10 successive cycles without a usable command (10 late, 0 refused)" in found.rig.diagnose().message


def test_lockstep_ride_of_refused_commands_retracts_and_says_so(ride: Any) -> None:
    found = ride(lambda k: sine(k) if k < 20 else (5.0, 5.0), duration=10.0, late_limit=10)
    found.run()
    assert [s[1] for s in found.states].index(Mode.RETRACTING) == 30
    assert found.rig.timing.refused >= 10
    wanted = "stopped: 10 successive cycles without a usable command (0 late, 10 refused: "
    wanted += "the command asks for a position of 5000 mm, at most 350 mm trips, 10 times)"
    assert found.rig.diagnose().message == wanted


@pytest.mark.parametrize(("shift", "ends"), [(0.0, Mode.TRACKING), (0.001, Mode.RETRACTING)], ids=["equal", "other"])
def test_a_second_command_for_a_cycle_retracts_only_if_it_differs(ride: Any, shift: float, ends: Mode) -> None:
    found = ride(sine, duration=0.0)
    send = found.send

    def send_twice(k: int, header: Any) -> None:
        send(k, header)
        if k == 20:
            found.answer = lambda k: (sine(k)[0] + shift, sine(k)[1] + shift)
            send(k, header)
            found.answer = sine

    found.send = send_twice
    found.run(until=lambda: len(found.states) >= 40)
    assert found.states[-1][1] == ends
    assert found.rig.timing.stale == found.rig.timing.refused == 0
    if ends is Mode.RETRACTING:
        assert "two commands for cycle 20 differ" in found.rig.diagnose().message


def test_late_lost_doubled_and_swapped_commands_are_counted_and_each_has_its_policy(ride: Any) -> None:
    """The test makes the ticks itself: `tick` ends a cycle whose command has not come."""
    found = ride(sine, duration=0.0, late_limit=6)
    rig = found.rig
    rig.trigger_configure()
    rig.trigger_activate()
    rig._phase = ASKING
    rig._publish()

    def send(*cycles: int) -> str:
        for k in cycles:
            u = sine(k)
            rig._take_command(ImpedanceCommand(cycle=k, u_tr=u[0], u_tr_next=u[1]))
        return rig._drive.mode.name

    def tick(times: int = 1) -> str:
        for _ in range(times):
            rig._advance()
        return rig._drive.mode.name

    def counts() -> list[int]:
        shown = rig.health.diagnosis().values
        assert shown["input impedance_mpc/command"] == str(rig._commands)
        return [int(shown[f"messages {kind}"]) for kind in ("late", "lost", "doubled", "swapped")]

    assert send(*range(20)) == "TRACKING" and counts() == [0, 0, 0, 0]
    # lost: bridged by the prediction of the command before, then followed again
    assert tick() == "BRIDGING" and send(21) == "TRACKING" and counts() == [0, 1, 0, 0]
    # late: its prediction is the newest there is, and bridges another cycle
    assert tick() == "BRIDGING" and send(22) == "BRIDGING" and counts() == [1, 1, 0, 0]
    assert tick() == "BRIDGING" and send(24) == "TRACKING" and counts() == [1, 2, 0, 0]
    # doubled: nothing happens
    before = rig._drive.cycle
    assert send(24, 24, 3) == "TRACKING" and counts() == [1, 2, 3, 0] and rig._drive.cycle == before == 25
    # swapped: the newer one is followed, the older one is late
    assert tick() == "BRIDGING" and send(26, 25) == "TRACKING" and counts() == [2, 2, 3, 1]
    # lost for longer: bridged, held, and followed again if it comes before `late_limit`
    assert tick(2) == "HOLDING" and tick(3) == "HOLDING" and send(32) == "TRACKING" and counts() == [2, 7, 3, 1]
    assert tick(5) == "HOLDING" and tick() == "RETRACTING"
    assert "6 successive cycles without a usable command (6 late, 0 refused)" in rig.diagnose().message
    assert send(38) == "RETRACTING" and counts() == [3, 12, 3, 1]
    # refused: it has not come
    rig._take_command(ImpedanceCommand(cycle=39, u_tr=math.nan))
    assert send(40) == "RETRACTING" and counts() == [3, 13, 3, 1]
    assert (rig.timing.stale, rig.timing.refused) == (2, 1)
    rig.reset()
    assert counts() == [0, 0, 0, 0]


def test_commands_of_an_old_plan_are_followed_until_the_solver_has_failed_for_too_long(ride: Any) -> None:
    found = ride(sine, duration=10.0, late_limit=10)

    def send(k: int, header: Any) -> None:
        u, status = sine(k), ImpedanceCommand.FALLBACK if k >= 20 else ImpedanceCommand.SOLVED
        found.commands.publish(ImpedanceCommand(header=header, cycle=k, u_tr=u[0], u_tr_next=u[1], status=status))

    found.send = send
    found.run()
    modes = [s[1] for s in found.states]
    assert modes.index(Mode.RETRACTING) == 30 and set(modes[1:30]) == {Mode.TRACKING}
    assert found.rig.diagnose().message.endswith(
        "10 successive commands are from an old plan: the controller's solver fails"
    )


@pytest.mark.parametrize("speaking", [True, False], ids=["commands go on", "nobody answers"])
@pytest.mark.alone
def test_realtime_emergency_stop_comes_to_rest_while_the_node_stays_active(ride: Any, speaking: bool) -> None:
    found = ride(lambda k: sine(k) if speaking else None, mode="realtime", duration=0.0)
    found.run(until=lambda: len(found.states) >= (80 if speaking else 1))
    assert found.rig._serve_emergency_stop(Trigger.Request(), Trigger.Response()).success
    assert found.rig.diagnose().message == "retracting: emergency stop"
    found.spin()
    assert found.states[-1][1:3] == (Mode.STOPPED, True)
    assert found.states[-1][4] == pytest.approx(found.rig.parameters.retract.position, abs=1e-3)
    modes = [s[1] for s in found.states]
    if speaking:
        assert Mode.RETRACTING in modes
    assert found.rig.active
    diagnosis = found.rig.diagnose()
    assert (diagnosis.message, diagnosis.level) == ("stopped: emergency stop", b"\x02")
    rest = len(found.states)
    found.spin(spins=20, until=lambda: False)
    assert len(found.states) == rest


def test_ride_waits_for_every_listener_that_the_graph_knows(ride: Any) -> None:
    found = ride(sine)
    found.rig.count_subscribers = lambda topic: 2 if topic == "/test_rig_sim/state" else 0
    patience = after(30.0)
    found.run(spins=10**6, until=lambda: found.rig._listeners == (1, 2) or patience())
    found.spin(spins=10**6, until=after(0.8))  # longer than it waits once all are matched
    assert found.rig._state_out.get_subscription_count() == 1
    assert found.rig._phase == WAITING
    assert found.rig.diagnose().values["listeners"] == "1 matched of 2, 1 wanted"
    del found.rig.count_subscribers
    found.spin()
    assert len(found.states) == CYCLES


@pytest.mark.parametrize(("duration", "cycles"), [(0.0001, 1), (0.002, 1), (0.004, 2)])
def test_short_ride_has_at_least_one_cycle(ride: Any, duration: float, cycles: int) -> None:
    found = ride(sine, duration=duration)
    found.run()
    assert [s[2] for s in found.states] == [False] * (cycles - 1) + [True]
    assert found.rig._phase == ENDED


def test_reset_begins_anew_with_cycle_zero(ride: Any) -> None:
    found = ride(sine)
    found.run()
    first = list(found.states)
    found.states.clear()
    time.sleep(QUIET)  # the base takes no reset before
    assert reset(found.rig, Trigger.Request(), Trigger.Response()).success
    found.spin()
    assert found.states == first
