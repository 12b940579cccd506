"""Modes of the rig: late commands, retract, limits, emergency stop."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_rules import LIMITS, RETRACT, TS, fresh

from test_rig_sim.retract import arrived, retract_step
from test_rig_sim.supervisor import Mode, Ramp


def test_holds_until_the_first_command() -> None:
    assert fresh().mode is Mode.HOLD


def test_command_in_time_is_followed() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    assert rig.follow(0.01, 0.012) == Ramp(0.01, 0.012)
    assert rig.mode is Mode.TRACKING


def test_late_command_is_bridged_then_held_then_retracted() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    rig.follow(0.01, 0.012)
    modes = []
    for _ in range(5):
        ramp = rig.bridge()
        modes.append(rig.mode)
        if rig.mode is not Mode.RETRACTING:
            assert ramp == Ramp(0.012, 0.012)
    assert modes == [Mode.BRIDGING, Mode.HOLDING, Mode.HOLDING, Mode.HOLDING, Mode.RETRACTING]
    assert rig.reason == "5 successive cycles without a usable command (5 late, 0 refused)"


def test_reason_of_a_retract_tells_late_commands_from_refused_ones() -> None:
    rig = fresh()
    for refused in (True, True, False):
        rig.bridge(refused)
    rig.follow(0.1, 0.1)
    for refused in (True, False, True, True, False):
        rig.bridge(refused)
    assert rig.mode is Mode.RETRACTING
    assert rig.reason == "5 successive cycles without a usable command (2 late, 3 refused)"


@settings(max_examples=200)
@given(st.floats(), st.floats())
def test_a_refused_command_is_refused_in_words(u_tr: float, u_tr_next: float) -> None:
    """Number, position or leap: whatever is not admissible has one of three reasons, with the limit that it breaks."""
    rig = fresh()
    if rig.admissible(u_tr, u_tr_next):
        return
    text = rig.objection(u_tr, u_tr_next)
    if not (math.isfinite(u_tr) and math.isfinite(u_tr_next)):
        assert text == "the command is not a finite number"
    elif max(abs(u_tr), abs(u_tr_next)) > LIMITS.trip_position:
        assert f"at most {LIMITS.trip_position * 1e3:g} mm trips" in text
    else:
        assert text.startswith("the command leaps by") and "limits.reference_step" in text


def test_a_retract_says_why_commands_were_refused() -> None:
    """Each kind once, with what was said of the first and how many there were; what was followed since is forgotten."""
    rig = fresh()
    step = LIMITS.reference_step
    rig.objection(math.nan, 0.0)
    rig.bridge(refused=True)
    rig.follow(0.0, 0.0)
    for u_tr_next in (2.0 * step, 3.0 * step, 1e6 * step, math.nan, 2.0 * step):
        assert not rig.admissible(0.0, u_tr_next)
        rig.objection(0.0, u_tr_next)
        rig.bridge(refused=True)
    leap = f"the command leaps by {2e3 * step:.4g} mm within a cycle, at most {1e3 * step:g} mm (limits.reference_step)"
    assert f"(0 late, 5 refused: {leap}, 3 times; the command asks for a position of" in rig.reason
    assert "trips; are its inputs in m?, 1 times" in rig.reason
    assert rig.reason.endswith("the command is not a finite number, 1 times)")


def test_commands_of_an_old_plan_are_followed_as_long_as_late_ones_are_bridged() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    for _ in range(4):
        assert rig.follow(0.01, 0.012, old_plan=True) == Ramp(0.01, 0.012)
    rig.follow(0.01, 0.012)
    for _ in range(4):
        rig.follow(0.01, 0.012, old_plan=True)
    assert rig.mode is Mode.TRACKING
    rig.follow(0.01, 0.012, old_plan=True)
    assert rig.mode is Mode.RETRACTING
    assert rig.reason == "5 successive commands are from an old plan: the controller's solver fails"


def test_two_commands_for_one_cycle_that_differ_retract_a_drive_that_follows_them() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    rig.follow(0.01, 0.012)
    rig.contradict(7, 0.03, 0.01)
    assert rig.mode is Mode.RETRACTING
    assert rig.reason.startswith("two commands for cycle 7 differ: 10 mm and 30 mm; does a second publisher")
    own = fresh("hold")
    own.contradict(7, 0.03, 0.01)
    assert own.mode is Mode.HOLD  # nobody's command is followed


def test_prediction_of_a_late_command_is_the_goal_of_the_next_bridge() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    rig.follow(0.01, 0.012)
    rig.bridge()
    rig.predict(0.016)
    assert rig.bridge() == Ramp(0.012, 0.016)
    assert rig.mode is Mode.BRIDGING
    assert rig.bridge() == Ramp(0.016, 0.016)
    assert rig.mode is Mode.HOLDING


def test_command_ends_a_bridge_and_the_count_of_late_ones() -> None:
    rig = fresh()
    for _ in range(10):
        for _ in range(4):
            rig.bridge()
        rig.follow(0.0, 0.001)
        assert rig.mode is Mode.TRACKING
        assert rig.unusable_in_a_row == 0


def test_retract_ends_stopped_at_the_safe_position_and_does_not_rearm() -> None:
    rig = fresh(reference=0.1, entry_cycles=0)
    rig.follow(0.1, 0.1)
    rig.retract("emergency stop")
    end = 0.1
    for _ in range(2000):
        ramp = rig.follow(0.2, 0.2)
        assert ramp.start == end
        end = ramp.end
        rig.watch(end, 0.0, 100.0, 0.0, False)
    assert rig.mode is Mode.STOPPED
    assert end == RETRACT.position
    assert rig.reason == "emergency stop"


def test_first_reason_stays() -> None:
    rig = fresh()
    rig.retract("emergency stop")
    rig.watch(1.0, 0.0, 0.0, 0.0, False)
    assert rig.reason == "emergency stop"


@pytest.mark.parametrize(
    ("state", "word"),
    [
        ((0.36, 0.0, 100.0, 0.0, False), "trip_position"),
        ((0.0, -4.1, 100.0, 0.0, False), "trip_speed"),
        ((0.0, 0.0, 1001.0, 0.0, False), "trip_force"),
        ((math.nan, 0.0, 100.0, 0.0, False), "finite"),
        ((0.0, math.inf, 100.0, 0.0, False), "finite"),
        ((0.0, 0.0, math.nan, 0.0, False), "finite"),
        ((0.0, 0.0, 100.0, math.nan, False), "finite"),
    ],
)
def test_soft_limits_trip(state: tuple[float, float, float, float, bool], word: str) -> None:
    rig = fresh()
    rig.follow(0.0, 0.0)
    rig.watch(*state)
    assert rig.mode is Mode.RETRACTING
    assert word in rig.reason


def test_saturation_trips_only_when_it_lasts() -> None:
    rig = fresh()
    rig.follow(0.0, 0.0)
    for _ in range(9):
        rig.watch(0.0, 0.0, 0.0, 0.0, True)
    rig.watch(0.0, 0.0, 0.0, 0.0, False)
    for _ in range(9):
        rig.watch(0.0, 0.0, 0.0, 0.0, True)
    assert rig.mode is Mode.TRACKING
    rig.watch(0.0, 0.0, 0.0, 0.0, True)
    assert rig.mode is Mode.RETRACTING


@pytest.mark.parametrize(
    ("u_tr", "u_tr_next"),
    [(math.nan, 0.0), (0.0, math.inf), (0.36, 0.35), (0.0, 0.051), (0.06, 0.06), (-0.06, -0.06)],
)
def test_bad_commands_are_not_admissible(u_tr: float, u_tr_next: float) -> None:
    rig = fresh()
    assert rig.admissible(0.0, 0.04)
    assert not rig.admissible(u_tr, u_tr_next)


def test_a_command_out_of_the_travel_is_refused_at_either_end() -> None:
    for sign in (1.0, -1.0):
        rig = fresh(reference=sign * 0.34)
        assert rig.admissible(sign * 0.34, sign * 0.35)
        assert not rig.admissible(sign * 0.34, sign * 0.36)
        assert not rig.admissible(sign * 0.36, sign * 0.34)


def test_end_of_the_ride_stops() -> None:
    rig = fresh(reference=0.01, entry_cycles=0)
    rig.follow(0.01, 0.01)
    rig.finish()
    assert rig.mode is Mode.STOPPED
    assert rig.reason == ""
    assert rig.follow(0.02, 0.02) == Ramp(0.01, 0.01)


EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("follow"), st.floats(-0.3, 0.3)),
        st.tuples(st.just("bridge"), st.just(0.0)),
        st.tuples(st.just("predict"), st.floats(-0.3, 0.3)),
        st.tuples(st.just("trip"), st.just(0.0)),
    ),
    max_size=60,
)


@given(EVENTS)
@settings(max_examples=100)
@pytest.mark.slow
def test_nothing_leaves_retracting_but_to_stopped_and_references_stay_within_limits(
    events: list[tuple[str, float]],
) -> None:
    rig = fresh()
    given_up = False
    for kind, value in events:
        ramp = None
        if kind == "follow":
            ramp = rig.follow(value, value)
        elif kind == "bridge":
            ramp = rig.bridge()
        elif kind == "predict":
            rig.predict(value)
        else:
            rig.retract("test")
        if given_up:
            assert rig.mode in (Mode.RETRACTING, Mode.STOPPED)
        given_up = given_up or not rig.moving
        if ramp is not None:
            assert max(abs(ramp.start), abs(ramp.end)) <= LIMITS.position + 0.02


@given(st.floats(-0.3, 0.3), st.floats(-0.25, 0.25), st.floats(-0.3, 0.3))
@settings(max_examples=100)
def test_retract_motion_keeps_its_limits_and_arrives(reference: float, speed: float, goal: float) -> None:
    limits = RETRACT._replace(position=goal)
    cycles = 0
    while not arrived(limits, reference, speed):
        following, faster = retract_step(limits, reference, speed, TS)
        assert abs(faster) <= limits.speed + 1e-12
        assert abs(faster - speed) <= limits.acceleration * TS + 1e-12
        reference, speed = following, faster
        cycles += 1
        # 0.6 m at 0.25 m/s take 2.4 s; starting and stopping add less than 0.6 s.
        assert cycles < 1500
