"""Who gets the processor first, as the system sees it."""

import os
import time

import pytest

from phil_node.scheduling import PRIORITY, go_first
from ride.processes import Process, end_all

SLEEP = "import threading, time; threading.Thread(target=time.sleep, args=(60,), daemon=True).start(); time.sleep(60)"


@pytest.fixture
def children(tmp_path, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")]))
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
