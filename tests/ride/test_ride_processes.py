"""Children end when they are told to, and leave no shared memory."""

import fcntl
import signal
import subprocess
import sys
import time
from pathlib import Path

from ride.processes import Process, end_all
from ride.shared_memory import remove_litter, snapshot


def test_a_child_that_ignores_everything_is_killed(tmp_path):
    deaf = "[signal.signal(s, signal.SIG_IGN) for s in (2, 15)]"
    code = f"import signal, time; {deaf}; print('up', flush=True); time.sleep(60)"
    child = Process("deaf", ["-c", code], tmp_path / "log")
    while "up" not in child.last_words():
        time.sleep(0.05)
    child.ask_to_end()
    started = time.monotonic()
    child._child.send_signal(signal.SIGTERM)
    end_all([child], patience=0.2)
    assert child.ended and time.monotonic() - started < 10.0


def test_a_child_dies_with_its_parent(tmp_path):
    log = tmp_path / "log"
    code = (
        "import pathlib, sys, time; from ride.processes import Process;"
        f"p = Process('c', ['-c', 'import time; time.sleep(60)'], pathlib.Path({str(log)!r}));"
        "print(p._child.pid, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    time.sleep(0.5)
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
    child = Process("talker", ["-c", "print('a'); print('b'); raise SystemExit(3)"], tmp_path / "log")
    assert child.wait(20.0)
    assert child.code == 3
    assert child.last_words(1) == "b"


def test_only_unused_litter_of_the_middleware_is_removed(tmp_path):
    (tmp_path / "fastrtps_old").write_bytes(b"")
    before = snapshot(tmp_path)
    for name in ("fastrtps_dead", "fastrtps_dead_el", "fastrtps_busy", "fastrtps_busy_el", "other"):
        (tmp_path / name).write_bytes(b"")
    with (tmp_path / "fastrtps_busy_el").open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        removed = remove_litter(before, tmp_path)
    assert removed == ["fastrtps_dead", "fastrtps_dead_el"]
    assert snapshot(tmp_path) == {"fastrtps_old", "fastrtps_busy", "fastrtps_busy_el", "other"}
