"""The processes of a ride: started apart from the terminal, watched, and ended without a trace."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

PR_SET_PDEATHSIG = 1
_libc = ctypes.CDLL(None, use_errno=True)


class Process:
    """One child: its output goes to a log file, Ctrl-C in the terminal does not reach it, and it ends if we die."""

    def __init__(self, name: str, arguments: Sequence[str], log: Path) -> None:
        self.name = name
        self.log = log
        with log.open("wb") as output:
            self._child = subprocess.Popen(
                [sys.executable, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_die_with_parent,
            )

    @property
    def ended(self) -> bool:
        """Tell whether the process is over."""
        return self._child.poll() is not None

    @property
    def code(self) -> int | None:
        """Give the exit code, None while it runs."""
        return self._child.poll()

    def ask_to_end(self) -> None:
        """Send SIGINT."""
        if not self.ended:
            self._child.send_signal(signal.SIGINT)

    def wait(self, seconds: float) -> bool:
        """Wait for the end; tell whether it came in time."""
        try:
            self._child.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def end(self, patience: float = 5.0) -> None:
        """End it: wait, then SIGTERM, then SIGKILL."""
        if self.wait(patience):
            return
        self._child.terminate()
        if self.wait(3.0):
            return
        self._child.kill()
        self._child.wait()

    def last_words(self, lines: int = 5) -> str:
        """Give the last lines of its output."""
        text = self.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        return "\n".join(text[-lines:])


def end_all(processes: Sequence[Process], patience: float = 5.0) -> None:
    """End several processes that were already asked to; the patience is for all together."""
    deadline = time.monotonic() + patience
    for process in processes:
        process.end(max(0.1, deadline - time.monotonic()))


def _die_with_parent() -> None:
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() == 1:
        os._exit(1)
