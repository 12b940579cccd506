"""The soak: its judgement of known samples and records, its options, what it sees of a process, and one short ride."""

import json
import mmap
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from energy_monitor.bag import Bag, Table
from soak.judge import Verdict, judge_samples, settling, trend
from soak.looks import Deep, Look, Sample, deep_look, look, sample
from soak.options import parse
from soak.records import SOON, judge_records, records_of, stream

TS = 0.002
LONG = 0.02  # s, so that few cycles are a long ride
NODE = "catenary_model"


def samples(resident, logs=None, threads=None, count=600):
    found = []
    for i in range(count):
        one = Look(resident(i), 0, 0, 0, 0.1 * i, threads(i) if threads else 15, 24)
        deep = {NODE: Deep(0, frozenset())} if i % 10 == 0 else {}
        found.append(Sample(i * 10**9, {NODE: one}, logs(i) if logs else 1000, deep, 0 if deep else None))
    return found


def failing(found):
    return [one.name for one in found if not one.ok]


# Samples ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "resident, good",
    [
        (lambda i: 200_000 + 500 * min(i, 59), True),  # all growth within the first minute
        (lambda i: 200_000 + (i % 7) * 30, True),
        (lambda i: 200_000 - 3 * i, True),
        (lambda i: 200_000 + 3 * i, False),  # a leak of 180 KiB a minute
        (lambda i: 200_000 + (2000 if i == 300 else 0), False),  # one peak
        (lambda i: 200_000 + (1100 if i > 595 else 0), False),
    ],
)
def test_memory_is_flat_once_the_ride_has_settled_or_it_fails(resident, good):
    wrong = failing(judge_samples(samples(resident), [NODE]))
    assert wrong == ([] if good else [f"{NODE}: growth of resident memory"])


def test_threads_that_come_and_stay_and_logs_that_go_on_fail():
    found = judge_samples(samples(lambda i: 1, logs=lambda i: 200 * i, threads=lambda i: 15 + i // 100), [NODE])
    assert failing(found) == [f"{NODE}: growth of threads", "logs: growth once settled"]


def test_what_was_never_seen_fails():
    assert len(failing(judge_samples([], [NODE]))) == len(judge_samples([], [NODE]))
    assert not Verdict("of nothing", None, 1.0, "").ok and not Verdict("of no number", float("nan"), 1.0, "").ok


@given(st.floats(-50.0, 50.0), st.floats(0.0, 1e6), st.floats(30.0, 4000.0))
def test_slope_and_growth_of_a_straight_line(slope, level, seconds):
    at = np.linspace(0.0, seconds, 200)
    found = trend(at, level + slope / 60.0 * at)
    assert found.slope == pytest.approx(slope, abs=1e-6 * (1.0 + level))
    assert found.largest >= max(found.first, found.last) - 1e-9
    middle = 0.5 * (settling(seconds) + min(seconds, 2.0 * settling(seconds)))
    assert found.first == pytest.approx(
        level + slope / 60.0 * middle, abs=abs(slope) / 60.0 * seconds / 100 + 1e-6 * level + 1e-9
    )


# Processes -------------------------------------------------------------------------------------------------------


def test_a_look_at_this_process_and_at_none(tmp_path):
    held = [(tmp_path / f"{i}").open("w") for i in range(5)]
    before = look(os.getpid())
    block = np.frombuffer(mmap.mmap(-1, 8 << 20, mmap.MAP_PRIVATE), np.uint8)  # the heap may have that much to spare
    block[:] = 1
    after = look(os.getpid())
    assert 7500 < after.anonymous - before.anonymous < 12_000 and len(block)
    assert after.resident == after.anonymous + after.file + after.shared and after.files > len(held)
    assert deep_look(os.getpid()).proportional <= after.resident + 1000
    for one in held:
        one.close()
    assert look(2**22 + 1) is None and deep_look(2**22 + 1) is None
    found = sample({"here": os.getpid(), "gone": 2**22 + 1}, [tmp_path], closely=True)
    assert list(found.looks) == list(found.deep) == ["here"] and found.logs == 0


# Records ---------------------------------------------------------------------------------------------------------


def table(topic, msgtype, cycle, late=0.0, **columns):
    cycle = np.asarray(cycle, np.int64)
    log = np.rint((cycle * LONG + late) * 1e9).astype(np.int64)
    return Table(topic, msgtype, log, {"cycle": cycle, **columns})


def bag(tmp_path, **changed):
    cycles = np.arange(6_000)
    tables = {
        "rig": table("/test_rig_sim/state", "RigState", cycles),
        "command": table("/impedance_mpc/command", "ImpedanceCommand", cycles, 1e-3),
        "catenary": table("/catenary_model/state", "CatenaryState", [0, 0, *range(6_001)], 2e-3),
        "books": table("/energy_monitor/conserved_quantities", "ConservedQuantities", cycles[::10], 3e-3),
        "timing": table(
            "/test_rig_sim/timing", "CycleTiming", cycles[49::50], 3e-3, turnaround=[np.zeros(50, np.float32)] * 120
        ),
    } | changed
    topics = {one.topic: one.msgtype for one in tables.values()}
    return Bag(tmp_path, "mcap", True, topics, {one.topic: one for one in tables.values()})


def test_a_whole_bag_holds(tmp_path):
    found = records_of(bag(tmp_path), 6_000)
    assert failing(judge_records(found, TS, lockstep=False)) == []
    assert [one.doubles for one in found.streams] == [0] * 5


@pytest.mark.parametrize(
    "name, changed, wrong",
    [
        ("command", table("/impedance_mpc/command", "ImpedanceCommand", [*range(100), *range(101, 6_000)]), "missing"),
        ("command", table("/impedance_mpc/command", "ImpedanceCommand", [*range(6_000), 7]), "came again"),
        ("catenary", table("/catenary_model/state", "CatenaryState", [*range(6_001), 5]), "came again"),
        ("rig", table("/test_rig_sim/state", "RigState", range(5_999)), "missing"),
        ("books", table("/m/conserved_quantities", "ConservedQuantities", [0, 10, *range(30, 6_000, 10)]), "missing"),
        ("books", table("/m/conserved_quantities", "ConservedQuantities", range(0, 5_000, 10)), "missing"),
        (
            "timing",
            table("/n/timing", "CycleTiming", [49, 149], turnaround=[np.zeros(50, np.float32)] * 2),
            "missing",
        ),
    ],
)
def test_a_record_that_is_lost_or_double_is_found(tmp_path, name, changed, wrong):
    found = failing(judge_records(records_of(bag(tmp_path, **{name: changed}), 6_000), TS, lockstep=False))
    assert len(found) == 1 and wrong in found[0]


def test_a_node_that_falls_behind_is_found(tmp_path):
    cycles = np.arange(6_000)
    drifting = table("/impedance_mpc/command", "ImpedanceCommand", cycles, 0.01 * cycles / len(cycles))
    (found,) = [
        one for one in judge_records(records_of(bag(tmp_path, command=drifting), 6_000), TS, False) if not one.ok
    ]
    assert "drift" in found.name and found.found == pytest.approx(10.0 / 3.0, abs=0.01)  # ms


@given(st.integers(1, 9), st.integers(0, 8), st.sampled_from([0.0, 0.01]))
@pytest.mark.slow
def test_where_batches_begin_is_no_drift_and_hides_none(many, shift, drift):
    """Batches of ``many`` messages that begin elsewhere from the middle of the ride on."""
    cycles = np.arange(6_000)
    begin = np.where(cycles < 3_000, 0, shift)
    sent = cycles + (begin - 1 - cycles) % many  # the cycle with which its batch is handed over
    late = (sent - cycles) * LONG + 1e-6 * (cycles - sent) + drift * cycles / len(cycles)
    command = table("/impedance_mpc/command", "ImpedanceCommand", cycles, late)
    found = records_of(bag(Path("/nowhere"), command=command), 6_000).behind["/impedance_mpc/command"]
    assert found.last - found.first == pytest.approx(drift / 3.0, abs=5e-4)  # s, of a block's length


def test_an_empty_bag_fails(tmp_path):
    found = records_of(Bag(tmp_path, "mcap", True, {}), 10)
    assert len(failing(judge_records(found, TS, lockstep=False))) >= 3


def test_repeated_edges_of_the_catenary_are_no_doubles():
    assert stream(table("/c", "CatenaryState", [0, 0, 1, 2, 3, 3]), 3).doubles == 0
    assert stream(table("/c", "RigState", [0, 0, 1, 2]), 3).doubles == 1
    rig = table("/r", "RigState", [0, 1, 2])
    late = Table("/c", "CatenaryState", np.array([0, 2, 340, 342]) * 10**6, {"cycle": np.array([0, 1, 1, 2])})
    assert stream(late, 2, rig, lockstep=True).doubles == 0  # nobody had answered for a third of a second
    assert stream(late, 2, rig).doubles == 1  # in real time nobody waits for so long
    answers, again = table("/c", "ImpedanceCommand", [0, 1, 1, 2]), table("/r", "RigState", [0, 1, 1, 2])
    assert stream(answers, 3, rig, lockstep=True).doubles == 1
    assert stream(answers, 3, again, lockstep=True).doubles == 0  # to a state that came again


@given(st.integers(0, 999), st.integers(0, 999), st.integers(1, 9))
@pytest.mark.slow
def test_in_real_time_a_message_comes_again_only_where_the_rig_counted_late_commands(cycle, counted, late):
    cycles = np.arange(1000)
    rig = table("/r", "RigState", cycles, late_commands=late * (cycles >= counted))
    commands = table("/c", "ImpedanceCommand", [*cycles, cycle])
    explained = cycle <= counted <= cycle + SOON and counted > 0
    assert stream(commands, 1000, rig).doubles == (0 if explained else 1)


def test_in_lockstep_nodes_keep_together_by_waiting_and_drift_is_not_judged(tmp_path):
    cycles = np.arange(6_000)
    drifting = table("/impedance_mpc/command", "ImpedanceCommand", cycles, 0.01 * cycles / len(cycles))
    found = judge_records(records_of(bag(tmp_path, command=drifting), 6_000, lockstep=True), TS, lockstep=True)
    assert failing(found) == [] and not [one for one in found if "drift" in one.name]


def test_batches_and_decimated_topics_say_nothing_about_drift(tmp_path):
    cycles = np.arange(6_000)[::10]
    slow = table("/energy_monitor/conserved_quantities", "ConservedQuantities", cycles, 0.1 * cycles / 6_000)
    assert failing(judge_records(records_of(bag(tmp_path, books=slow), 6_000), TS, lockstep=False)) == []


# Options and the whole ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "arguments",
    [("--minutes", "0"), ("--minutes", "nan"), ("--rate", "1e6"), ("--viewers", "-1"), ("--out", "/dev/null")],
)
def test_wrong_options_are_one_line(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        parse(arguments)
    assert ended.value.code == 2
    assert len([line for line in capsys.readouterr().err.splitlines() if "error:" in line]) == 1


@pytest.mark.integration
@pytest.mark.alone
def test_half_a_minute_of_a_ride_holds(tmp_path):
    out, file = tmp_path / "soak", tmp_path / "soak.json"
    began = time.monotonic()
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "soak",
            "--minutes",
            "0.5",
            "--mode",
            "lockstep",
            "--out",
            str(out),
            "--json",
            str(file),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300.0,
        env=dict(os.environ, ROS_DOMAIN_ID=os.environ["PHIL_TEST_DOMAIN_RIDES"]),
    )
    document = json.loads(file.read_text())
    wrong = {one["name"]: one["found"] for one in document["verdicts"] if not one["ok"]}
    assert done.returncode == (1 if wrong else 0), done.stdout
    # Within seconds queues still fill up, and few looks are taken: what a minute brings is told by the script itself.
    growth = {name: found for name, found in wrong.items() if "growth" in name}
    assert wrong.keys() == growth.keys(), done.stdout
    assert all(found is None or found < 8.0 for found in growth.values()), (wrong, time.monotonic() - began)
    assert {one["messages"] for one in document["streams"] if one["topic"].endswith(("rig_sim/state", "command"))} == {
        15_000
    }
    assert document["viewers"]["messages"] > 0 and (out / "memory.png").stat().st_size > 10_000
