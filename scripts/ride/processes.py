"""The processes of a ride: started apart from the terminal, watched, and ended without a trace."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from runpy import run_module
from typing import ClassVar

from phil_base.forked import Forked, fork
from phil_node.bounded_log import BoundedLog
from ride.child import as_child

PRELOADED = (
    *("test_rig_sim.node", "impedance_mpc.node", "catenary_model.node", "energy_monitor.node"),
    *("energy_monitor.record", "energy_monitor.recorder", "phil_node.topics_process"),
)
"""What the processes of a ride import, one or the other."""


class Process:
    """One child: its output goes to a log file, Ctrl-C in the terminal does not reach it, and it ends if we die."""

    nursery: ClassVar[Nursery | None] = None
    """Of which children are forked at present; no argument, so that one's own kind of process needs not know of it."""

    def __init__(self, name: str, module: str, arguments: Sequence[str], log: Path) -> None:
        """Start a module with its arguments; of a nursery the child is forked, and waits for `Nursery.open`."""
        self.name = name
        self.log = log
        command = [sys.executable, "-m", "ride.child", str(os.getpid()), module, *arguments]
        self._child: subprocess.Popen[bytes] | Forked
        with log.open("wb") as output:
            if self.nursery is not None:
                self._child = self.nursery.fork(command, output.fileno())
                return
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


class Nursery:
    """Forks children of a process that has no threads of its own yet; they wait at a gate until it is opened.

    So they are there while it is still found out whether they may begin, with all that they import.
    """

    def __init__(self) -> None:
        """Import what the children need."""
        for module in PRELOADED:
            import_module(module)
        BoundedLog.prepare()  # what it looks up is theirs as well
        self._wait, self._open = os.pipe()
        self._count = 0
        """Children that wait."""

    def fork(self, command: Sequence[str], output: int) -> Forked:
        """Fork a child that becomes ``command`` (of `ride.child`)."""
        self._count += 1
        name = command[4].removesuffix(".node").rpartition(".")[2]
        return fork(partial(_live, command), command, name, output, gate=self._wait)

    def open(self) -> None:
        """Let all children begin."""
        os.write(self._open, bytes(self._count))
        self.close()

    def close(self) -> None:
        """Let no child begin any more: those that wait end."""
        if self._count:
            self._count = 0
            os.close(self._wait)
            os.close(self._open)


def _live(command: Sequence[str]) -> int | None:
    """Do in a forked child what its command does (`ride.child`)."""
    parent, module, arguments = int(command[3]), command[4], command[5:]
    as_child(parent)
    sys.argv = [module, *arguments]
    main: Callable[[], int | None] | None = getattr(import_module(module), "main", None)
    if main is None:  # one's own module need not have it
        del sys.modules[module]
        run_module(module, run_name="__main__", alter_sys=True)
        return None
    return main()


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
