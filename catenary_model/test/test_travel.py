"""Journeys: place, speed and acceleration that belong together, closed forms, and what is refused."""

import doctest
import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary_model import travel
from catenary_model.line import Line
from catenary_model.travel import Travel, TravelError, constant, over_place, over_time, start_cruise_brake
from catenary_model.travel_file import load_travel, read_travel

SPEED = st.one_of(st.just(0.0), st.floats(0.1, 100.0))
STEPS = st.lists(st.floats(0.1, 200.0), min_size=1, max_size=6)


@st.composite
def journeys(draw: st.DrawFn) -> Travel:
    """Any of the four kinds."""
    kind = draw(st.sampled_from(["constant", "time", "place", "ramps"]))
    if kind == "constant":
        return constant(draw(SPEED))
    if kind == "ramps":
        cruise = draw(st.floats(1.0, 100.0))
        return start_cruise_brake(
            cruise,
            acceleration=draw(st.floats(0.05, 3.0)),
            braking=draw(st.floats(0.05, 3.0)),
            cruise_time=draw(st.floats(0.0, 100.0)),
            start_speed=draw(st.floats(0.0, 1.0)) * cruise,
            end_speed=draw(st.floats(0.0, 1.0)) * cruise,
            jerk=draw(st.one_of(st.none(), st.floats(0.05, 5.0))),
        )
    along = [0.0, *itertools.accumulate(draw(STEPS))]
    speeds = [draw(SPEED) for _ in along]
    if kind == "time":
        return over_time(along, speeds)
    speeds = [max(v, 0.1) if i % 2 else v for i, v in enumerate(speeds)]  # no two zeros in a row
    return over_place(along, speeds)


@given(journey=journeys(), where=st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2))
def test_speed_is_the_derivative_of_place(journey: Travel, where: list[float]) -> None:
    """Within a phase s is a cubic, for which Simpson's rule over v and the rule of the trapezoid over a are exact."""
    begins = [*journey.table[travel.T], journey.end + 50.0]
    for begin, end in itertools.pairwise(begins):
        one, two = sorted(begin + share * (end - begin) for share in where)
        # a phase does not hold any more at its end: stay a rounding before it
        two = min(two, np.nextafter(end, 0.0))
        one = min(one, two)
        (s1, v1, a1), (s2, v2, a2) = journey.at(one), journey.at(two)
        middle = 0.5 * (one + two)
        _, vm, _ = journey.at(middle)
        # rounding of the time itself, carried by the speed, and of the place
        rounding = 1e-13 * (1.0 + abs(s2) + two * (v1 + v2 + vm))
        assert abs(s2 - s1 - (two - one) / 6.0 * (v1 + 4.0 * vm + v2)) <= rounding
        assert abs(v2 - v1 - 0.5 * (two - one) * (a1 + a2)) <= 1e-12 * (1.0 + v1 + v2 + two * (abs(a1) + abs(a2)))


@given(journey=journeys())
def test_place_and_speed_go_on_where_the_acceleration_jumps(journey: Travel) -> None:
    for begin in journey.table[travel.T, 1:]:
        before, at = journey.at(np.nextafter(begin, 0.0)), journey.at(begin)
        # one rounding of t, with the largest speed and acceleration, and that of the sum
        assert before[0] == pytest.approx(at[0], rel=1e-12, abs=1e-12 * (1.0 + begin * journey.fastest))
        assert before[1] == pytest.approx(at[1], rel=1e-9, abs=1e-9)


@given(journey=journeys(), share=st.floats(0.0, 1.2))
def test_speed_is_never_below_zero_nor_above_the_fastest(journey: Travel, share: float) -> None:
    v = journey.at(share * journey.end)[1]
    assert 0.0 <= v <= journey.fastest * (1.0 + 1e-12) + 1e-12


@given(journey=journeys())
def test_all_at_once_is_one_by_one(journey: Travel) -> None:
    t = np.linspace(0.0, 1.1 * journey.end + 1.0, 37)
    np.testing.assert_array_equal(journey.over(t), np.array([journey.at(x) for x in t]).T)


@given(speed=st.floats(0.0, 100.0), k=st.integers(0, 10**7), ts=st.sampled_from([2e-4, 1e-3, 2e-3]))
def test_constant_speed_is_speed_times_time_to_the_last_bit(speed: float, k: int, ts: float) -> None:
    assert constant(speed).at(ts * k) == (speed * (ts * k), speed, 0.0)


def test_start_cruise_brake_against_the_closed_form() -> None:
    """60 m/s, 0.5 and 0.8 m/s^2: 120 s and 3600 m, 75 s and 2250 m; the rest of 12 km takes 6150 m / 60 m/s."""
    journey = start_cruise_brake(60.0, acceleration=0.5, braking=0.8, distance=12e3)
    assert journey.end == pytest.approx(120.0 + 6150.0 / 60.0 + 75.0, rel=1e-14)
    assert journey.at(journey.end) == pytest.approx((12e3, 0.0, 0.0), rel=1e-14)
    assert journey.at(120.0) == pytest.approx((3600.0, 60.0, 0.0), rel=1e-14)
    assert journey.at(40.0) == pytest.approx((400.0, 20.0, 0.5), rel=1e-14)
    assert journey.at(journey.end + 100.0) == journey.at(journey.end)


def test_jerk_limit_against_the_closed_form() -> None:
    """Ramps of a/j = 2 s at either end: 60 m/s take 60/0.5 + 2 s, over the mean speed of 30 m/s."""
    journey = start_cruise_brake(60.0, acceleration=0.5, braking=0.5, cruise_time=10.0, jerk=0.25)
    assert journey.at(122.0) == pytest.approx((3660.0, 60.0, 0.0), rel=1e-12)
    assert journey.at(1.0) == pytest.approx((0.25 / 6.0, 0.125, 0.25), rel=1e-12)
    assert np.abs(np.diff(journey.over(np.arange(0.0, 254.0, 0.01))[2])).max() == pytest.approx(0.0025, rel=1e-6)
    # 0.5 m/s are gained before the acceleration has come up: sqrt(0.5/0.25) up and down again
    short = start_cruise_brake(0.5, acceleration=0.5, braking=0.5, cruise_time=0.0, jerk=0.25)
    assert short.at(math.sqrt(2.0)) == pytest.approx((0.25 * 2.0**1.5 / 6.0, 0.25, 0.25 * math.sqrt(2.0)), rel=1e-12)
    assert short.end == pytest.approx(4.0 * math.sqrt(2.0), rel=1e-12)


def test_over_place_reaches_every_place_with_its_speed() -> None:
    """V^2 in straight lines over place: from rest over 200 m to 20 m/s is 1 m/s^2, for 20 s."""
    journey = over_place([0.0, 200.0, 500.0], [0.0, 20.0, 0.0])
    assert journey.at(20.0) == pytest.approx((200.0, 20.0, -2.0 / 3.0), rel=1e-14)
    assert journey.at(10.0) == pytest.approx((50.0, 10.0, 1.0), rel=1e-14)
    assert journey.at(50.0) == pytest.approx((500.0, 0.0, 0.0), rel=1e-14)


def test_a_time_before_the_beginning_is_refused() -> None:
    journey = constant(10.0)
    for t in (-0.1, math.nan, math.inf):
        with pytest.raises(TravelError, match=r"t = .* s: allowed is a time from 0 s"):
            journey.at(t)
    with pytest.raises(TravelError, match="t = -1 s"):
        journey.over(np.array([0.0, -1.0]))


def test_limit_of_the_line_is_that_of_its_slower_wire() -> None:
    """Table 3.1: the contact wire, sqrt(20000/1.35) = 121.7 m/s."""
    assert travel.fastest_on(Line()) == pytest.approx(0.9 * math.sqrt(20e3 / 1.35), rel=1e-15)
    over_time([0.0, 5.0], [0.0, 109.0]).refuse_too_fast(Line())
    with pytest.raises(TravelError, match=r"speed = 110 m/s at t = 5 s: allowed is 0 to 109.5 m/s"):
        over_time([0.0, 5.0], [0.0, 110.0]).refuse_too_fast(Line())


@pytest.mark.parametrize(
    ("text", "journey"),
    [
        ("constant: {speed_kmh: 250.0}", constant(250.0 / 3.6)),
        (
            "over_time: {columns: [time_s, speed_kmh], points: [[0, 0], [40.0, 180.0]]}",
            over_time([0.0, 40.0], [0.0, 50.0]),
        ),
        (
            "over_place: {columns: [speed_kmh, position_m], points: [[36, 0], [180.0, 800.0]]}",
            over_place([0.0, 800.0], [10.0, 50.0]),
        ),
        (
            "start_cruise_brake: {cruise_speed_kmh: 180, acceleration_m_s2: 0.5, braking_m_s2: 1, distance_m: 9e3}",
            start_cruise_brake(50.0, acceleration=0.5, braking=1.0, distance=9e3),
        ),
        (
            "start_cruise_brake: {cruise_speed_kmh: 180, acceleration_m_s2: 0.5, braking_m_s2: 1, cruise_time_s: 9, "
            "start_speed_kmh: 18, end_speed_kmh: 36, jerk_m_s3: 0.5}",
            start_cruise_brake(
                50.0, acceleration=0.5, braking=1.0, cruise_time=9.0, start_speed=5.0, end_speed=10.0, jerk=0.5
            ),
        ),
    ],
)
def test_a_file_is_the_journey_it_describes(text: str, journey: Travel, tmp_path: Path) -> None:
    path = tmp_path / "journey.yaml"
    path.write_text(text)
    np.testing.assert_array_equal(load_travel(path, Line()).table, journey.table)


TIME = "over_time: {{columns: [time_s, speed_kmh], points: {}}}"
PLACE = "over_place: {{columns: [position_m, speed_kmh], points: {}}}"
RAMPS = "start_cruise_brake: {{cruise_speed_kmh: 180, acceleration_m_s2: 0.5, braking_m_s2: 0.5{}}}"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (TIME.format("[[0, 0], [5, 90], [5, 100]]"), "over_time.points[2].time_s = 5 s: allowed is more than 5 s"),
        (TIME.format("[[0, 0], [5, -3.6]]"), "over_time.points[1].speed_kmh = -3.6 km/h: allowed is 0 to 394.4 km/h"),
        (TIME.format("[[0, 0], [5, 400]]"), "over_time.points[1].speed_kmh = 400 km/h: allowed is 0 to 394.4 km/h"),
        (TIME.format("[[-1, 0], [5, 40]]"), "over_time.points[0].time_s = -1 s: allowed is 0 s"),
        (TIME.format("[[0, 0], [5, .nan]]"), "over_time.points[1].speed_kmh = nan: allowed is a finite number"),
        (TIME.format("[[0, 0], [5, fast]]"), "over_time.points[1].speed_kmh = 'fast': allowed is a finite number"),
        (TIME.format("[[0, 0], [5]]"), "over_time.points[1] = [5]: allowed is [time_s, speed_kmh]"),
        (TIME.format("[]"), "over_time.points: there are none; allowed is at least one"),
        (TIME.format("7"), "over_time.points: allowed is a list of [time_s, speed_kmh]"),
        ("over_time: {columns: [t, v], points: []}", "over_time.columns = ['t', 'v']: allowed is [time_s, speed_kmh]"),
        ("over_time: {columns: [time_s, speed_kmh]}", "over_time.points is missing"),
        (PLACE.format("[[0, 9], [50, 9], [40, 9]]"), "over_place.points[2].position_m = 40 m: allowed is more than 50"),
        (PLACE.format("[[0, 9], [50, 0], [70, 0]]"), "over_place.points[2].speed_kmh = 0 km/h: allowed is more than 0"),
        (
            RAMPS.format(""),
            "start_cruise_brake.distance_m, start_cruise_brake.cruise_time_s: allowed is one of both; none",
        ),
        (RAMPS.format(", distance_m: 9e3, cruise_time_s: 1"), "allowed is one of both; both is given"),
        (RAMPS.format(", distance_m: 100"), "start_cruise_brake.distance_m = 100 m: allowed is at least 5000 m"),
        (RAMPS.format(", cruise_time_s: -1"), "start_cruise_brake.cruise_time_s = -1 s: allowed is a time from 0 s"),
        (RAMPS.format(", cruise_time_s: 1, jerk_m_s3: 0"), "jerk_m_s3 = 0 m/s^3: allowed is 0.001 to 100 m/s^3"),
        (
            RAMPS.format(", cruise_time_s: 1, end_speed_kmh: 181"),
            "start_cruise_brake.end_speed_kmh = 181 km/h: allowed is 0 to 180 km/h",
        ),
        (
            RAMPS.format(", cruise_tim_s: 1"),
            "start_cruise_brake.cruise_tim_s: unknown entry; did you mean cruise_time_s?",
        ),
        ("constant: {speed_kmh: 395}", "constant.speed_kmh = 395 km/h: allowed is 0 to 394.4 km/h"),
        ("constant: 7", "constant: allowed is a mapping of speed_kmh"),
        ("constnat: {speed_kmh: 395}", "constnat: unknown entry; did you mean constant?"),
        ("[1, 2]", "a journey: allowed is a mapping with one of the entries constant, over_time"),
        ("constant: {speed_kmh: 1, speed_kmh: 2}", "line 1"),
    ],
)
def test_what_cannot_be_travelled_gets_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "journey.yaml"
    path.write_text(text)
    with pytest.raises(TravelError) as refused:
        load_travel(path, Line())
    assert said in str(refused.value)
    assert str(refused.value).startswith(str(path))
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(TravelError, match=r"none\.yaml: cannot be read"):
        load_travel(tmp_path / "none.yaml", Line())
    with pytest.raises(TravelError, match="a journey: allowed is a mapping"):
        read_travel(None, Line())


def test_in_si_the_messages_name_the_arguments() -> None:
    with pytest.raises(TravelError, match=r"times\[1\] = 0 s: allowed is more than 0 s"):
        over_time([0.0, 0.0], [1.0, 1.0])
    with pytest.raises(TravelError, match=r"speeds\[1\] = -1 m/s: allowed is at least 0 m/s"):
        over_place([0.0, 1.0], [1.0, -1.0])
    with pytest.raises(TravelError, match="2 times, 1 speeds"):
        over_time([0.0, 1.0], [1.0])
    with pytest.raises(TravelError, match=r"acceleration = 0 m/s\^2: allowed is 0.001 to 20 m/s\^2"):
        start_cruise_brake(10.0, acceleration=0.0, braking=1.0, cruise_time=1.0)
    with pytest.raises(TravelError, match="cruise_speed = 0 m/s: allowed is more than 0"):
        start_cruise_brake(0.0, acceleration=1.0, braking=1.0, cruise_time=1.0)


def test_example_of_a_journey_in_the_documentation() -> None:
    result = doctest.testmod(travel)
    assert result.attempted > 0
    assert result.failed == 0
