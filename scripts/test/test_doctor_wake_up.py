"""The measurement of wake-ups, and what it means for a ride."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from doctor.cyclictest import parsed
from doctor.finding import CHANGE, NOTE, OK
from doctor.sheet import advice
from doctor.verdict import EASY, GAP, P999, judged
from doctor.wake_up import EDGES, PERIOD, WakeUps, measure, sleeper, together


def lateness(*, usual=2e-5, rare=2e-5, largest=2e-5):
    """Give 10,000 wake-ups of which 20 are rare ones and one is the largest."""
    late = np.full(10_000, usual)
    late[:20] = rare
    late[0] = max(rare, largest)
    return WakeUps("SCHED_FIFO 45", "0", late)


@pytest.mark.slow
def test_each_period_is_measured_on_each_cpu():
    cpus = sorted(os.sched_getaffinity(0))
    begun = time.monotonic()
    told = []
    found = measure(0.2, 0, cpus, told.append)
    assert time.monotonic() - begun >= 0.2
    assert [row.cpu for row in found] == [str(cpu) for cpu in cpus]
    assert all(row.late.size == round(0.2 / PERIOD) and (row.late > 0.0).all() for row in found)
    assert told == sorted(told) and told[-1] == 1.0


def test_a_period_that_was_slept_through_is_late_too():
    """A start that lies 10 periods back: the first wake-up is late for 11 of them, each by a period less."""
    late = np.zeros(30, np.int64)
    period = 50_000_000
    sleeper()(time.monotonic_ns() - 10 * period - period // 2, period, 11, late)
    assert np.diff(late[:11]) == pytest.approx(-period)
    assert late[0] >= 10 * period
    assert not late[11:].any()


def test_a_process_that_ends_before_its_time_is_no_measurement():
    with pytest.raises(RuntimeError, match="ended with status"):
        measure(0.1, 0, [9999])


def test_the_histogram_counts_every_wake_up():
    row = WakeUps("ordinary", "1", np.array([5e-7, 3e-6, 3e-6, 9.0]))
    counts = row.histogram()
    assert sum(counts) == 4 and counts[0] == 1 and counts[-1] == 1
    assert counts[1 + EDGES.index(2e-6)] == 2
    assert len(row.line()) == len(EDGES) + 1 and row.line().count(" ") == len(EDGES) + 1 - 3
    assert together([row, row]).late.size == 8


@pytest.mark.parametrize(
    ("row", "verdict"),
    [
        (lateness(), OK),
        (lateness(rare=0.9 * EASY), OK),
        (lateness(rare=1.1 * EASY), NOTE),
        (lateness(largest=0.003), NOTE),
        (lateness(rare=1.1 * P999), CHANGE),
        (lateness(largest=1.1 * GAP), CHANGE),
    ],
)
def test_wake_ups_are_judged_by_what_they_do_to_a_cycle(row, verdict):
    found = judged([lateness(), row], True, "type this")
    assert found.verdict == verdict
    assert judged([row], False, "type this").verdict == OK
    assert advice([found]) == ([] if verdict == OK else [f"{verdict}, wake-up, SCHED_FIFO 45: type this"])


CYCLICTEST = """# /dev/cpu_dma_latency set to 0us
# Histogram
000000 000000\t000001
000003 000007\t000000
000012 000002\t000008
# Total: 000000009 000000009
# Min Latencies: 00003 00000
# Avg Latencies: 00005 00010
# Max Latencies: 00700 00012
# Histogram Overflows: 00001 00000
# Histogram Overflow at cycle number:
"""


def test_cyclictests_histogram_is_read_with_what_is_beyond_it():
    first, second = parsed(CYCLICTEST, [4, 6], "SCHED_FIFO 45")
    assert (first.cpu, second.cpu) == ("4", "6")
    assert sorted(first.late) == pytest.approx([3e-6] * 7 + [12e-6] * 2 + [700e-6])
    assert sorted(second.late) == pytest.approx([0.0] + [12e-6] * 8)


@pytest.mark.parametrize("text", ["", CYCLICTEST.replace("# Max", "# Most"), CYCLICTEST.replace("00700 ", "")])
def test_what_cyclictest_does_not_say_is_no_measurement(text):
    with pytest.raises(ValueError, match="cyclictest has"):
        parsed(text, [4, 6], "SCHED_FIFO 45")


def doctor(*arguments):
    return subprocess.run([sys.executable, "-m", "doctor", *arguments], capture_output=True, text=True)


@pytest.mark.parametrize(
    "arguments",
    [("--seconds", "0"), ("--seconds", "x"), ("--domain", "233"), ("--domain", "-1"), ("--json", "/no/such/file")],
)
def test_wrong_use_is_said_at_once(arguments):
    done = doctor(*arguments)
    assert done.returncode == 2
    assert arguments[1] in done.stderr and "Traceback" not in done.stderr


@pytest.mark.slow
def test_an_examination_ends_with_what_stands_against_a_ride(tmp_path, monkeypatch):
    """The whole: the exit code, the words and the document say the same."""
    monkeypatch.setenv("PATH", "/nonexistent")  # cyclictest takes whole seconds, where it is installed
    file = tmp_path / "doctor.json"
    done = doctor("--seconds", "0.2", "--json", str(file), "--bags", str(tmp_path))
    assert done.returncode in (0, 1), done.stderr
    document = json.loads(file.read_text())
    against = [found["name"] for found in document["findings"] if found["verdict"] == CHANGE]
    assert document["good"] == (done.returncode == 0) == (not against)
    assert (
        done.stdout.strip()
        .splitlines()[-1]
        .endswith(", ".join(against) or "nothing stands against a ride in real time at 500 Hz")
    )
    assert {row["measured_by"] for row in document["wake_ups"]} == {"doctor"}
    assert all(found["do"] for found in document["findings"] if found["verdict"] == CHANGE)
