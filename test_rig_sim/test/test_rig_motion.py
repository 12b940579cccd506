"""The drive's own motions: trajectories, moves, blends; and limits and clock, which need no rig either."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from rig_rules import LIMITS, TOUCH, TS

from test_rig_sim.limits import Guard, Measurement
from test_rig_sim.motion import Pace, at_rest, towards
from test_rig_sim.pacing import CycleClock
from test_rig_sim.touch import Feeler
from test_rig_sim.trajectory import Ability, Shape, check, sample

PACE = Pace(0.25, 5.0)
SHAPE = Shape("sine", center=0.02, amplitude=0.01, frequency=2.0, end_frequency=20.0, duration=3.0, fade=0.5, file="")
ABLE = Ability(position=0.3, speed=3.0, acceleration=100.0)


@given(st.floats(-0.3, 0.3), st.floats(-2.0, 2.0), st.floats(-0.3, 0.3))
@settings(max_examples=100)
def test_a_move_keeps_its_acceleration_and_ends_at_its_goal_at_rest(start: float, speed: float, goal: float) -> None:
    reference = start
    for _ in range(3000):
        if at_rest(goal, reference, speed):
            break
        following, faster = towards(goal, PACE, reference, speed, TS)
        assert abs(faster - speed) <= PACE.acceleration * TS + 1e-12
        assert abs(faster) <= max(PACE.speed, abs(speed)) + 1e-12
        assert following == reference + faster * TS
        reference, speed = following, faster
    assert at_rest(goal, reference, speed)


def test_sine_and_chirp_are_what_their_names_say() -> None:
    sine, chirp = sample(SHAPE, PACE, TS), sample(SHAPE._replace(kind="chirp"), PACE, TS)
    t = np.arange(len(sine)) * TS
    middle = (t > 0.6) & (t < 2.4)
    assert sine[middle] == pytest.approx(0.02 + 0.01 * np.sin(4.0 * math.pi * t[middle]), abs=1e-15)
    # Zeros of a linear chirp: f0 t + (f1 - f0) t^2 / 2 T is a multiple of 1/2.
    phase = 2.0 * (2.0 * t[middle] + 3.0 * t[middle] ** 2)
    crossings = int(np.count_nonzero(np.diff(np.sign(chirp[middle] - 0.02))))
    assert crossings == math.floor(phase[-1]) - math.floor(phase[0])
    for found in (sine, chirp):
        assert found[0] == found[-1] == 0.02
        assert len(found) == 1501


def test_steps_are_moves_from_level_to_level() -> None:
    found = sample(SHAPE._replace(kind="steps", frequency=0.5, amplitude=0.05), PACE, TS)
    assert found[0] == found[-1] == 0.02
    assert found[499] == pytest.approx(0.07, abs=1e-9)
    assert found[999] == pytest.approx(-0.03, abs=1e-9)
    speeds = np.diff(found) / TS
    assert np.abs(speeds).max() <= PACE.speed + 1e-9
    assert np.abs(np.diff(speeds)).max() <= PACE.acceleration * TS + 1e-9


def test_file_is_followed_through_its_points_from_rest_to_rest(tmp_path: Path) -> None:
    path = tmp_path / "way.csv"
    path.write_text("time,position\n# comment\n1.0,0.0\n1.5,0.02\n2.0,0.01\n", encoding="utf-8")
    found = sample(SHAPE._replace(kind="file", file=str(path)), PACE, TS)
    assert found[[0, 250, 500]] == pytest.approx([0.0, 0.02, 0.01], abs=1e-12)
    # Zero speed at the ends: the first sample is second order in Ts (x'' of the spline is below 1 m/s^2).
    assert abs(found[1] - found[0]) < TS**2
    assert abs(found[-1] - found[-2]) < TS**2


@pytest.mark.parametrize(
    "text",
    ["", "1.0,2.0\n", "0.0,0.0\n0.0,0.1\n", "0.0;0.0\n1.0;0.0\n", "0.0,0.0\n1.0,nan\n", "0.0,0.0,1.0\n1.0,0.0,1.0\n"],
)
def test_a_bad_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=r"trajectory\.file = .*bad\.csv"):
        sample(SHAPE._replace(kind="file", file=str(path)), PACE, TS)


def test_a_missing_file_is_named() -> None:
    with pytest.raises(ValueError, match=r"trajectory\.file is empty"):
        sample(SHAPE._replace(kind="file"), PACE, TS)
    with pytest.raises(ValueError, match=r"trajectory\.file = /nowhere\.csv cannot be read"):
        sample(SHAPE._replace(kind="file", file="/nowhere.csv"), PACE, TS)


@pytest.mark.parametrize(
    ("changes", "what", "most"),
    [
        # Largest values of a sine: A, 2 pi f A, (2 pi f)^2 A; sampled ones are lower by (pi f Ts)^2 / 6.
        ({"amplitude": 0.3}, "position", 0.32),
        ({"frequency": 60.0}, "speed", 2.0 * math.pi * 60.0 * 0.01),
        ({"frequency": 20.0}, "acceleration", (2.0 * math.pi * 20.0) ** 2 * 0.01),
    ],
)
def test_what_the_drive_cannot_do_is_refused_by_the_keys_name(
    changes: dict[str, float], what: str, most: float
) -> None:
    check(sample(SHAPE, PACE, TS), SHAPE, ABLE, TS)
    shape = SHAPE._replace(**changes)
    with pytest.raises(ValueError, match=r"trajectory\.amplitude, trajectory\.frequency: .* asks for a " + what) as no:
        check(sample(shape, PACE, TS), shape, ABLE, TS)
    assert float(str(no.value).split(" of ")[1].split()[0]) == pytest.approx(most, rel=0.03)


def test_a_touch_is_believed_after_some_cycles_only() -> None:
    feeler = Feeler(TOUCH, touching=False)
    for force in [10.0] * (TOUCH.cycles - 1) + [0.0] + [10.0] * (TOUCH.cycles - 1):
        feeler.feel(force)
        assert not feeler.touching
    feeler.feel(TOUCH.force)
    assert feeler.touching
    for _ in range(TOUCH.cycles - 1):
        feeler.feel(math.nan)  # no force at all says nothing of contact
        assert feeler.touching
    feeler.feel(0.0)
    assert not feeler.touching


# Limits ----------------------------------------------------------------------------------------------------------


def still(current: float) -> Measurement:
    return Measurement(0.0, 0.0, 100.0, current, False)


def test_effective_current_trips_when_the_motor_is_too_warm() -> None:
    """H = i^2 (1 - exp(-t / T)) from rest: twice the continuous current is borne for T ln(4/3)."""
    guard = Guard(LIMITS, TS)
    held = 0
    while not (why := guard.check(still(2.0 * LIMITS.current))):
        held += 1
    assert held == pytest.approx(LIMITS.thermal_time * math.log(4.0 / 3.0) / TS, abs=1.0)
    assert "limits.current" in why
    assert guard.excesses["current"] == pytest.approx(
        (math.log(4.0 / 3.0) - math.log(4.0 / 3.19)) * LIMITS.thermal_time / TS, abs=2.0
    )


def test_continuous_current_is_borne_for_ever_but_reported() -> None:
    guard = Guard(LIMITS, TS)
    for _ in range(round(20.0 * LIMITS.thermal_time / TS)):
        assert not guard.check(still(-LIMITS.current))
    assert guard.effective_current == pytest.approx(LIMITS.current, rel=1e-6)
    assert guard.warning().startswith("beyond soft limits: current for ")


@pytest.mark.parametrize(
    ("name", "m"),
    [
        ("position", Measurement(-0.31, 0.0, 100.0, 0.0, False)),
        ("speed", Measurement(0.0, 3.1, 100.0, 0.0, False)),
        ("force", Measurement(0.0, 0.0, 501.0, 0.0, False)),
    ],
)
def test_soft_limits_are_reported_without_a_trip(name: str, m: Measurement) -> None:
    guard = Guard(LIMITS, TS)
    assert guard.check(still(0.0)) == guard.warning() == ""
    for _ in range(3):
        assert guard.check(m) == ""
    assert guard.warning() == f"beyond soft limits: {name} for 3 cycles"


# Clock -----------------------------------------------------------------------------------------------------------


def test_clock_counts_due_cycles_from_a_fixed_origin() -> None:
    clock = CycleClock(TS)
    clock.start(10, 100.0, 5_000_000_000)
    assert clock.due(10, 100.0 + 0.9 * TS) == 0
    assert clock.due(10, 100.0 + 0.97 * TS) == 1  # a tick may come early by the timer's rounding
    assert clock.due(11, 100.0 + 5.5 * TS) == 4
    assert clock.stamp(10) == 5_000_000_000
    assert clock.stamp(13) == 5_006_000_000


def test_ticks_given_up_move_steady_and_wall_clock_alike() -> None:
    clock = CycleClock(TS)
    clock.start(0, 0.0, 0)
    clock.give_up(0)
    clock.give_up(-3)
    assert clock.skipped == 0 and clock.stamp(1) == 2_000_000
    clock.give_up(7)
    assert clock.skipped == 7
    assert clock.due(3, 10.5 * TS) == 0
    assert clock.stamp(3) == 20_000_000


def test_a_trajectory_from_a_file_that_asks_for_too_much_is_named(tmp_path: Path) -> None:
    file = tmp_path / "far.csv"
    file.write_text("0.0, 0.0\n1.0, 9.0\n")
    shape = SHAPE._replace(kind="file", file=str(file))
    with pytest.raises(ValueError, match=r"trajectory\.file: the trajectory in .*far\.csv asks for a position of 9 m"):
        check(sample(shape, PACE, TS), shape, ABLE, TS)


def test_what_is_no_number_is_no_trajectory() -> None:
    positions = np.array([0.0, math.nan, 0.0])
    with pytest.raises(ValueError, match="asks for a position of nan"):
        check(positions, SHAPE, ABLE, TS)


steps_and_positions = st.lists(
    st.tuples(
        st.floats(0.0, 1.0, exclude_min=True),
        st.floats(-1.0, 1.0) | st.floats(allow_nan=False, allow_infinity=False),
    ),
    min_size=2,
    max_size=6,
)


@given(steps_and_positions)
@example([(1e-300, 0.0), (1e-300, 0.006), (0.2, 0.01)])
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_curve_through_a_file_is_a_number_everywhere_or_refused(
    tmp_path: Path, rows: list[tuple[float, float]]
) -> None:
    file = tmp_path / "any.csv"
    times = np.cumsum([step for step, _ in rows])
    file.write_text("".join(f"{time!r}, {row[1]!r}\n" for time, row in zip(times.tolist(), rows, strict=True)))
    try:
        found = sample(SHAPE._replace(kind="file", file=str(file)), PACE, TS)
    except ValueError as error:
        assert str(error).startswith(f"trajectory.file = {file}: ")
        return
    assert np.all(np.isfinite(found))
