"""What a node asks of the system when a ride begins, by its parameters: turns of the interpreter, and real time."""

from __future__ import annotations

import sys
from typing import Any

from phil_base.real_time import FIFO, Granted, apply, set_thread
from phil_base.scheduling import CYCLE as CYCLE_PRIORITY
from phil_base.scheduling import IN_CYCLE, MIDDLE, priority_of

SWITCH = 5e-5
"""Time in s for which the cycle's thread at most waits for Python code of another thread of its process."""
LONG_SWITCH = 1e-3
"""The same in lockstep for a thread that has the cycles of several nodes, and never waits by itself."""
LOCKSTEP = "lockstep"
"""Value of the parameter ``mode`` of a ride that waits for its cycles; any other runs by the wall clock."""


def in_lockstep(parameters: Any) -> bool:
    """Tell whether a node's ride waits for its cycles; a node without that choice does not know another way."""
    return bool(getattr(parameters, "mode", LOCKSTEP) == LOCKSTEP)


def ask(node: Any) -> Granted:
    """Ask for what a ride needs; a process that belongs to others as well (a test's) is left as it is.

    Returns what the node was granted, or had been before.
    """
    lockstep, alone = in_lockstep(node.parameters), node.wires.alone
    sys.setswitchinterval(LONG_SWITCH if lockstep and not alone else SWITCH)
    wanted = getattr(node.parameters, "real_time", None)
    if not node.has_process or wanted is None:
        return node.granted  # type: ignore[no-any-return]
    granted = apply(wanted, node.threads_role if alone else MIDDLE, level=lockstep)
    if node.cycle_role in IN_CYCLE or not alone:
        set_thread("serve")
    for line in () if lockstep else granted.advice:
        node.get_logger().warning(line)
    return granted


def priority_for_topics(node: Any, linked: bool) -> int:
    """Let the process for topics go first where the loop needs it: in lockstep, and for peers without a link."""
    wanted, lockstep = getattr(node.parameters, "real_time", None), in_lockstep(node.parameters)
    if wanted is None or wanted.scheduling != FIFO or (linked and not lockstep):
        return 0
    return priority_of("transport", wanted.priority or CYCLE_PRIORITY, lockstep)
