"""Children that are forked: they end, log, and are seen like those that are started."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from phil_base.command_words import show
from phil_base.forked import Forked, fork

COMMAND = [sys.executable, "-c", "print('started')"]


def child(body, tmp_path: Path, **more) -> Forked:
    with (tmp_path / "log").open("wb") as output:
        return fork(body, COMMAND, "a child", output.fileno(), **more)


def test_code_output_and_place(tmp_path):
    def body() -> int:
        print("session", os.getsid(0) == os.getpid())
        print("input", os.read(0, 1))
        print("files", len(os.listdir("/proc/self/fd")))  # and the one by which it lists
        print(Path("/proc/self/cmdline").read_bytes().split(b"\0")[:2], Path("/proc/self/comm").read_text(), end="")
        return 7

    forked = child(body, tmp_path)
    assert forked.wait(10.0) == 7 == forked.poll()
    command = [word.encode() for word in COMMAND[:2]]
    said = f"session True\ninput b''\nfiles 4\n{command} a child\n"
    assert (tmp_path / "log").read_text() == said


@pytest.mark.parametrize(("error", "code"), [(SystemExit(3), 3), (SystemExit(), 0), (KeyboardInterrupt(), 130)])
def test_exceptions_that_end_a_process_give_its_code(error, code, tmp_path):
    def body() -> None:
        raise error

    assert child(body, tmp_path).wait(10.0) == code
    assert (tmp_path / "log").read_text() == ""


def test_an_error_is_told_as_an_interpreter_does(tmp_path):
    def body() -> None:
        raise ValueError("what went wrong")

    assert child(body, tmp_path).wait(10.0) == 1
    assert (tmp_path / "log").read_text().endswith("ValueError: what went wrong\n")


def test_handlers_of_the_parent_are_not_those_of_the_child(tmp_path):
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    try:
        forked = child(lambda: time.sleep(60.0), tmp_path)
    finally:
        signal.signal(signal.SIGTERM, before)
    with pytest.raises(subprocess.TimeoutExpired):
        forked.wait(0.3)
    assert forked.poll() is None
    forked.send_signal(signal.SIGTERM)
    assert forked.wait(10.0) == -signal.SIGTERM
    forked.kill()  # nothing: it is over


def test_a_child_waits_at_its_gate_and_keeps_only_what_it_needs(tmp_path):
    wait, opened = os.pipe()
    kept, other = os.pipe()
    first = child(lambda: os.write(other, b"x") and 5, tmp_path, gate=wait, keep=(other,))
    assert first.poll() is None
    os.write(opened, b"\0")
    assert first.wait(10.0) == 5
    assert os.read(kept, 1) == b"x"
    second = child(lambda: 5, tmp_path, gate=wait)
    os.close(opened)  # nobody opens it any more
    assert second.wait(10.0) == 0
    for file in (wait, kept, other):
        os.close(file)


def test_where_the_kernel_shows_no_other_words_the_command_is_executed(tmp_path, monkeypatch):
    monkeypatch.setattr("phil_base.command_words.show", lambda words, name: False)
    assert child(lambda: 9, tmp_path).wait(20.0) == 0
    assert (tmp_path / "log").read_text() == "started\n"


def test_words_are_shown_whole():
    code = (
        "import sys; from pathlib import Path; from phil_base.command_words import show\n"
        "assert show(['one', 'two three', ''], 'a name of more than 15 bytes')\n"
        "print(Path('/proc/self/cmdline').read_bytes(), Path('/proc/self/comm').read_text().strip())\n"
        "assert show(['x' * 5000], 'y')\n"
        "print(len(Path('/proc/self/cmdline').read_bytes()), Path('/proc/self/environ').read_bytes()[:5])"
    )
    environment = {**os.environ, "A": "b"}
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    first, second = said.stdout.splitlines()
    assert first == r"b'one\x00two three\x00\x00' a name of more"
    assert second.startswith("5001 ")
    assert callable(show)
