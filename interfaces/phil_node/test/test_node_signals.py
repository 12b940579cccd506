"""Signals in a node's process, phase by phase; the nodes themselves are in tests/integration."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest

RUNNING = """
import sys, time
from phil_node.signals import Ending, asked_to_end
with Ending() as ending:
    print("up", flush=True)
    while not ending.asked:
        time.sleep(0.01)
    print("asked", asked_to_end(), flush=True)
    time.sleep({rest})
print("through", flush=True)
"""
IMPORTING = """
import time
from phil_node.signals import end_quietly_on_interrupt
end_quietly_on_interrupt()
print("up", flush=True)
time.sleep(20)
"""


def start(code: str, *, nohup: bool = False) -> subprocess.Popen[str]:
    def as_from_a_terminal() -> None:
        # Whoever runs the tests may have started them with nohup, or in the background of a script.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_IGN if nohup else signal.SIG_DFL)

    command = [sys.executable, "-c", code]
    pipe = subprocess.PIPE
    made = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=as_from_a_terminal)
    assert made.stdout is not None and made.stdout.readline() == "up\n"
    return made


@pytest.mark.parametrize("kind", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_in_order_and_its_twin_changes_nothing(kind: signal.Signals) -> None:
    child = start(RUNNING.format(rest=0.2))
    for number in (kind, kind):
        child.send_signal(number)
        time.sleep(0.05)
    out, err = child.communicate(timeout=20)
    assert (child.returncode, out, err) == (0, "asked True\nthrough\n", "")


def test_a_second_signal_after_a_while_ends_at_once() -> None:
    child = start(RUNNING.format(rest=20))
    child.send_signal(signal.SIGINT)
    time.sleep(0.7)
    child.send_signal(signal.SIGTERM)
    out, err = child.communicate(timeout=10)
    assert (child.returncode, out, err) == (128 + signal.SIGTERM, "asked True\n", "")


def test_an_interrupt_before_there_is_a_node_leaves_no_traceback() -> None:
    child = start(IMPORTING)
    child.send_signal(signal.SIGINT)
    _, err = child.communicate(timeout=20)
    assert (child.returncode, err) == (-signal.SIGINT, "")


def test_nohup_is_heeded() -> None:
    child = start(RUNNING.format(rest=0), nohup=True)
    child.send_signal(signal.SIGHUP)
    time.sleep(0.1)
    assert child.poll() is None
    child.send_signal(signal.SIGTERM)
    out, _ = child.communicate(timeout=20)
    assert (child.returncode, out) == (0, "asked True\nthrough\n")
