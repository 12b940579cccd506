"""Ordinary work beside a ride: viewers, a second recorder, a reader of parameters, busy processes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

OUTSIDE = Path(__file__).with_name("outside.py")
RECORDER = "energy_monitor.record"
VIEWERS = 10
STAGGER, LOOK = 0.4, 0.1
"""s between the starts of two viewers; s between two looks at all of them."""
NOT_OURS = ("FASTRTPS_", "FASTDDS_", "RMW_FASTRTPS_", "SKIP_DEFAULT_XML", "PHIL_", "ROS_AUTOMATIC_DISCOVERY_RANGE")
"""Beginnings of variables that a run script may set for the nodes: a user's own tools have the defaults."""
READY_SECONDS = 60.0
PATIENCE = 10.0
RECORDER_PATIENCE = 30.0


class DisturbanceError(Exception):
    """Something that was to disturb the ride did not come up."""


@dataclass(frozen=True)
class Work:
    """What the disturbers had done in the end."""

    visits: int
    messages: int
    topics: int
    """Most topics from which one viewer read in one visit."""
    rounds: int
    """Times that the parameters of all nodes were read."""
    parameters: int
    """Most parameters in one round."""
    silent: int
    """Nodes that did not answer in time, over all rounds."""
    recorder: int | None
    """Exit code of the second recorder, and its last line."""
    recorder_said: str = ""


def plain(environment: Mapping[str, str]) -> dict[str, str]:
    """Give the environment of a user's shell: with ROS, without what is set for the nodes of a ride."""
    return {name: value for name, value in environment.items() if not name.startswith(NOT_OURS)}


def work_of(viewers: Sequence[str], reader: str, recorder: int | None, said: str = "") -> Work:
    """Sum up what viewers and the reader of parameters said, a JSON object a line; a last line may be cut off."""
    visits = [entry for text in viewers for entry in _entries(text) if "messages" in entry]
    rounds = [entry for entry in _entries(reader) if "parameters" in entry]
    return Work(
        visits=len(visits),
        messages=sum(entry["messages"] for entry in visits),
        topics=max((entry["topics"] for entry in visits), default=0),
        rounds=len(rounds),
        parameters=max((entry["parameters"] for entry in rounds), default=0),
        silent=sum(entry["silent"] for entry in rounds),
        recorder=recorder,
        recorder_said=(said.strip().splitlines() or [""])[-1],
    )


def _entries(text: str) -> list[dict[str, int]]:
    found = []
    for line in text.splitlines():
        try:
            entry = json.loads(line)
        except ValueError:  # a remark of the middleware
            continue
        if isinstance(entry, dict):
            found.append(entry)
    return found


class Disturbance:
    """The processes; to be used by `with`, which ends each of them by its number whatever happens."""

    def __init__(self, folder: Path, environment: Mapping[str, str]) -> None:
        self._folder = folder
        self._environment = plain(environment)
        self._children: dict[str, subprocess.Popen[bytes]] = {}
        self._record = folder / "second"
        self._cores = len(os.sched_getaffinity(0))

    def __enter__(self) -> Disturbance:
        self._folder.mkdir(parents=True)
        return self

    def __exit__(self, *reason: object) -> None:
        self.end()

    @property
    def pids(self) -> list[int]:
        """Give the process numbers."""
        return [child.pid for child in self._children.values()]

    def begin(self, going: Callable[[], bool]) -> None:
        """Bring all of them up: the busy ones last, so that the others need not fight for their start.

        ``going`` is asked again and again meanwhile; once it says no, the rest is left out.

        Raises
        ------
        DisturbanceError
            One of them died, or was not ready in time.
        """
        python = ["python", str(OUTSIDE), str(os.getpid())]
        self._start("recorder", [*python[:1], "-m", "ride.child", python[2], RECORDER, "--out", str(self._record)])
        self._start("parameters", [*python, "parameters"])
        for number in range(VIEWERS):
            self._start(f"viewer-{number}", [*python, "view", str(number)])
            due = time.monotonic() + STAGGER
            while time.monotonic() < due:
                if not going():
                    return
                time.sleep(LOOK)
        deadline = time.monotonic() + READY_SECONDS
        while waiting := [name for name in self._children if not self._ready(name)]:
            for name in waiting:
                if (code := self._children[name].poll()) is not None:
                    raise DisturbanceError(f"{name} ended with code {code}: {self._said(name).strip()[-400:]}")
            if time.monotonic() > deadline:
                raise DisturbanceError(f"{', '.join(waiting)}: not ready within {READY_SECONDS:g} s")
            if not going():
                return
            time.sleep(LOOK)
        for number in range(self._cores):
            self._start(f"busy-{number}", [*python, "busy"])

    def end(self) -> None:
        """End them by their numbers: first who takes the processor, then who wants time to leave properly."""
        for group in ("busy", "viewer", "parameters", "recorder"):
            several = {name: child for name, child in self._children.items() if name.startswith(group)}
            for child in several.values():
                if child.poll() is None:
                    child.send_signal(signal.SIGTERM)  # SIGINT may be ignored before the child has its own handler
            deadline = time.monotonic() + (RECORDER_PATIENCE if group == "recorder" else PATIENCE)
            for child in several.values():
                try:
                    child.wait(max(0.0, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    child.kill()
                    child.wait()

    def work(self) -> Work:
        """Give what they had done; to be called after the end."""
        viewers = [self._said(f"viewer-{number}") for number in range(VIEWERS)]
        recorder = self._children["recorder"].returncode
        return work_of(viewers, self._said("parameters"), recorder, self._said("recorder"))

    def _start(self, name: str, command: Sequence[str]) -> None:
        with (self._folder / f"{name}.log").open("wb") as output:
            self._children[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=self._environment,
            )

    def _said(self, name: str) -> str:
        path = self._folder / f"{name}.log"
        return path.read_text(encoding="utf-8", errors="replace") if path.exists() else ""

    def _ready(self, name: str) -> bool:
        if name == "recorder":
            return any(self._record.glob("*.mcap"))
        return '"ready"' in self._said(name)
