"""The bench of rides in lockstep: its figures from known recordings, its options, its tables."""

import argparse
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from bench.realtime import options as realtime
from bench.realtime.session import Build, MeasuringError
from bench.rides import importing, run
from bench.rides.library import Alone, alone, by_build, library_goals, library_sheet
from bench.rides.options import RidesOptions, add_options, options_from
from bench.rides.processes import MIB, Look, Memory, look, memory, ordered, rides_of, role, used
from bench.rides.run import order
from bench.rides.session import Kind, Ridden, before_the_nodes, environment, knows_composed, span
from bench.rides.tables import MODULES, comparison
from energy_monitor.bag import Table

MS = 1_000_000  # ns


def ridden(kind: str, seconds: float, start: float = 4.0, cost: float = 300.0) -> Ridden:
    return Ridden(kind, 5000, seconds, start, start + seconds + 1.0, 10.0 / seconds, {"test_rig_sim": cost})


# Figures ---------------------------------------------------------------------------------------------------------


def test_span_is_from_the_first_to_the_last_state_and_counts_each_cycle_once() -> None:
    cycles = np.array([0, 1, 1, 2, 3])
    times = np.array([10, 20, 21, 30, 45], np.int64) * MS
    states = Table("/test_rig_sim/state", "phil_interfaces/msg/RigState", times, {"cycle": cycles})
    assert span({"/test_rig_sim/state": states}) == (10 * MS, 45 * MS, 4)


def test_bag_without_cycles_is_refused() -> None:
    states = Table("/test_rig_sim/state", "phil_interfaces/msg/RigState", np.zeros(1, np.int64), {"cycle": np.zeros(1)})
    for tables in ({}, {"/test_rig_sim/state": states}):
        with pytest.raises(ValueError, match="no cycles"):
            span(tables)


def test_processor_time_is_that_of_the_ride_alone() -> None:
    """Half of a core, seen from 1 s to 5 s of a ride from 0.5 s to 5.5 s; what it used before does not count."""
    seen = [Look(0, 7.0), Look(1000 * MS, 9.0), Look(3000 * MS, 10.0), Look(5000 * MS, 11.0), Look(9000 * MS, 99.0)]
    assert used(seen, 500 * MS, 5500 * MS) == pytest.approx(2.5)
    assert used(seen[:2], 500 * MS, 5500 * MS) == 0.0


def test_process_is_told_by_its_command_or_its_name() -> None:
    child = ["python", "-m", "ride.child", "1"]
    assert role([*child, "impedance_mpc.node", "--ros-args"]) == "impedance_mpc"
    assert role([*child, "energy_monitor.record", "--out", "x"]) == "recorder"
    assert role([*child, "ride.composed"]) == "all nodes"
    assert role(["python", "-m", "phil_node.topics_process", "7"]) == "its topics"
    assert role(["python", "-m", "ride", "--duration", "10"]) == "run script"
    assert role(["python", "-m", "ride"], "catenary_model") == "catenary_model"
    assert role(["bash", "run.sh"], "bash") is None
    assert ordered(["recorder", "other", "impedance_mpc, its topics", "impedance_mpc"]) == [
        "impedance_mpc",
        "impedance_mpc, its topics",
        "recorder",
        "other",
    ]


def test_processes_of_a_ride_are_found_below_its_command() -> None:
    """A node with a process for its topics, below a process that is nobody."""
    sleep = "import subprocess, sys, time"
    inner = f"{sleep}; print(flush=True); time.sleep(60)"
    node = f"{sleep}; subprocess.run([sys.executable, '-c', {inner!r}, 'phil_node.topics_process'])"
    outer = f"{sleep}; subprocess.run([sys.executable, '-c', {node!r}, 'test_rig_sim.node'])"
    child = subprocess.Popen(
        [sys.executable, "-c", outer], stdout=subprocess.PIPE, start_new_session=True, env=os.environ
    )
    try:
        assert child.stdout is not None
        child.stdout.readline()
        found = rides_of(child.pid)
        assert sorted(found) == ["test_rig_sim", "test_rig_sim, its topics"]
        assert look(found["test_rig_sim"]).seconds >= 0.0
        seen = memory(found["test_rig_sim"])
        assert seen is not None and MIB < seen.proportional <= seen.resident
    finally:
        os.killpg(child.pid, 9)
        child.wait()


def test_memory_of_a_process_that_is_gone_is_none(tmp_path: Path) -> None:
    assert memory(1, tmp_path) is None
    (tmp_path / "1").mkdir()
    (tmp_path / "1" / "smaps_rollup").write_text("0-f ---p 0 00:00 0 [rollup]\nRss:  2048 kB\nPss:  1024 kB\n")
    assert memory(1, tmp_path) == Memory(2 * MIB, MIB)


def test_kinds_take_turns_forwards_and_backwards() -> None:
    assert order(2, 3) == [0, 1, 1, 0, 0, 1]
    assert order(3, 2) == [0, 1, 2, 2, 1, 0]


def test_ratios_are_those_of_the_medians() -> None:
    new, old = Kind("new", Path("a")), Kind("old", Path("b"))
    rides = [ridden("new", s, 2.0) for s in (1.0, 1.0, 3.0)] + [ridden("old", s, 4.0) for s in (4.0, 2.0, 4.0)]
    sheet, goals = comparison(rides, [new], old)
    assert sheet.rows[0]["ratio"] == pytest.approx(1.0 / 4.0)
    assert (sheet.rows[0]["smallest"], sheet.rows[0]["largest"]) == (0.25, 0.75)
    assert [goal.row()["holds"] for goal in goals] == [True, True]


# Imports ---------------------------------------------------------------------------------------------------------


def test_an_import_is_timed_in_an_interpreter_of_its_own(tmp_path: Path) -> None:
    build = Build("this build", tmp_path, dict(os.environ))
    found = importing.once(build, "json")
    assert found.processor > 0.0 and 0.0 < found.wall < 60.0
    with pytest.raises(MeasuringError, match="no_such_module cannot be imported"):
        importing.once(build, "no_such_module")


# Options, builds -------------------------------------------------------------------------------------------------


def options(*argv: str) -> RidesOptions:
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--quick", action="store_true")
    realtime.add_options(parser)
    add_options(parser)
    given = parser.parse_args(argv)
    realtime.options_from(parser, given)
    return options_from(parser, given)


def test_options() -> None:
    assert options("rides") == RidesOptions(10.0, 3, None, False)
    assert options("rides", "--quick") == RidesOptions(2.0, 1, None, False)
    given = options("rides", "--against", "HEAD", "--seconds", "5", "--rounds", "7", "--composed")
    assert given == RidesOptions(5.0, 7, "HEAD", True)


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (("mpc", "--rounds", "2"), "--rounds is an option of rides"),
        (("realtime", "--composed"), "--composed is an option of rides"),
        (("rides", "--rate", "1000"), "--rate is an option of realtime"),
        (("rides", "--pairs", "3"), "--pairs is an option of realtime"),
        (("rides", "--seconds", "0"), "from 1 to 86400 s"),
        (("rides", "--rounds", "0"), "from 1 to 1000"),
    ],
)
def test_wrong_options_are_one_line(argv: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        options(*argv)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_a_build_without_composition_is_told(tmp_path: Path) -> None:
    assert not knows_composed(tmp_path)
    (tmp_path / "scripts" / "ride").mkdir(parents=True)
    (tmp_path / "scripts" / "ride" / "composed.py").touch()
    assert knows_composed(tmp_path)


def test_command_is_typed_in_the_users_shell(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIRTUAL_ENV", "/somewhere/.venv")
    assert "VIRTUAL_ENV" not in environment()


# Without ROS -----------------------------------------------------------------------------------------------------


def test_loop_rides_in_an_interpreter_of_its_own() -> None:
    """The parts take less than a whole cycle of 2 ms does by the times real time; twice that, as two rides differ."""
    found = alone(Build("this build", Path.cwd(), os.environ), 1.0)
    assert set(found.parts) == {"catenary", "controller", "rig"}
    assert 0.0 < sum(found.parts.values()) < 2.0 * 0.002 / found.loop
    assert found.coupling > 0.0


def test_loop_is_held_against_real_time_and_the_coupling_against_the_other_build() -> None:
    parts = {"catenary": 2e-5, "controller": 3e-5, "rig": 4e-5}
    new = [Alone("new", loop, coupling, parts) for loop, coupling in ((19.0, 80.0), (21.0, 76.0), (22.0, 60.0))]
    old = [Alone("old", 16.0, 80.0, parts)] * 3
    kept = library_goals(new + old)
    assert [goal.value for goal in kept] == pytest.approx([1 / 21.0, 80.0 / 76.0])
    assert [goal.row()["holds"] for goal in kept] == [True, False]
    assert len(library_goals(new)) == 1
    rows = {row["what"]: row for row in library_sheet(new + old).rows}
    assert rows["rig, us a cycle"]["new"] == pytest.approx(40.0)
    assert rows["closed loop, times real time"]["new, range"] == "19 to 22"


def test_a_build_whose_interpreter_fails_is_named(tmp_path: Path) -> None:
    python = tmp_path / "python"
    python.write_text("#!/bin/sh\necho no numba here >&2\nexit 3\n", encoding="utf-8")
    python.chmod(0o755)
    with pytest.raises(MeasuringError, match=r"bare: the loop without ROS failed:\nno numba here"):
        alone(Build("bare", tmp_path, {"PATH": f"{tmp_path}:{os.environ['PATH']}"}), 1.0)


def test_loops_of_the_first_build_come_first_though_they_rode_in_turns() -> None:
    parts = {"catenary": 2e-5, "controller": 3e-5, "rig": 4e-5}
    rode = [
        Alone(build, factor, 90.0, parts) for build, factor in (("old", 1.0), ("new", 2.0), ("new", 3.0), ("old", 4.0))
    ]
    assert [(one.build, one.loop) for one in by_build(rode, ["new", "old"])] == [
        ("new", 2.0),
        ("new", 3.0),
        ("old", 1.0),
        ("old", 4.0),
    ]


# All of it -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("against", [None, "HEAD~1"])
def test_outcome_can_be_printed_and_written(against: str | None) -> None:
    kinds = [Kind("this build", Path("a")), Kind("this build", Path("a"), composed=True)]
    kinds += [Kind("0123456789", Path("b"))] if against else []
    rides = [ridden(kind.label, seconds) for seconds in (1.0, 2.0) for kind in kinds]
    seen = {kind.label: {"test_rig_sim": Memory(200 * MIB, 150 * MIB)} for kind in kinds}
    builds = list(dict.fromkeys(kind.build for kind in kinds))
    found = [importing.Import(build, module, 1.0, 0.9) for build in builds for module in MODULES]
    loops = [Alone(build, 25.0, 90.0, dict.fromkeys(("catenary", "controller", "rig"), 2e-5)) for build in builds]
    outcome = run.outcome(RidesOptions(2.0, 2, against, True), kinds, rides, seen, found, loops)
    console = Console(width=200, record=True, file=io.StringIO())
    for sheet in outcome.sheets:
        assert sheet.rows
        console.print(sheet.table())
    said = console.export_text()
    for text in (
        "this build, composed",
        "impedance_mpc.node",
        "all of them",
        "real time",
        *(["FAILS", "ratio"] if against else []),
    ):
        assert text in said
    document = json.loads(json.dumps({sheet.name: list(sheet.rows) for sheet in outcome.sheets}))
    assert [row["seconds"] for row in document["rides"]] == [one.seconds for one in rides]
    assert document["memory"][0]["this build, RSS"] == 200.0


def test_looks_come_first_and_leave_no_trace() -> None:
    before = os.sched_getscheduler(0)
    with before_the_nodes():
        child = subprocess.run(
            [sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"], capture_output=True
        )
        assert int(child.stdout) == os.SCHED_OTHER
    assert os.sched_getscheduler(0) == before
