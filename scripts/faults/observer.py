"""What is seen of a ride from outside, whatever becomes of its recorder: every state of the rig, every diagnosis."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from phil_interfaces.msg import RigState
from rclpy.node import Node
from rclpy.serialization import deserialize_message

from faults.judge import Remark, Sight
from phil_node.qos import CYCLE

RIVAL = "rival"
"""Frame of the states that the second publisher of a fault sends: no drive is behind them."""


class Observer:
    """Keeps the rig's states unread until somebody asks for them: reading costs more than keeping."""

    def __init__(self, node: Node) -> None:
        self._raw: list[tuple[float, bytes]] = []
        self._seen: list[Sight] = []
        self.remarks: list[Remark] = []
        node.create_subscription(RigState, "test_rig_sim/state", self._take_state, CYCLE, raw=True)
        node.create_subscription(DiagnosticArray, "/diagnostics", self._take_diagnostics, 100)

    def clear(self) -> None:
        """Forget what was seen."""
        self._raw.clear()
        self._seen.clear()
        self.remarks.clear()

    @property
    def newest(self) -> Sight | None:
        """Give the newest state without reading those before it."""
        for entry in reversed(self._raw):
            if (found := sight(*entry)) is not None:
                return found
        return self._seen[-1] if self._seen else None

    def sights(self) -> Sequence[Sight]:
        """Give all states since `clear`, in the order in which they came."""
        fresh, self._raw = self._raw, []
        self._seen += [found for entry in fresh if (found := sight(*entry)) is not None]
        return self._seen

    def _take_state(self, data: bytes) -> None:
        self._raw.append((time.monotonic(), data))

    def _take_diagnostics(self, message: Any) -> None:
        now = time.monotonic()
        for status in message.status:
            values = {entry.key: entry.value for entry in status.values}
            node = status.hardware_id.rsplit("/", 1)[-1]
            self.remarks.append(Remark(now, node, ord(status.level), status.message, values))


def sight(at: float, data: bytes) -> Sight | None:
    """Read a serialised RigState that came ``at`` (s); None if no drive is behind it."""
    m: Any = deserialize_message(data, RigState)
    if m.header.frame_id == RIVAL:
        return None
    stamp = m.header.stamp.sec + 1e-9 * m.header.stamp.nanosec
    return Sight(at, m.cycle, m.mode, m.w_tr, m.v_tr, m.f_tr, m.current, m.late_commands, stamp)
