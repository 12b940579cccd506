"""Rides with the real nodes."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest


def processes_of(out: Path) -> list[int]:
    """List the processes whose command line names the folder of a ride."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            line = (entry / "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if str(out) in line:
            found.append(int(entry.name))
    return found


def environment() -> dict[str, str]:
    """Give the environment of nodes in processes of their own: on another domain than nodes in this process."""
    return dict(os.environ, ROS_DOMAIN_ID=os.environ["PHIL_TEST_DOMAIN_RIDES"])


class RideProcess:
    """A ride that is going on."""

    def __init__(self, out: Path, *arguments: str) -> None:
        self.out = out
        command = [sys.executable, "-m", "ride", "--out", str(out), *arguments]
        self.text = ""
        self.process = subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env=environment(),
        )

    def wait_until(self, condition: Callable[[], bool], seconds: float = 120.0) -> None:
        """Wait for something that the ride does."""
        deadline = time.monotonic() + seconds
        while not condition():
            assert self.process.poll() is None, f"the ride ended early:\n{self.finish()}"
            assert time.monotonic() < deadline, "nothing happened"
            time.sleep(0.05)

    def wait_until_riding(self, seconds: float = 120.0) -> None:
        """Wait until the bag grows."""
        self.wait_until(lambda: sum(f.stat().st_size for f in self.out.glob("bag/*.mcap")) > 1_000_000, seconds)

    def finish(self, seconds: float = 120.0) -> str:
        """Wait for the end; give all that was printed."""
        try:
            self.text += self.process.communicate(timeout=seconds)[0]
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.text += self.process.communicate()[0]
            raise
        return self.text

    @property
    def code(self) -> int | None:
        """Give the exit code."""
        return self.process.returncode


@pytest.fixture
def ride(tmp_path: Path) -> Iterator[Callable[..., RideProcess]]:
    """Start rides that are gone after the test."""
    started: list[RideProcess] = []

    def start(*arguments: str, name: str = "ride") -> RideProcess:
        started.append(RideProcess(tmp_path / name, *arguments))
        return started[-1]

    yield start
    for one in started:
        if one.process.poll() is None:
            one.process.kill()
            one.process.wait()


@pytest.fixture(scope="session")
def leftovers() -> Callable[[Path], list[int]]:
    """Give the function that lists processes of a ride."""
    return processes_of


@pytest.fixture(scope="session")
def node_environment() -> dict[str, str]:
    """Give the environment for nodes that a test starts by itself."""
    return environment()


@pytest.fixture(scope="session")
def lockstep_ride(tmp_path_factory: pytest.TempPathFactory) -> RideProcess:
    """Ride 3 s in lockstep with seed 7, once for all tests that look at it."""
    done = RideProcess(tmp_path_factory.mktemp("rides") / "lockstep", "--duration", "3", "--seed", "7")
    done.finish(240.0)
    return done


@pytest.fixture(scope="session")
def composed_ride(tmp_path_factory: pytest.TempPathFactory) -> RideProcess:
    """Ride as `lockstep_ride` does, with the nodes in one process."""
    done = RideProcess(tmp_path_factory.mktemp("rides") / "composed", "--duration", "3", "--seed", "7", "--composed")
    done.finish(240.0)
    return done
