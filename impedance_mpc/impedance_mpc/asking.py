"""When a command is sent again, because the state of the wire that answers it does not come; no ROS."""

from __future__ import annotations

PATIENCE = 0.75
"""Cycles that the catenary has for its answer."""
EAGER = 8
"""Times that it is asked again at this pace; then it stands, rather, and each wait is twice as long as the last one."""
LONGEST = 0.25
"""Longest wait in s: the catenary may come back."""


class Asking:
    """Tells when the last command is to be sent again; times are of the monotonic clock, in s.

    Args:
        period: cycle time in s.
    """

    def __init__(self, period: float) -> None:
        self._patience = PATIENCE * period
        self.times = 0
        """Times that the last command was sent again."""
        self.due = 0.0
        """When to send it again, unless the answer has come."""

    def sent(self, now: float) -> None:
        """Note that a new command was sent."""
        self.times = 0
        self.due = now + self._patience

    def again(self, now: float) -> None:
        """Note that it was sent again."""
        self.times += 1
        self.due = now + min(LONGEST, self._patience * 2.0 ** max(0, self.times - EAGER))
