"""Children end when they are told to, and leave no shared memory."""

import fcntl
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ride.processes import Nursery, Process, end_all
from ride.shared_memory import remove_litter, snapshot


@pytest.fixture(autouse=True)
def _modules(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where -m looks for a module


def start(folder: Path, code: str) -> Process:
    (folder / "pupil.py").write_text(code)
    return Process("pupil", "pupil", [], folder / "log")


def test_a_child_that_ignores_everything_is_killed(tmp_path):
    deaf = "[signal.signal(s, signal.SIG_IGN) for s in (2, 15)]"
    code = f"import signal, time; {deaf}; print('up', flush=True); time.sleep(60)"
    child = start(tmp_path, code)
    while "up" not in child.last_words():
        time.sleep(0.05)
    child.ask_to_end()
    started = time.monotonic()
    end_all([child], patience=0.2)
    assert child.ended and time.monotonic() - started < 10.0


def test_a_child_dies_with_its_parent(tmp_path):
    log = tmp_path / "log"
    (tmp_path / "sleeper.py").write_text("import time; print('up', flush=True); time.sleep(60)")
    code = (
        "import pathlib, time; from ride.processes import Process;"
        f"p = Process('c', 'sleeper', [], pathlib.Path({str(log)!r}));"
        "\nwhile 'up' not in p.last_words(): time.sleep(0.05)\n"
        "print(p.pid, flush=True); time.sleep(60)"
    )
    command = [sys.executable, "-c", code]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    parent.kill()
    parent.wait()
    for _ in range(50):
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
        except FileNotFoundError:
            break
        if state == "Z":
            break
        time.sleep(0.1)
    else:
        raise AssertionError("the child outlived its parent")


def test_last_words_are_the_last_lines(tmp_path):
    child = start(tmp_path, "print('a'); print('b'); raise SystemExit(3)")
    assert child.wait(20.0)
    assert child.code == 3
    assert child.last_words(1) == "b"


def test_a_start_removes_what_is_old_and_free_and_leaves_what_others_just_make(tmp_path):
    for name in ("fastrtps_dead", "fastrtps_dead_el", "fastrtps_held", "fastrtps_held_el", "sem.fastrtps_port7_mutex"):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (1e9, 1e9))
    (tmp_path / "fastrtps_new_el").write_bytes(b"")
    with (tmp_path / "fastrtps_held_el").open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        assert remove_litter(folder=tmp_path) == ["fastrtps_dead", "fastrtps_dead_el", "sem.fastrtps_port7_mutex"]
    assert snapshot(tmp_path) == {"fastrtps_held", "fastrtps_held_el", "fastrtps_new_el"}


def test_only_unused_litter_of_the_middleware_is_removed(tmp_path):
    (tmp_path / "fastrtps_young").write_bytes(b"")
    for name in ("fastrtps_port7_el", "sem.fastrtps_port7_mutex", "unrelated"):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (1e9, 1e9))
    before = snapshot(tmp_path)
    for name in ("fastrtps_dead", "fastrtps_dead_el", "fastrtps_busy", "fastrtps_busy_el", "other"):
        (tmp_path / name).write_bytes(b"")
    with (tmp_path / "fastrtps_busy_el").open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        removed = remove_litter(before, tmp_path)
    assert removed == ["fastrtps_dead", "fastrtps_dead_el", "fastrtps_port7_el", "sem.fastrtps_port7_mutex"]
    assert snapshot(tmp_path) == {"fastrtps_young", "fastrtps_busy", "fastrtps_busy_el", "other", "unrelated"}


def test_a_kind_of_process_of_ones_own_is_forked_like_any_other(tmp_path, monkeypatch):
    class Other(Process):
        def __init__(self, name, module, arguments, log):
            super().__init__(name, "ride.parameter_table", arguments, log)

    nursery = Nursery()
    monkeypatch.setattr(Other, "nursery", nursery)
    monkeypatch.setenv("PHIL_ROOT", str(tmp_path))
    child = Other("any", "json.tool", [], tmp_path / "any.log")
    nursery.open()
    assert child.wait(20.0), child.last_words()
    assert (child.code, (tmp_path / "docs" / "parameters.md").exists()) == (0, True), child.last_words()
