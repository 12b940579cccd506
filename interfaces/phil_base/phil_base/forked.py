"""Children that are forked, not started: they have at once what their parent has imported, and share its memory.

An interpreter that imports numpy, scipy, numba and ROS takes one to two seconds of a core and 150 MB; a ride has nine
or ten. A process may fork as long as it has no threads that hold locks: before ROS is initialised.
"""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import TextIO

from phil_base import command_words

LOOK = 0.005
"""Time in s between two looks for the end of a child that is waited for."""
FAILED = 1
"""Exit code of a child that an exception ended, as an interpreter's."""


class Forked:
    """A child of this process, with what `subprocess.Popen` has of one."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Give the exit code, the negative number of a signal that ended it, None while it runs."""
        if self.returncode is None:
            try:
                pid, status = os.waitpid(self.pid, os.WNOHANG)
            except ChildProcessError:  # somebody else has waited for it
                self.returncode = FAILED
            else:
                if pid:
                    self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end, and give the exit code.

        Raises
        ------
        subprocess.TimeoutExpired
            It did not end within ``timeout`` s.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        while (code := self.poll()) is None:
            if deadline is not None and time.monotonic() >= deadline:
                raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
            time.sleep(LOOK)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it is over."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)


def fork(
    body: Callable[[], int | None],
    command: Sequence[str],
    name: str,
    output: int | None = None,
    keep: Collection[int] = (),
    gate: int | None = None,
) -> Forked:
    """Fork a child in a session of its own that calls ``body``, and ends with the code that this gives (None: 0).

    Args:
        body: what it does; it has none of this process's handlers of signals.
        command: that would do the same from the start: shown as its command line, and executed in its place where the
            kernel does not show it.
        name: short name of the process.
        output: file for its standard output and errors; None: as this process's.
        keep: files that it needs; all others are closed.
        gate: file from which it reads a byte first; it ends if there is none any more.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    gc.freeze()  # a collection in the child would write to all that is shared
    pid = os.fork()
    if pid:
        gc.unfreeze()
        return Forked(pid)
    code = FAILED
    try:
        _begin(output, keep if gate is None else (*keep, gate))
        if gate is not None:
            opened = os.read(gate, 1)
            os.close(gate)
            if not opened:
                os._exit(0)
        if not command_words.show(command, name):
            for file in keep:
                os.set_inheritable(file, True)
            os.execv(command[0], list(command))
        code = body() or 0
    except KeyboardInterrupt:
        code = 128 + signal.SIGINT
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else FAILED if end.code else 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _begin(output: int | None, keep: Collection[int]) -> None:
    """Leave the parent's session, terminal, files and handlers of signals."""
    os.setsid()
    with Path(os.devnull).open("rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    if output is not None:
        os.dup2(output, 1)
        os.dup2(output, 2)
    first = 3
    for file in (*sorted(keep), os.sysconf("SC_OPEN_MAX")):
        os.closerange(first, file)
        first = file + 1
    sys.stdout, sys.stderr = _text(1), _text(2)
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def _text(file: int) -> TextIO:
    """Write text to a file by lines, as an interpreter does to its log."""
    return os.fdopen(file, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False)
