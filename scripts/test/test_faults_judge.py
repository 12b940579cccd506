"""What becomes of a fault is judged from what was seen: outcome, time until safe, peaks, reports, bag."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from faults.judge import (
    RETRACTS,
    SILENCE,
    SILENT,
    STEADY,
    TRACKS,
    Limits,
    Peaks,
    Remark,
    Row,
    Sight,
    answers,
    bag_gaps,
    outcome,
    peaks,
    said,
    steady,
)
from faults.table import BEGIN, END, markdown, update
from phil_base.enumerations import Mode

TS = 0.002
LIMITS = Limits(position=0.3, speed=3.0, force=500.0, current=30.0)


def seen(*modes: int, begin: int = 0, **values: float) -> list[Sight]:
    still = {"w": 0.0, "v": 0.0, "f": 0.0, "current": 0.0} | values
    return [Sight(k * TS, k, mode, late=0, stamp=k * TS, **still) for k, mode in enumerate(modes, begin)]


def test_a_ride_that_is_not_disturbed_tracks_at_once() -> None:
    sights = seen(*[Mode.TRACKING] * 200)
    assert outcome(sights, 0.1, 0.4, TS) == (TRACKS, 0.0)
    assert steady(sights, 0.1)


@given(st.integers(1, 60), st.integers(STEADY, 80))
def test_safe_is_the_first_of_the_cycles_that_are_followed_for_good(away: int, back: int) -> None:
    sights = seen(*[Mode.TRACKING] * 50, *[Mode.HOLDING] * away, *[Mode.TRACKING] * back)
    ended, after = outcome(sights, 50 * TS, sights[-1].at, TS)
    assert ended == TRACKS
    assert after is not None and math.isclose(after, away * TS, abs_tol=1e-9)


def test_a_single_late_command_that_is_bridged_is_no_gap() -> None:
    sights = seen(*([Mode.TRACKING] * 10 + [Mode.BRIDGING]) * 20)
    assert outcome(sights, 50 * TS, sights[-1].at, TS) == (TRACKS, 0.0)


def test_a_rig_that_stood_still_is_safe_when_it_goes_on() -> None:
    early = seen(*[Mode.TRACKING] * 50)
    later = [
        sight._replace(at=sight.at + 0.5, stamp=sight.stamp + 0.5)
        for sight in seen(*[Mode.TRACKING] * STEADY, begin=50)
    ]
    ended, after = outcome([*early, *later], 49 * TS, later[-1].at, TS)
    assert ended == TRACKS and after is not None and math.isclose(after, 0.502)
    assert outcome([*early, *later[:-1]], 49 * TS, later[-2].at, TS) == (TRACKS, None)


def test_who_watches_may_be_held_up_or_lose_some_without_a_fault_of_the_drive() -> None:
    early = seen(*[Mode.TRACKING] * 50)
    later = [sight._replace(at=sight.at + 0.5) for sight in seen(*[Mode.TRACKING] * STEADY, begin=150)]
    assert outcome([*early, *later], 49 * TS, later[-1].at, TS) == (TRACKS, 0.0)


def test_commands_that_were_late_while_nobody_saw_it_are_a_gap() -> None:
    early = seen(*[Mode.TRACKING] * 50)
    later = seen(*[Mode.TRACKING] * STEADY, begin=150)
    assert outcome([*early, *(sight._replace(late=1) for sight in later)], 49 * TS, later[-1].at, TS) == (TRACKS, 0.0)
    ended, after = outcome([*early, *(sight._replace(late=2) for sight in later)], 49 * TS, later[-1].at, TS)
    assert ended == TRACKS and after is not None and math.isclose(after, 101 * TS)


def test_a_rig_that_begins_anew_is_safe_from_then_on() -> None:
    """Its process was started again: the cycles begin with 0."""
    early = seen(*[Mode.TRACKING] * 50)
    later = [sight._replace(at=sight.at + 3.0, stamp=sight.stamp + 3.0) for sight in seen(*[Mode.TRACKING] * STEADY)]
    ended, after = outcome([*early, *later], 49 * TS, later[-1].at, TS)
    assert ended == TRACKS and after is not None and math.isclose(after, 3.0 - 49 * TS)


def test_a_drive_that_is_not_back_for_long_enough_is_not_safe() -> None:
    sights = seen(*[Mode.TRACKING] * 50, *[Mode.HOLDING] * 5, *[Mode.TRACKING] * (STEADY - 1))
    assert outcome(sights, 50 * TS, sights[-1].at, TS) == (TRACKS, None)
    assert not steady(sights, 50 * TS)


def test_a_retract_is_safe_when_the_drive_rests() -> None:
    sights = seen(*[Mode.TRACKING] * 50, *[Mode.RETRACTING] * 100, Mode.STOPPED)
    assert outcome(sights, 50 * TS, sights[-1].at, TS) == (RETRACTS, 150 * TS - 50 * TS)
    assert outcome(sights, 50 * TS, sights[-1].at + 10.0, TS)[0] == RETRACTS  # a rig that rests says nothing more
    assert outcome(sights[:-1], 50 * TS, sights[-1].at, TS) == (RETRACTS, None)
    assert outcome(sights[:-1], 50 * TS, sights[-1].at + 10.0, TS)[0] == SILENT
    assert steady(sights, 0.0) and not steady(sights[:-1], 50 * TS)


def test_a_rig_that_says_nothing_is_silent() -> None:
    sights = seen(*[Mode.TRACKING] * 50)
    assert outcome(sights, 40 * TS, 49 * TS + SILENCE + 0.1, TS)[0] == SILENT
    assert outcome(sights, 1.0, 2.0, TS) == (SILENT, 0.0)


@given(st.sampled_from(Peaks._fields), st.floats(0.0, 1e4), st.sampled_from((1.0, -1.0)))
def test_whatever_is_beyond_its_limit_is_found_with_either_sign(name: str, value: float, sign: float) -> None:
    field = {"position": "w", "speed": "v", "force": "f"}.get(name, name)
    found = peaks([*seen(1, 1), *seen(1, begin=2, **{field: sign * value}), *seen(1, begin=3)])
    assert getattr(found, name) == value
    assert bool(found.beyond(LIMITS)) is (value > getattr(LIMITS, name))


def test_what_is_no_number_is_beyond_every_limit() -> None:
    for place in range(3):
        sights = [*seen(1, 1, 1, w=0.1)]
        sights[place] = sights[place]._replace(w=math.nan)
        assert peaks(sights).beyond(LIMITS) == ["position nan m beyond 0.3 m"]


def test_reports_since_the_fault_count_and_each_wanted_one_has_to_be_there() -> None:
    remarks = [
        Remark(0.0, "rig", 1, "of before"),
        Remark(1.0, "rig", 0, "all is well"),
        Remark(1.5, "rig", 1, "commands late"),
        Remark(2.5, "rig", 2, "retracting: late"),
        Remark(3.5, "rig", 2, "retracting: late"),
    ]
    reports = said(remarks, 0.5)
    assert reports == {"rig": ["WARN commands late", "ERROR retracting: late"]}
    assert answers(reports, [("rig", "late")]) == (["rig: ERROR retracting: late"], [])
    assert answers(reports, [("rig", "late"), ("wire", "stale")])[1] == ["wire did not report 'stale'"]


def test_cycles_that_a_bag_lacks_are_told() -> None:
    assert bag_gaps(range(100), 99) == ""
    assert bag_gaps([3, 1, 0, 2, 2], 3) == ""
    assert bag_gaps([k for k in range(100) if k not in (7, 9)], 50) == (
        "2 cycles up to 50 are not in the bag, the first is 7"
    )
    assert bag_gaps([], 0)


def test_the_table_stands_between_the_markers_and_only_there(tmp_path) -> None:
    document = tmp_path / "faults.md"
    document.write_text(f"before\n{BEGIN}\nold\n{END}\nbehind\n")
    good, bad = Row("a", "one | two", ended=TRACKS, safe_after=0.25), Row("b", "three", failures=["it went wrong"])
    update(document, [good, bad], "1 of 2")
    text = document.read_text()
    assert text.startswith("before\n") and text.endswith("behind\n") and "old" not in text
    assert markdown([good, bad]) in text and "| one \\| two | tracks | 0.25 |" in text
    assert "FAILED: it went wrong" in text
    update(document, [good], "1 of 1")
    assert "three" not in document.read_text()
