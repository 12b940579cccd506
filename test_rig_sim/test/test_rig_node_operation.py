"""What an operator does to the node: operating modes, landing, stops, reset; and the clock of a ride in real time."""

from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")
pytest.importorskip("rclpy")

from lifecycle_msgs.msg import Transition
from phil_interfaces.msg import ImpedanceCommand
from rclpy.parameter import Parameter
from rig_ride import CYCLES, rides_of_a_node, sine  # noqa: F401
from std_srvs.srv import Trigger

from phil_node.services import reset
from test_rig_sim import node as module
from test_rig_sim.node import ASKING, ENDED, TICKING
from test_rig_sim.supervisor import Mode

pytestmark = pytest.mark.integration
PERIOD = 0.002


def choose(rig: Any, mode: str) -> None:
    assert rig.set_parameters([Parameter("operating_mode", value=mode)])[0].successful


def stay(found: Any) -> Any:
    """Answer like a controller that lets the drive where it is."""

    def answer(k: int) -> tuple[float, float]:
        reference = found.rig._message.reference
        return reference, reference

    return answer


def test_operating_modes_are_switched_during_a_ride(ride: Any) -> None:
    switches = {10: "hold", 20: "position", 40: "impedance"}
    found = ride(sine, **{"trajectory.center": -0.1})

    def answer(k: int) -> tuple[float, float]:
        if k in switches:
            choose(found.rig, switches[k])
        return stay(found)(k)

    found.answer = answer
    found.run()
    modes = [s[1] for s in found.states]
    wanted = [Mode.TRACKING] * 10 + [Mode.HOLD] * 10 + [Mode.POSITION] * 20 + [Mode.TRACKING] * (CYCLES - 41)
    assert modes[1:] == wanted
    references = [s[9] for s in found.states]
    speeds = [(b - a) / PERIOD for a, b in pairwise(references)]
    assert min(speeds[20:40]) < -0.1  # 20 cycles of 5 m/s^2 towards the trajectory
    steps = [abs(b - a) for a, b in pairwise(speeds[:40])]
    assert max(steps) <= found.rig.parameters.motion.acceleration * PERIOD + 1e-9
    assert found.rig.diagnose().values["operating mode"] == "impedance"


def test_position_in_real_time_needs_no_controller(ride: Any) -> None:
    found = ride(lambda k: None, mode="realtime", operating_mode="position", duration=0.1)
    found.run(until=lambda: bool(found.states) and found.states[-1][2])
    assert [s[1] for s in found.states[1:]] == [Mode.POSITION] * 49
    assert found.states[-1][8] == 0  # nobody was waited for


def test_landing_ends_the_ride_at_rest_and_is_no_error(ride: Any) -> None:
    answers: list[Any] = []
    found = ride(sine, duration=20.0, **{"run_in": 0.1, "touch.landing_speed": 0.3, "touch.acceleration": 5.0})
    before = found.rig._serve_land(Trigger.Request(), Trigger.Response())
    assert not before.success and "not active" in before.message

    def answer(k: int) -> tuple[float, float]:
        if k == 30:
            answers.append(found.rig._serve_land(Trigger.Request(), Trigger.Response()))
        return stay(found)(k)

    found.answer = answer
    found.run()
    assert answers[0].success
    modes = [s[1] for s in found.states]
    assert set(modes[31:-1]) == {Mode.LANDING}
    assert found.states[-1][1:3] == (Mode.STOPPED, True)
    assert abs(found.states[-1][6]) < 3.0  # N: noise only
    diagnosis = found.rig.diagnose()
    assert diagnosis.message.startswith("stopped: landed") and diagnosis.level == b"\x00"
    after = found.rig._serve_land(Trigger.Request(), Trigger.Response())
    assert not after.success and "ended" in after.message
    # A landing is no trip: the next ride needs no reset.
    found.rig.trigger_deactivate()
    assert found.rig.trigger_activate().value == Transition.TRANSITION_CALLBACK_SUCCESS


def test_landing_at_the_end_of_the_ride(ride: Any) -> None:
    found = ride(sine, land_at_end=True, **{"run_in": 0.1, "touch.landing_speed": 0.3, "touch.acceleration": 5.0})
    found.answer = stay(found)
    found.run()
    modes = [s[1] for s in found.states]
    assert modes.index(Mode.LANDING) == CYCLES
    assert [s[2] for s in found.states] == [False] * (len(modes) - 1) + [True]
    assert modes[-1] == Mode.STOPPED


def test_soft_start_comes_down_before_the_commands_are_followed(ride: Any) -> None:
    found = ride(sine, duration=0.0, start="apart", **{"touch.speed": 0.1, "touch.acceleration": 5.0, "run_in": 0.2})
    found.answer = stay(found)
    found.run(until=lambda: found.states and found.states[-1][1] == Mode.TRACKING)
    modes = [s[1] for s in found.states]
    assert modes[0] == Mode.HOLD
    assert set(modes[1:-1]) == {Mode.APPROACHING}
    # 20 mm at 0.1 m/s, and some cycles to believe the touch
    assert 0.02 / 0.1 / PERIOD < len(modes) < 0.03 / 0.1 / PERIOD


def test_nothing_rearms_after_a_trip_but_a_reset(ride: Any) -> None:
    found = ride(sine, duration=0.0)

    def answer(k: int) -> tuple[float, float]:
        if k == 30:
            found.rig._drive.rig.plant = found.rig._drive.rig.plant._replace(  # a load cell gone wild
                cell=found.rig._drive.rig.plant.cell._replace(bias=5000.0)
            )
        if k > 40:
            # Whoever does what while the rig retracts: it goes on.
            choose(found.rig, ("hold", "position", "impedance")[k % 3])
            assert not found.rig._serve_land(Trigger.Request(), Trigger.Response()).success
        return sine(k)

    found.answer = answer
    found.run()
    modes = [s[1] for s in found.states]
    tripped = modes.index(Mode.RETRACTING)
    assert 30 < tripped <= 33
    assert set(modes[tripped:-1]) == {Mode.RETRACTING}
    assert modes[-1] == Mode.STOPPED
    diagnosis = found.rig.diagnose()
    assert diagnosis.level == b"\x02" and "limits.trip_force" in diagnosis.message
    assert "limits.trip_force" in diagnosis.values["reason"]
    rest, rig = len(found.states), found.rig
    choose(rig, "impedance")
    rig._take_command(ImpedanceCommand(cycle=rig._drive.cycle, u_tr=0.1, u_tr_next=0.1))
    found.spin(spins=10, until=lambda: False)
    assert len(found.states) == rest and rig._phase == ENDED
    # Neither activation nor configuration forgives it.
    rig.trigger_deactivate()
    assert rig.trigger_activate().value == Transition.TRANSITION_CALLBACK_FAILURE
    rig.trigger_cleanup()
    rig.trigger_configure()
    assert rig.trigger_activate().value == Transition.TRANSITION_CALLBACK_FAILURE
    assert reset(rig, Trigger.Request(), Trigger.Response()).success
    assert rig.trigger_activate().value == Transition.TRANSITION_CALLBACK_SUCCESS


def test_a_trajectory_that_the_drive_cannot_follow_is_refused_by_name(
    ride: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ride(sine, **{"trajectory.frequency": 40.0})
    said: list[str] = []
    monkeypatch.setattr(found.rig, "get_logger", lambda: SimpleNamespace(error=said.append, info=said.append))
    assert found.rig.trigger_configure().value == Transition.TRANSITION_CALLBACK_FAILURE
    assert any("trajectory.amplitude, trajectory.frequency: the trajectory asks for" in line for line in said)


# The clock, with a time that the test sets ------------------------------------------------------------------------


@pytest.fixture
def ticking(ride: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A rig in real time at cycle 0, published at t = 0, whose clock stands still unless the test sets it (s)."""
    found = ride(sine, mode="realtime", duration=0.0, operating_mode="impedance")
    rig, clock = found.rig, SimpleNamespace(now=0.0)
    rig.trigger_configure()
    rig.trigger_activate()
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: clock.now))
    wall = SimpleNamespace(nanoseconds=7_000_000_000)
    monkeypatch.setattr(rig, "get_clock", lambda: SimpleNamespace(now=lambda: wall))
    rig._phase = ASKING
    rig._publish()
    rig._start_ticking()
    rig._tick.cancel()
    also: list[float] = []
    monkeypatch.setattr(rig._tick, "also", also.append)

    def at(cycles: float) -> None:
        clock.now = cycles * PERIOD
        rig._on_tick()

    def command(cycle: int, at: float, u: float = 0.0) -> None:
        clock.now = at * PERIOD
        rig._take_command(ImpedanceCommand(cycle=cycle, u_tr=u, u_tr_next=u))

    yield SimpleNamespace(rig=rig, at=at, command=command, also=also)


def test_a_command_of_a_cycle_that_was_not_published_is_refused(ticking: Any) -> None:
    rig = ticking.rig
    for cycle in (1, 2, 1000):
        ticking.command(cycle, 0.5, 0.01)
    assert rig.timing.stale == 3
    assert rig._command is None and not rig._answered
    ticking.command(0, 0.6, 1e-4)  # the right one is still taken
    assert rig._command == (1e-4, 1e-4)
    ticking.at(1.0)
    assert rig._drive.mode is Mode.TRACKING
    ticking.command(5, 1.5)
    assert rig.timing.stale == 4 and rig._command is None


def test_a_command_has_its_time_even_after_a_late_tick(ticking: Any) -> None:
    rig = ticking.rig
    ticking.command(0, 0.5)
    ticking.at(1.0)
    assert rig._drive.cycle == 1
    ticking.command(1, 1.5)
    ticking.at(2.8)  # a tick that is 0.8 cycles late publishes state 2 at 2.8
    assert rig._drive.cycle == 2
    ticking.at(3.0)  # due, but the command had 0.2 cycles only
    assert rig._drive.cycle == 2 and rig._late_ticks == 1 and rig.timing.late == 0
    ticking.command(2, 3.4)  # it ends the cycle by itself
    assert rig._drive.cycle == 3 and rig.timing.late == 0
    ticking.at(4.0)  # 0.6 cycles: not yet
    assert rig._drive.cycle == 3 and rig._late_ticks == 2
    # Not at the next tick, but as soon as each had its 0.9 cycles.
    assert ticking.also == pytest.approx([(2.8 + 0.9) * PERIOD, (3.4 + 0.9) * PERIOD])
    ticking.at(4.31)  # nothing came
    assert rig._drive.cycle == 4 and rig.timing.late == 1
    assert rig._drive.mode is Mode.BRIDGING


def test_a_rig_that_is_behind_its_clock_comes_back_to_it_though_no_command_is_in_time(ticking: Any) -> None:
    """It went at half its pace as long as each cycle began more than a tenth of it late, and nothing was answered."""
    rig = ticking.rig
    ticking.command(0, 0.5)
    ticking.at(1.4)
    assert rig._drive.cycle == 1
    began, tick = [1.4], 2.0
    while rig._drive.cycle < 8:
        due = (ticking.also[-1] / PERIOD) if ticking.also and ticking.also[-1] / PERIOD > began[-1] else tick
        now, tick = min(due, tick), tick + (tick <= due)
        before = rig._drive.cycle
        ticking.at(now + 1e-6)
        began += [now] * (rig._drive.cycle - before)
    assert began == pytest.approx([1.4, 2.3, 3.2, 4.1, 5.0, 6.0, 7.0, 8.0], abs=1e-4)
    assert rig._pacing.skipped == 0 and rig.timing.late == 7


def test_a_hold_up_is_made_up_to_a_limit_and_the_rest_given_up(ticking: Any) -> None:
    rig = ticking.rig
    stamps = []
    for k in range(3):
        ticking.command(k, k + 0.5)
        ticking.at(k + 1.0)
        stamps.append(rig._message.header.stamp.nanosec)
    assert [b - a for a, b in pairwise(stamps)] == [2_000_000, 2_000_000]
    # Held up for 20 cycles: 5 (catch_up) stay due, 15 are given up, on the wall clock too.
    ticking.command(3, 3.5)
    ticking.at(23.0)
    assert rig._pacing.skipped == 15
    assert rig._drive.cycle == 4
    assert rig._message.header.stamp.nanosec - stamps[-1] == 16 * 2_000_000
    # The four that are still due are made up as fast as commands come.
    for k in range(4, 8):
        ticking.command(k, 23.1 + 0.1 * (k - 4))
        assert rig._drive.cycle == k + 1
    ticking.command(8, 23.6)
    assert rig._drive.cycle == 8 and rig._phase == TICKING  # this one waits for its tick
    ticking.at(24.0)
    assert rig._drive.cycle == 9
    assert rig._message.header.stamp.sec == 7 and rig._message.header.stamp.nanosec == (9 + 15) * 2_000_000


def test_in_hold_the_clock_waits_for_nobody(ticking: Any) -> None:
    rig = ticking.rig
    choose(rig, "hold")
    for k in range(1, 100):
        ticking.at(float(k))
    assert rig._drive.cycle == 99 and rig._drive.mode is Mode.HOLD
    assert rig.timing.late == 0
