"""The bench of rides in real time: its figures from known recordings, its options, its children."""

import argparse
import dataclasses
import io
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from bench.realtime import against, run, tables, usage
from bench.realtime.against import ROOT
from bench.realtime.disturbance import OUTSIDE, Disturbance, plain, work_of
from bench.realtime.figures import Measured, longest_run, measured, ticks_skipped, turnarounds
from bench.realtime.goals import goals
from bench.realtime.options import RealtimeOptions, WrongUse, add_options, options_from
from bench.realtime.run import turns
from bench.realtime.session import Build, Ridden, outcome, processes
from bench.realtime.standstill import AFTER, read
from energy_monitor.bag import Table

TS = 2_000_000  # ns


def states(modes: list[int], late: list[int]) -> Table:
    count = len(modes)
    columns = {"cycle": np.arange(count), "mode": np.array(modes), "late_commands": np.array(late)}
    columns |= {"header.stamp.sec": np.full(count, 7), "header.stamp.nanosec": np.arange(count) * TS}
    return Table("/test_rig_sim/state", "phil_interfaces/msg/RigState", np.arange(count) * TS, columns)


def timing(node: str, batches: list[tuple[int, list[float]]]) -> Table:
    columns = {"cycle": np.array([end for end, _ in batches]), "turnaround": [times for _, times in batches]}
    return Table(f"/{node}/timing", "phil_interfaces/msg/CycleTiming", np.zeros(len(batches), np.int64), columns)


def ridden(build: str, times: list[float], late: int = 0, cpu: float = 100.0, bridged: int = 0) -> Ridden:
    turnaround = {"test_rig_sim": np.array(times)}
    found = Measured(
        0, len(times), late, bridged, False, np.arange(late), np.arange(late), turnaround, 0, len(times) * TS
    )
    shares = {"test_rig_sim": usage.Share(cpu, 3.0)}
    return Ridden(
        build, found, "through", shares, usage.Load(1.0, 0.2, 0.0), {"test_rig_sim": "SCHED_FIFO 40"}, None, read([])
    )


# Figures ---------------------------------------------------------------------------------------------------------


@given(st.lists(st.booleans(), max_size=60))
def test_longest_run_is_that_of_the_text(marks: list[bool]) -> None:
    text = "".join("x" if mark else " " for mark in marks)
    assert longest_run(np.array(marks, np.bool_)) == max((len(run) for run in text.split()), default=0)


def test_late_and_bridged_of_a_window() -> None:
    """What came before the window does not count, and holding goes on where bridging ended."""
    modes = [0, 1, 2, 1, 1, 2, 3, 3, 1, 2, 1]
    late = [0, 0, 1, 1, 1, 2, 3, 4, 4, 5, 5]
    found = measured({"/test_rig_sim/state": states(modes, late)}, 3 * TS, 9 * TS)
    assert (found.first, found.cycles, found.late, found.bridged, found.retracted) == (3, 7, 4, 3, False)
    assert found.late_at.tolist() == [5, 6, 7, 9]
    assert found.share == pytest.approx(4 / 7)


@given(st.lists(st.integers(0, 5), min_size=3, max_size=30), st.integers(1, 10_000_000))
def test_cycles_that_the_rig_left_out_are_in_its_stamps(left_out: list[int], period: int) -> None:
    """A lost record is none of them: then the cycle numbers jump as well. Half of the steps have to be as usual."""
    left_out += [0] * (len(left_out) + 1)
    steps = 1 + np.array(left_out)
    stamps = np.concatenate([[0], np.cumsum(steps)]) * period
    assert ticks_skipped(np.arange(stamps.size), stamps) == sum(left_out)
    assert ticks_skipped(np.concatenate([[0], np.cumsum(steps)]), stamps) == 0


def test_a_retract_ends_what_counts() -> None:
    modes, late = [1, 1, 2, 3, 4, 4, 5], [0, 0, 1, 2, 3, 3, 3]
    times = timing("test_rig_sim", [(3, [1.0, 2.0, 3.0, 4.0]), (6, [5.0, 6.0, 7.0])])
    found = measured({"/test_rig_sim/state": states(modes, late), "/test_rig_sim/timing": times}, 0, 2**62)
    assert (found.cycles, found.late, found.bridged, found.retracted) == (5, 3, 3, True)
    assert found.turnaround["test_rig_sim"].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]


@pytest.mark.parametrize("begin", [20 * TS, 3 * TS])
def test_nothing_to_measure_is_said(begin: int) -> None:
    with pytest.raises(ValueError, match=r"no cycle|retracted before"):
        measured({"/test_rig_sim/state": states([1, 1, 4, 4], [0, 0, 0, 0])}, begin, 2**62)


@given(st.integers(0, 30), st.integers(0, 30))
def test_turnarounds_of_a_window_are_those_of_its_cycles(first: int, last: int) -> None:
    """Entry k of 31 is k: whatever the batches, a window holds exactly its own numbers."""
    batches = [(4, [0, 1, 2, 3, 4]), (5, [5]), (20, list(range(6, 21))), (30, list(range(21, 31)))]
    found = turnarounds(timing("rig", batches), first, last)
    assert found.tolist() == list(range(first, last + 1))


# Goals and comparison --------------------------------------------------------------------------------------------


def test_goals_hold_at_their_bound_and_fail_beyond() -> None:
    kept = ridden("a", [0.0009] * 1000, late=1, bridged=2).figures
    broken = ridden("a", [0.0011] * 1000, late=2, bridged=3).figures
    assert [goal.row()["holds"] for goal in goals([kept], 500.0, True)] == [True] * 4
    assert [goal.row()["holds"] for goal in goals([broken], 500.0, True)] == [False] * 3 + [True]
    assert goals([kept], 250.0, True) == []
    assert [goal.goal for goal in goals([kept], 1000.0, False)] == [2e-4, 0]


def test_turns_are_fair() -> None:
    assert turns(3) == [0, 1, 1, 0, 0, 1]
    order = turns(8)
    assert order.count(0) == order.count(1)
    assert sum(i for i, build in enumerate(order) if build) == sum(i for i, build in enumerate(order) if not build)


def test_two_builds_are_compared_pair_by_pair() -> None:
    rides = [ridden("new", [1e-3] * 10, cpu=50.0), ridden("old", [2e-3] * 10, cpu=200.0)]
    rides += [ridden("old", [4e-3] * 10, cpu=200.0), ridden("new", [1e-3] * 10, cpu=100.0)]
    sheet, held = tables.comparison(rides, "new", "old")
    median = next(row for row in sheet.rows if row["what"] == "rig: state out to command in, median")
    assert (median["smallest"], median["largest"], median["ratio"]) == pytest.approx((0.25, 0.5, 1 / 3))
    spent = next(row for row in sheet.rows if row["unit"] == "us")
    assert (spent["new"], spent["old"], spent["smallest"], spent["largest"]) == pytest.approx((75.0, 200.0, 0.25, 0.5))
    assert [goal.row()["holds"] for goal in held] == [True, True]


# What processes use ----------------------------------------------------------------------------------------------


def test_usage_of_a_process_that_works() -> None:
    child = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        deadline = time.monotonic() + 5.0
        while usage.processor_seconds(child.pid) < 0.1 and time.monotonic() < deadline:
            time.sleep(0.02)
        first = usage.sample({"it": child.pid}, [])
        while usage.processor_seconds(child.pid) < first.processes["it"].seconds + 0.2 and time.monotonic() < deadline:
            time.sleep(0.02)
        last = usage.sample({"it": child.pid}, [])
        assert child.pid in usage.children(os.getpid())
        assert usage.scheduling(child.pid) == "ordinary"
    finally:
        child.kill()
        child.wait()
    wall = (last.wall - first.wall) * 1e-9
    share = usage.shares(first, last, 0.002)["it"]
    spent = last.processes["it"].seconds - first.processes["it"].seconds
    assert spent >= 0.2
    assert share.microseconds == pytest.approx(1e6 * spent / (wall / 0.002))
    assert usage.load(first, last).busy * wall >= 0.9 * spent
    assert usage.processor_seconds(child.pid) == 0.0


def test_fields_behind_a_name_with_brackets() -> None:
    assert usage.fields_of_stat("12 (a) b) (c) S 7 0")[:2] == ["S", "7"]


def test_machine_of_the_first_line() -> None:
    found = usage.machine_of("cpu  1000 200 300 4000 500 60 70 80 900 0")
    ticks = usage.TICKS
    assert (found.busy * ticks, found.stolen * ticks, found.total * ticks) == pytest.approx((1630, 80, 6210))


def test_nodes_are_told_among_the_children_of_a_ride() -> None:
    line = ["python", "-m", "ride.child", "1"]
    found = processes({5: [*line, "test_rig_sim.node", "--ros-args"], 6: [*line, "energy_monitor.record"], 7: ["sh"]})
    assert found == {"test_rig_sim": 5, "recorder": 6}


# What disturbs ---------------------------------------------------------------------------------------------------


def test_viewers_have_the_shell_of_a_user() -> None:
    given = {
        "FASTRTPS_DEFAULT_PROFILES_FILE": "x",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",
        "PHIL_ROOT": "/",
        "HOME": "/h",
    }
    assert plain(given | {"ROS_DOMAIN_ID": "7"}) == {"HOME": "/h", "ROS_DOMAIN_ID": "7"}


def test_work_is_summed_up_and_a_cut_off_line_is_left_out() -> None:
    viewers = ['{"ready": true}\n{"topics": 3, "messages": 10}\n[WARN] x\n{"topics": 5, "messages": 1}\n{"topi', "7\n"]
    work = work_of(viewers, '{"parameters": 200, "silent": 0}\n{"parameters": 150, "silent": 1}', 1, "a\nlost 3\n")
    assert (work.visits, work.messages, work.topics) == (2, 11, 5)
    assert (work.rounds, work.parameters, work.silent, work.recorder) == (2, 200, 1, 1)
    assert work.recorder_said == "lost 3"


def test_busy_process_is_of_ordinary_priority_and_ends() -> None:
    command = [sys.executable, str(OUTSIDE), str(os.getpid()), "busy"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE)
    try:
        assert child.stdout is not None and json.loads(child.stdout.readline()) == {"ready": True}
        assert usage.scheduling(child.pid) == "ordinary"
        child.send_signal(signal.SIGTERM)
        assert child.wait(5.0) == 0
    finally:
        child.kill()


def test_what_disturbs_ends_with_an_interrupt(tmp_path: Path) -> None:
    """Ctrl-C while they come up: those that are there already are ended."""

    def interrupted() -> bool:
        raise KeyboardInterrupt

    pids = []
    with pytest.raises(KeyboardInterrupt), Disturbance(tmp_path / "beside", os.environ) as disturbance:
        try:
            disturbance.begin(interrupted)
        finally:
            pids = disturbance.pids
    assert len(pids) == 3
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids)


# Options, builds -------------------------------------------------------------------------------------------------


def options(*argv: str) -> RealtimeOptions:
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--quick", action="store_true")
    add_options(parser)
    return options_from(parser, parser.parse_args(argv))


def test_options() -> None:
    assert options("realtime") == RealtimeOptions(False, 500.0, 60.0, None)
    assert options("realtime", "--rate", "1000", "--disturbed", "--seconds", "1800").cycle_time == pytest.approx(1e-3)
    assert options("realtime", "--against", "HEAD~3").seconds == 10.0


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (("mpc", "--rate", "1000"), "--rate is an option of realtime"),
        (("lines", "--disturbed"), "--disturbed is an option of realtime"),
        (("realtime", "--rate", "nan"), "is no number"),
        (("realtime", "--rate", "1e4"), "from 50 to 5000 Hz"),
        (("realtime", "--seconds", "0"), "from 1 to 86400 s"),
        (("realtime", "--pairs", "3"), "--pairs is for --against"),
        (("realtime", "--against", "HEAD", "--pairs", "0"), "from 1 to 1000"),
    ],
)
def test_wrong_options_are_one_line(argv: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        options(*argv)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_unknown_revision_is_one_line() -> None:
    with pytest.raises(WrongUse, match=r"no such revision"):
        against.revision("no-such-branch")


def test_environment_of_the_users_shell_comes_back() -> None:
    shell = {"PATH": "/usr/bin:/bin", "HOME": "/h", "LD_LIBRARY_PATH": "/opt/lib"}
    ours = {"PATH": f"{ROOT}/.venv/bin:/usr/bin:/bin", "LD_LIBRARY_PATH": f"{ROOT}/install/lib:/opt/lib"}
    ours |= {"HOME": "/h", "VIRTUAL_ENV": f"{ROOT}/.venv", "AMENT_PREFIX_PATH": f"{ROOT}/install/a:{ROOT}/install/b"}
    assert against.before(ours | {"PYTHONPATH": f"{ROOT}/scripts"}) == shell


def test_outcome_of_a_ride() -> None:
    through = ridden("a", [1e-3]).figures
    assert outcome(through, 0, False, "") == outcome(through, 130, True, "") == "through"
    assert outcome(through, 1, False, "x\nthe ride failed: the disk is full\n") == "the disk is full"
    assert outcome(through, -9, False, "") == "ended with code -9"
    retracted = Measured(10, 40, 3, 3, True, np.arange(3), np.arange(3), {}, 0, 1)
    assert outcome(retracted, 1, False, "the ride failed: 50 late") == "retracted after 50 cycles: 50 late"


# All of it -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("builds", [1, 2])
@pytest.mark.slow
def test_outcome_can_be_printed_written_and_drawn(builds: int, tmp_path: Path) -> None:
    names = ["this build", "0123456789"][:builds]
    rides = [ridden(name, [1e-3, 1.5e-3, 3e-3] * 100, late=3) for name in names for _ in range(2)]
    work = work_of(['{"topics": 5, "messages": 1}'], "", 1, "lost 3")
    rides[0] = dataclasses.replace(rides[0], work=work, load=None, shares={})
    riding = RealtimeOptions(disturbed=True, against=names[1] if builds > 1 else None, pairs=2)
    found = run.outcome(riding, [Build(name, tmp_path, {}) for name in names], rides)
    assert found.title == "real time, disturbed, 600 cycles of 2 ms, late commands: 6"
    assert [row.count for row in found.rows] == [600] * builds
    console = Console(width=150, record=True, file=io.StringIO())
    for sheet in found.sheets:
        assert sheet.rows
        console.print(sheet.table())
    said = console.export_text()
    for text in ("SCHED_FIFO 40", "FAILS", "bridged on end", *(["in turns", "ratio"] if builds > 1 else [])):
        assert text in said
    assert any("lost 3" in note for note in found.notes)
    document = json.loads(json.dumps({sheet.name: list(sheet.rows) for sheet in found.sheets}))
    assert [row["late_cycles"] for row in document["rides"]] == [[0, 1, 2]] * (2 * builds)
    found.pictures["late"](tmp_path / "late.png")
    assert (tmp_path / "late.png").stat().st_size > 10_000


def test_late_commands_of_a_standstill_are_told_apart():
    """A state counts if it was logged while the machine stood, or within the recorder's batch behind; else not."""
    stood = read(["1000 500", "a remark", "200000000 1000000"])
    assert stood.longest == 1e-3
    times = np.array([999, 1000, 1500, 1500 + AFTER, 1501 + AFTER, 200_500_000])
    assert stood.hit(times) == 4
    assert stood.within(0, 2000).begin.tolist() == [1000]
    assert read([]).hit(times) == 0 and read([]).longest == 0.0


def test_a_process_that_is_stopped_sees_a_standstill():
    """A stop of 50 ms is a wake-up that comes too late; what is there otherwise is the machine's."""
    command = [sys.executable, "-m", "bench.realtime.standstill", str(min(os.sched_getaffinity(0))), "0.002"]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ)
    time.sleep(1.0)
    child.send_signal(signal.SIGSTOP)
    time.sleep(0.05)
    child.send_signal(signal.SIGCONT)
    time.sleep(0.1)
    child.terminate()
    found = read(child.communicate(timeout=10)[0].splitlines())
    assert 0.045 < found.longest < 10.0
