"""A ride in a process of its own, which is seen to its end whatever happens here."""

from __future__ import annotations

import contextlib
import signal
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

END_SECONDS = 60.0
"""Time in s that a ride has to end after Ctrl-C: it lands, and closes its bag."""


@contextlib.contextmanager
def running(
    command: Sequence[str], folder: Path, environment: Mapping[str, str], log: Path, ask: int = signal.SIGINT
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a ride in a folder, its output in ``log``; end it: ``ask`` as an operator would, and only then harder."""
    with log.open("wb") as output:
        child = subprocess.Popen(
            command,
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        yield child
    finally:
        for number, patience in ((ask, END_SECONDS), (signal.SIGTERM, 10.0), (signal.SIGKILL, 5.0)):
            if child.poll() is not None:
                break
            child.send_signal(number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(patience)
