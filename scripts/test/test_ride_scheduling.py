"""Who gets the processor first, as the system sees it."""

import os
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phil_base import scheduling
from phil_base.scheduling import (
    CYCLE,
    PRIORITY,
    ROLES,
    cpus_in_words,
    cpus_of,
    go_first,
    highest_priority,
    priority_of,
    schedule,
    stay_on,
)
from ride.processes import Process, end_all
from ride.settings import NODES, as_ordinary, resolve

SLEEP = "import threading, time; threading.Thread(target=time.sleep, args=(60,), daemon=True).start(); time.sleep(60)"
WITHOUT_RIGHTS = ("setpriv", "--bounding-set=-all", "--inh-caps=-all")


@pytest.fixture
def children(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where -m looks for a module
    (tmp_path / "sleeper.py").write_text(SLEEP)
    started = [Process("sleeper", "sleeper", [], tmp_path / f"log{i}") for i in range(2)]
    yield started
    end_all(started, patience=0.0)


def test_all_threads_of_a_ride_go_first_or_none(children):
    deadline = time.monotonic() + 10.0
    while not all(len(threads(child)) == 2 for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    allowed = go_first([child.pid for child in children])
    policies = {os.sched_getscheduler(thread) for child in children for thread in threads(child)}
    assert policies == {os.SCHED_FIFO if allowed else os.SCHED_OTHER}
    if allowed:
        assert os.sched_getparam(children[0].pid).sched_priority == PRIORITY


def threads(child):
    return [int(name) for name in os.listdir(f"/proc/{child.pid}/task")]


def test_what_is_granted_is_what_a_thread_has_afterwards(children):
    answer = schedule([children[0].pid], CYCLE)
    priority = os.sched_getparam(children[0].pid).sched_priority
    assert priority == min(CYCLE, highest_priority())
    assert answer.granted.startswith(f"SCHED_FIFO {priority}" if priority else "ordinary")
    assert bool(answer.advice) == (priority < CYCLE)


def test_less_than_wanted_is_taken_and_said(children, monkeypatch):
    allowed = min(3, highest_priority())
    monkeypatch.setattr(scheduling, "highest_priority", lambda: allowed)
    answer = schedule([children[0].pid], CYCLE)
    assert os.sched_getparam(children[0].pid).sched_priority == allowed
    assert "rtprio" in answer.advice


@given(st.sampled_from(sorted(ROLES)), st.integers(1, 98), st.booleans())
def test_nobody_comes_before_the_cycle(role, top, level):
    assert 1 <= priority_of(role, top, level) <= top
    order = ("listen", "transport", "serve", "publish", "environment", "controller", "rig")
    priorities = [priority_of(each, top, level) for each in order]
    assert priorities == sorted(priorities)


def test_in_lockstep_all_have_one_priority():
    assert {priority_of(role, level=True) for role in ROLES} == {PRIORITY}


@given(st.sets(st.integers(0, 9999)))
def test_a_list_of_cpus_is_read_as_it_is_written(cpus):
    assert cpus_of(cpus_in_words(cpus)) == cpus


@pytest.mark.parametrize("text", ["a", "3-1", "1,,2", "-1", "1-", "0x1", "1;2", "12345"])
def test_what_is_no_list_of_cpus_is_refused(text):
    with pytest.raises(ValueError, match="is no list of CPUs"):
        cpus_of(text)


def test_threads_stay_on_their_cpus_and_a_missing_one_is_said(children):
    one = min(os.sched_getaffinity(0))
    assert stay_on([children[0].pid], frozenset({one})).granted == str(one)
    assert os.sched_getaffinity(children[0].pid) == {one}
    answer = stay_on([children[0].pid], frozenset({9999}))
    assert "9999 was refused" in answer.granted
    assert "real_time.cpus" in answer.advice
    assert os.sched_getaffinity(children[0].pid) == {one}


ALL = """
import os, threading
from phil_base.real_time import RealTime, apply, set_thread
from phil_base.parameters import defaults, build, nest
from phil_base.memory import status_of
values = {k.removeprefix("real_time."): v for k, v in defaults("test_rig_sim").items() if k.startswith("real_time.")}
on, off, done = threading.Event(), threading.Event(), []
def cycle(role):
    set_thread(role)
    done.append(threading.get_native_id())
    on.set()
    off.wait()
for role in ("rig", "publish", "serve"):
    on.clear()
    threading.Thread(target=cycle, args=(role,), daemon=True).start()
    on.wait()
for _ in range(16):
    threading.Thread(target=off.wait, daemon=True).start()
resident = status_of("VmRSS")
def see(thread):
    return os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority
had = os.sched_getaffinity(0)
for change in ({}, {"priority": 20}, {"scheduling": "ordinary"}):
    granted = apply(build(RealTime, values | change))
    apart = all(os.sched_getaffinity(one) == {max(had)} for one in done)
    apart = apart and os.sched_getaffinity(0) == (had - {max(had)} or had)
    print(*see(0), *see(done[0]), bool(granted.advice), granted.figures["scheduling of cycle"], int(apart), sep=";")
grown = (status_of("VmRSS") - resident) / 2**20
print(int(status_of("VmLck") > 0), grown, open(f"/proc/self/timerslack_ns").read().strip(), sep=";")
"""


@pytest.mark.parametrize("rights", [True, False])
@pytest.mark.slow
def test_a_process_gets_what_it_may_and_says_the_rest(rights):
    """In a process of its own: what is asked for holds for the whole process."""
    lead = () if rights else WITHOUT_RIGHTS
    done = subprocess.run([*lead, sys.executable, "-c", ALL], capture_output=True, text=True)
    if "setpriv" in done.stderr:
        pytest.skip(done.stderr)
    assert not done.returncode, done.stderr
    *steps, (locked, grown, slack) = (line.split(";") for line in done.stdout.splitlines())
    lines = steps
    by_role, shifted, ordinary = ([int(word) for word in step[:4]] for step in steps)
    assert ordinary == [os.SCHED_OTHER, 0, os.SCHED_OTHER, 0]
    assert "as asked for" in steps[2][5]
    # The heap that is asked for, as much for small objects, and not 8 MiB of stack for each of the threads.
    assert 16.0 <= float(grown) < 24.0
    fifo = os.SCHED_FIFO
    if by_role[0] == fifo:
        assert by_role == [fifo, ROLES["transport"], fifo, CYCLE]
        assert shifted == [fifo, 15, fifo, 20]
        # The cycle on the last CPU, the rest elsewhere; without SCHED_FIFO both wherever there is room.
        alone = str(int(len(os.sched_getaffinity(0)) == 1))
        assert [step[6] for step in lines] == ["1", "1", alone]
        assert steps[0][4] == str(locked == "0")  # advice only for what was refused
    else:
        assert by_role == shifted == [os.SCHED_OTHER, 0, os.SCHED_OTHER, 0]
        assert "refused" in steps[0][5] and steps[0][4] == "True"
        assert slack == "1000"


LET_GO = """
import os, subprocess, sys
from phil_base.real_time import let_go
def see(process):
    return os.sched_getscheduler(process), len(os.sched_getaffinity(process))
before = see(0)
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
child = subprocess.Popen(["sleep", "60"])
let_go(child.pid)
print(see(child.pid) == (os.SCHED_OTHER, before[1]), see(0) == (os.SCHED_FIFO, 1))
child.kill()
child.wait()
"""


@pytest.mark.skipif(highest_priority() < 1, reason="SCHED_FIFO is not granted here")
def test_what_a_thread_of_the_loop_starts_is_an_ordinary_process_on_all_cpus():
    done = subprocess.run([sys.executable, "-c", LET_GO], capture_output=True, text=True)
    assert done.stdout.split() == ["True", "True"], done.stderr


def test_a_ride_in_the_ordinary_class_asks_for_nothing_in_any_node():
    settings = resolve(None, as_ordinary({"test_rig_sim": {"seed": 5}}))
    assert {settings[name]["real_time.scheduling"] for name in NODES} == {"ordinary"}
    assert settings["test_rig_sim"]["seed"] == 5
