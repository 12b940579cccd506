"""A wall clock that is set during the ride, and who speaks on /diagnostics: what the report makes of both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from energy_monitor.analysis import Settings, analyse
from energy_monitor.bag import Bag, Diagnostic, read_bag
from energy_monitor.report.results import Report
from energy_monitor.report.verdicts import read_limits
from energy_monitor.report.wall_clock import leap_of_stamps, wall_time

CYCLES = 1000
Change = Callable[[np.ndarray], np.ndarray]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory, synthetic: Callable[..., Path]) -> Bag:
    """A ride of 1000 cycles in 1 s of wall time."""
    return read_bag(synthetic(tmp_path_factory.mktemp("clock") / "bag", cycles=CYCLES))


def changed(bag: Bag, change: Change) -> Bag:
    """Give the bag with other log times."""
    tables = {name: replace(table, log_time=change(table.log_time)) for name, table in bag.tables.items()}
    times = change(np.array([entry.log_time for entry in bag.diagnostics], np.int64))
    diagnostics = [replace(entry, log_time=int(t)) for entry, t in zip(bag.diagnostics, times, strict=True)]
    return replace(bag, tables=tables, diagnostics=diagnostics)


def rig_of(bag: Bag):
    return bag.table("test_rig_sim/state", "RigState")


def report_of(bag: Bag) -> Report:
    return analyse(bag, Settings(0.2), read_limits(None))


def jump(bag: Bag, cycle: int, seconds: float, clamped: bool = False) -> Bag:
    """Set the clock by so many seconds at a cycle; `clamped`: as a recorder that keeps log times in order."""
    at = int(rig_of(bag).log_time[cycle])

    def change(log: np.ndarray) -> np.ndarray:
        later = log + round(seconds * 1e9)
        return np.where(log < at, log, np.maximum(later, at - 1) if clamped else later)

    return changed(bag, change)


@given(
    cycle=st.integers(1, CYCLES - 1),
    seconds=st.one_of(st.floats(-1e6, -0.2), st.floats(5.5, 1e6)),
    clamped=st.booleans(),
)
@pytest.mark.slow
def test_a_clock_that_was_set_is_noticed_and_does_not_count(
    bag: Bag, cycle: int, seconds: float, clamped: bool
) -> None:
    found = wall_time(bag, rig_of(jump(bag, cycle, seconds, clamped and seconds < 0.0 and cycle < CYCLES - 50)))
    # With the jump the other tables would have to be changed as well for a silence; a bag of one table has it anyway.
    if seconds < 0.0:
        assert found.jumped and "back" in found.note
        assert found.seconds == pytest.approx(0.999, rel=0.01)
    whole = jump(bag, cycle, seconds, clamped and seconds < 0.0 and cycle < CYCLES - 50)
    found = wall_time(whole, rig_of(whole))
    assert found.jumped and ("back" if seconds < 0.0 else "forth") in found.note
    assert found.seconds == pytest.approx(0.999, rel=0.01)


def test_log_times_that_tell_nothing_are_not_taken_for_a_clock_that_was_set(bag: Bag) -> None:
    for change in (np.zeros_like, lambda log: log // 10**10):
        still = changed(bag, change)
        found = wall_time(still, rig_of(still))
        assert np.isnan(found.seconds) and "do not tell" in found.note and "clock" not in found.note


def test_a_clock_that_was_not_set_is_not_complained_of(bag: Bag) -> None:
    found = wall_time(bag, rig_of(bag))
    assert (found.note, found.seconds) == ("", pytest.approx(0.999))
    # A pause in which the nodes are heard, and a recorder that was held up for a second.
    at = int(rig_of(bag).log_time[500])
    paused = changed(bag, lambda log: np.where(log < at, log, log + 60 * 10**9))
    heard = [Diagnostic(at + k * 10**9, 1, "test_rig_sim: cycle", "waits", {}) for k in range(60)]
    paused = replace(paused, diagnostics=[*paused.diagnostics, *heard])
    assert wall_time(paused, rig_of(paused)).note == ""
    late = changed(bag, lambda log: np.where((log >= at) & (log < at + 10**9), at + 10**9 + (log - at) // 1000, log))
    assert wall_time(late, rig_of(late)).note == ""


@pytest.mark.parametrize("seconds", [-2.0, 2.0])
def test_in_real_time_the_stamps_tell(bag: Bag, seconds: float) -> None:
    """Set by 2 s while nobody logs for a while: only the stamps, which run on, can tell it from a pause."""
    rig = rig_of(bag)
    stamp = rig.log_time - rig.log_time[0] + 1_700_000_000 * 10**9
    columns = dict(rig.columns) | {"header.stamp.sec": stamp // 10**9, "header.stamp.nanosec": stamp % 10**9}
    steady = replace(rig, columns=columns)
    assert wall_time(bag, steady).note == ""
    at = int(rig.log_time[600])
    after = np.where(rig.log_time < at, rig.log_time, rig.log_time + round(seconds * 1e9))
    found = wall_time(bag, replace(steady, log_time=after))
    assert f"set {'back' if seconds < 0 else 'forth'} by 2 s" in found.note
    assert found.seconds == pytest.approx(0.999, rel=0.01)


@pytest.mark.parametrize("seconds", [-3600.0, 3600.0])
def test_the_report_says_it_and_its_numbers_stay(bag: Bag, seconds: float) -> None:
    usual, report = report_of(bag), report_of(jump(bag, 500, seconds))
    assert usual.notes == [note for note in report.notes if "wall clock" not in note]
    assert any("wall clock was set" in note and "by 3600 s at cycle 500" in note for note in report.notes)
    assert np.isnan(report.ride.speed_factor) and usual.ride.speed_factor == pytest.approx(2.0, rel=1e-2)
    assert report.ride.wall_time == pytest.approx(usual.ride.wall_time, rel=1e-2)
    assert report.tracking == usual.tracking and report.contact_force == usual.contact_force
    assert report.warnings == usual.warnings  # their times are of the ride, not of the clock


def status(name: str, hardware: str, message: str, stamp: float, log: int) -> Diagnostic:
    return Diagnostic(log, 1, name, message, {}, hardware, round(stamp * 1e9))


def test_only_the_nodes_of_the_ride_are_listed(bag: Bag) -> None:
    rig = rig_of(bag)
    log = int(rig.log_time[500])
    spoken = [
        status("/test_rig_sim: cycle", "/test_rig_sim", "12 commands late", 0.5, log),
        status("/test_rig_sim: cycle", "/test_rig_sim", "99 commands late", 1.5, log),
        status("test_rig_sim: cycle", "test_rig_sim", "stopped: landed", 0.5, log),
        status("/rig_b/test_rig_sim: cycle", "/rig_b/test_rig_sim", "hot", 0.5, log),
        status("cpu_monitor: temperature", "nuc7", "CPU at 96 C", 0.5, log),
    ]
    report = report_of(replace(bag, diagnostics=spoken, speakers={entry.hardware: {"7"} for entry in spoken}))
    (warned,) = report.warnings
    assert (warned.message, warned.count, warned.first, warned.last) == ("99 commands late", 2, 0.5, 1.5)
    (note,) = [note for note in report.notes if "Others" in note]
    assert "cpu_monitor: temperature (nuc7)" in note and "/rig_b/test_rig_sim" in note


def test_who_speaks_in_the_name_of_a_node_is_said(bag: Bag) -> None:
    """As a bag of an earlier ride does that is played meanwhile."""
    one, two = {"/test_rig_sim": {"7"}}, {"/test_rig_sim": {"7", "11"}, "/rig_b/test_rig_sim": {"8", "9"}}
    assert not [note for note in report_of(replace(bag, speakers=one)).notes if "processes" in note]
    (note,) = [note for note in report_of(replace(bag, speakers=two)).notes if "processes" in note]
    assert note.startswith("2 processes said to be /test_rig_sim on /diagnostics")


def test_bags_of_before_have_plain_names_and_wall_stamps(bag: Bag) -> None:
    """Their warnings are ours, and timed by the log as long as its clock was left alone."""
    log = int(rig_of(bag).log_time[500])
    spoken = [status("test_rig_sim: cycle", "test_rig_sim", "late", 1.7e9, log)]
    old = replace(bag, diagnostics=spoken, speakers={"test_rig_sim": {""}})
    (warned,) = report_of(old).warnings
    assert warned.first == pytest.approx(1.0)
    (warned,) = report_of(jump(old, 700, -100.0)).warnings
    assert np.isnan(warned.first)


@pytest.mark.parametrize("begin", [0, 1_700_000_000])
@pytest.mark.parametrize("leap", [-1000, 1000])
def test_stamps_that_leap_are_the_rig_s_and_no_jump_of_the_clock(bag: Bag, begin: int, leap: int) -> None:
    rig = rig_of(bag)
    seconds = rig["header.stamp.sec"].astype(np.int64) + begin + 2000
    seconds[300:] += leap
    wrong = replace(rig, columns={**rig.columns, "header.stamp.sec": seconds})
    assert (wall_time(bag, wrong), leap_of_stamps(rig)) == (wall_time(bag, rig), "")
    way = "back" if leap < 0 else "forth"
    assert leap_of_stamps(wrong).startswith(f"The stamps of the rig's states leap {way} by 1000 s at cycle 300:")
