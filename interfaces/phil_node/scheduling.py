"""Who gets the processor first: the ride, before everything else, where the system allows it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

PRIORITY = 40
"""Of SCHED_FIFO (1 to 99): above every ordinary process, below the kernel's interrupt threads (50)."""


def go_first(process_ids: Sequence[int]) -> bool:
    """Schedule all threads of these processes by SCHED_FIFO; tell whether the system allows it (else nothing changes).

    One priority for all: whoever has work gets the processor in turn, so that nobody waits for the time slice of
    another (1 to 3 ms), and a recorder below the loop would lose messages when the loop is fast.
    """
    threads = [int(task.name) for pid in process_ids for task in Path(f"/proc/{pid}/task").glob("*")]
    changed = []
    try:
        for thread in threads:
            os.sched_setscheduler(thread, os.SCHED_FIFO, os.sched_param(PRIORITY))
            changed.append(thread)
    except (PermissionError, ProcessLookupError):
        for thread in changed:
            os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
        return False
    return True
