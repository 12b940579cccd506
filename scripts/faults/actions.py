"""What is done to a ride: signals, relayed messages, other processes, a full disk, a clock that is set."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from faults.begun import BEGUN
from faults.stand import RECORDER, Stand
from ride.processes import Process, end_all

TOPICS = b"phil_node.topics_process"


class Wrong(Exception):  # noqa: N818 - no error of ours: the finding of a row
    """What was seen beside the ride is not as it has to be; the text says what."""


def nothing(stand: Stand) -> list[str]:
    """Let the ride go on for 2 s."""
    stand.wait(2.0)
    return []


def stop(stand: Stand, name: str, seconds: float) -> list[str]:
    """Let a process stand still."""
    stand.signal(name, signal.SIGSTOP)
    try:
        stand.wait(seconds)
    finally:
        stand.signal(name, signal.SIGCONT)
    return []


def end(stand: Stand, name: str, number: int) -> list[str]:
    """End a process by a signal; the recorder says by its exit code what became of the bag."""
    stand.signal(name, number)
    stand.until(lambda: stand.processes[name].ended, 10.0, f"{name} did not end")
    stand.wait(0.5)
    return [f"{name}: exit code {stand.processes[name].code}"]


def topics_of(stand: Stand, name: str) -> int:
    """Give the number of the process that speaks on a node's topics; 0 if there is none."""
    node = stand.processes[name].pid
    for child in Path(f"/proc/{node}/task/{node}/children").read_text().split():
        with suppress(OSError):
            if TOPICS in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0"):
                return int(child)
    return 0


def topics(stand: Stand, name: str, number: int, pause: float = 0.0) -> list[str]:
    """Send a signal to the process for a node's topics; one that is killed has a successor soon."""
    before = topics_of(stand, name)
    if not before:
        raise Wrong(f"{name} has no process for its topics")
    os.kill(before, number)
    stand.wait(pause)
    if number == signal.SIGSTOP:
        os.kill(before, signal.SIGCONT)
        return []
    stand.until(lambda: topics_of(stand, name) not in (0, before), 5.0, f"the topics of {name} did not come back")
    return [f"{name}: started again"]


def damage(stand: Stand, kind: str, share: float, seconds: float, delay: float = 0.0) -> list[str]:
    """Let the relay spoil messages of its link for a while."""
    stand.order(kind, share, delay)
    stand.begin()
    stand.wait(seconds)
    count = stand.order("none", 0.0)
    if count == 0:
        raise Wrong("the relay found no message to do it to")
    return [f"{count} messages"]


def beside(
    stand: Stand, module: str, words: Sequence[str], seconds: float, number: int = signal.SIGINT, pause: float = 0.0
) -> list[str]:
    """Run another process beside the ride; after ``seconds`` it is stopped for ``pause`` s, then ended by a signal."""
    log = stand.logs / f"{module.rpartition('.')[2]}-{'-'.join(words)}.log"
    other = Process(module, module, list(words), log)
    try:
        stand.until(lambda: other.ended or BEGUN in other.last_words(), 30.0, f"{module} did not begin")
        stand.begin()
        stand.wait(seconds)
        if other.ended:
            raise Wrong(f"it ended by itself: {other.last_words(1)}")
        if pause:
            other.ask_to_end(signal.SIGSTOP)
            stand.wait(pause)
            other.ask_to_end(signal.SIGCONT)
        other.ask_to_end(number)
        stand.until(lambda: other.ended, 10.0, "it did not end")
    finally:
        end_all([other], patience=0.0)
    return []


def clock(stand: Stand, seconds: float) -> list[str]:
    """Set the wall clock of all processes of the ride."""
    assert stand.clock is not None
    stand.clock.set(seconds)
    stand.wait(2.0)
    return ["by a shim (LD_PRELOAD) in the nodes and the recorder: the machine's own clock is not touched"]


def fill(stand: Stand) -> list[str]:
    """Wait until the recorder has filled its disk."""
    recorder = stand.processes[RECORDER]
    stand.until(lambda: recorder.ended, 25.0, "the recorder did not notice that its disk is full")
    stand.begin()
    stand.wait(0.5)
    if recorder.code != 3:
        raise Wrong(f"the recorder ended with code {recorder.code}, not 3")
    return [f"recorder: exit code {recorder.code}, '{recorder.last_words(1)}'"]


def second_ride(stand: Stand) -> list[str]:
    """Start the run script on the same domain: it has to refuse."""
    command = [sys.executable, "-m", "ride", "--duration", "1", "--out", str(stand.folder / "second")]
    started = subprocess.Popen(
        [*command, "--overwrite"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        deadline = time.monotonic() + 60.0
        while started.poll() is None and time.monotonic() < deadline:
            stand.spin()
        text = started.communicate(timeout=1.0)[0]
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGKILL)
    said = next((line for line in text.splitlines() if "already" in line), "")
    if started.returncode != 1 or not said:
        raise Wrong(f"the second ride ended with code {started.returncode}: {text.strip().splitlines()[-1:]}")
    return [f"second ride: exit code 1, '{said}'"]


def run_script(folder: Path, name: str) -> list[str]:
    """Ride with the run script, kill a process of it, and see what it says."""
    module = "energy_monitor.record" if name == RECORDER else f"{name}.node"
    out = folder / f"run-{name}"
    command = [sys.executable, "-m", "ride", "--mode", "realtime", "--duration", "0", "--no-report", "--out", str(out)]
    started = subprocess.Popen(
        [*command, "--overwrite"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        deadline = time.monotonic() + 90.0
        while sum(file.stat().st_size for file in out.glob("bag/*.mcap")) < 1_000_000:
            if started.poll() is not None or time.monotonic() > deadline:
                raise Wrong("the ride did not begin")
            time.sleep(0.05)
        os.kill(_child(started.pid, module), signal.SIGKILL)
        text = started.communicate(timeout=60.0)[0]
    finally:
        if started.poll() is None:
            os.killpg(started.pid, signal.SIGTERM)
            started.communicate()
    said = next((line for line in text.splitlines() if "ended with code" in line), "")
    if started.returncode != 1 or name not in said:
        raise Wrong(f"the run script ended with code {started.returncode}: {text.strip().splitlines()[-1:]}")
    return [f"run script: exit code 1, '{said}'"]


def _child(parent: int, module: str) -> int:
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text().rpartition(")")[2].split()
                line = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if int(status[1]) == parent and module.encode() in line:
                return int(entry.name)
    raise Wrong(f"the ride has no process of {module}")
