"""The processes of a ride: started apart from the terminal, watched, and ended without a trace."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path


class Process:
    """One child: its output goes to a log file, Ctrl-C in the terminal does not reach it, and it ends if we die."""

    def __init__(self, name: str, module: str, arguments: Sequence[str], log: Path) -> None:
        self.name = name
        self.log = log
        command = [sys.executable, "-m", "ride.child", str(os.getpid()), module, *arguments]
        with log.open("wb") as output:
            self._child = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
            )

    @property
    def pid(self) -> int:
        """Give the process id."""
        return self._child.pid

    @property
    def ended(self) -> bool:
        """Tell whether the process is over."""
        return self._child.poll() is not None

    @property
    def code(self) -> int | None:
        """Give the exit code, None while it runs."""
        return self._child.poll()

    def ask_to_end(self, number: int = signal.SIGINT) -> None:
        """Send a signal."""
        if not self.ended:
            self._child.send_signal(number)

    def wait(self, seconds: float) -> bool:
        """Wait for the end; tell whether it came in time."""
        try:
            self._child.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def last_words(self, lines: int = 5) -> str:
        """Give the last lines of its output."""
        text = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return "\n".join(text[-lines:])


def end_all(processes: Sequence[Process], patience: float = 5.0) -> None:
    """End processes: let them go by themselves for ``patience`` s all together, then SIGTERM, then SIGKILL."""
    for number, seconds in ((None, patience), (signal.SIGTERM, 3.0), (signal.SIGKILL, 5.0)):
        left = [process for process in processes if not process.ended]
        if number is not None:
            for process in left:
                process.ask_to_end(number)
        deadline = time.monotonic() + seconds
        for process in left:
            process.wait(max(0.0, deadline - time.monotonic()))
