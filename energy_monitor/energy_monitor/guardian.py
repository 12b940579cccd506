"""A process beside a recorder that kills it when nothing within it can end it any more: see `watch`.

Started by its path, with as little of Python as there is: ``guardian.py PROCESS PIPE SECONDS``. It ends with the
recorder.
"""

from __future__ import annotations

import os
import select
import signal
import sys
from time import monotonic

AGAIN = 0.1
"""s between two looks while the recorder has to act."""


def closed(pipe: int) -> bool:
    """Tell whether the other end of a pipe is closed."""
    look = select.poll()
    look.register(pipe, select.POLLIN)
    return bool(dict(look.poll(0)).get(pipe, 0) & select.POLLHUP)


def stays(pipe: int, seconds: float) -> bool:
    """Tell whether what stands in a pipe is still there after so many s; not if its other end is closed."""
    look = select.poll()
    look.register(pipe, select.POLLIN)
    deadline = monotonic() + seconds
    while monotonic() < deadline:
        found = dict(look.poll(0)).get(pipe, 0)
        if not found & select.POLLIN or found & select.POLLHUP:
            return False
        select.select([], [], [], AGAIN)
    return True


def main(process: int, pipe: int, seconds: float) -> None:
    """Wait until the other end of ``pipe`` is closed; kill ``process`` if something stands in it for too long."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # they are for the recorder, and reach its whole group
    look = select.poll()
    look.register(pipe, select.POLLIN)
    while True:
        if dict(look.poll())[pipe] & select.POLLHUP:
            return
        if not stays(pipe, seconds):
            continue
        if os.getppid() == process:
            sys.stderr.write(
                f"record: was asked to end {seconds:g} s ago and hangs: killed; what was written up to a quarter of a "
                "second before is kept, and scripts/analyze.sh reads it\n"
            )
            sys.stderr.flush()
            os.kill(process, signal.SIGKILL)
        return


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]))
