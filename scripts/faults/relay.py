"""A process that stands between two nodes: ``python -m faults.relay LINK``.

A link of `LINKS` is one subscription of one node, which is remapped to the topic that the relay publishes. What is
done to the messages is said by a JSON object on the topic `ORDERS`: kind, share, delay.
"""

from __future__ import annotations

import gc
import json
import sys
import time
from dataclasses import dataclass
from typing import Any

import rclpy
from phil_interfaces.msg import CatenaryState, ImpedanceCommand, RigState
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import String

from faults.damage import Damage, Spoiler, spoil
from phil_node.executor import events_executor
from phil_node.process import leave
from phil_node.qos import CYCLE, CYCLE_KEPT

ORDERS = "faults/orders"
DONE = "faults/done"
LATCHED_ORDERS = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=10,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)


@dataclass(frozen=True)
class Link:
    """Messages from a topic to one node that listens to it."""

    kind: Any
    topic: str
    listener: str
    kept: bool

    @property
    def relayed(self) -> str:
        """Give the topic that the listener has in place of the real one."""
        return f"faults/{self.listener}/{self.topic}"

    @property
    def remapping(self) -> str:
        """Give what the listener's command line says."""
        return f"{self.topic}:={self.relayed}"


LINKS = {
    "rig-controller": Link(RigState, "test_rig_sim/state", "impedance_mpc", False),
    "controller-rig": Link(ImpedanceCommand, "impedance_mpc/command", "test_rig_sim", True),
    "controller-catenary": Link(ImpedanceCommand, "impedance_mpc/command", "catenary_model", True),
    "catenary-controller": Link(CatenaryState, "catenary_model/state", "impedance_mpc", True),
}


class Passage:
    """One link: listens, spoils, publishes."""

    def __init__(self, node: Node, link: Link) -> None:
        self._node = node
        self._kind = link.kind
        self.spoiler = Spoiler(change=self._spoil)
        self._out = node.create_publisher(link.kind, link.relayed, CYCLE_KEPT if link.kept else CYCLE)
        # As bytes: what a relay costs by itself is not to be the fault.
        node.create_subscription(link.kind, link.topic, self._take, CYCLE, raw=True)
        self._later: list[tuple[float, bytes]] = []

    def _spoil(self, data: bytes, kind: str) -> bytes:
        return bytes(serialize_message(spoil(deserialize_message(data, self._kind), kind)))

    def _take(self, message: bytes) -> None:
        at_once, later = self.spoiler.pass_on(message)
        for one in at_once:
            self._out.publish(one)
        if later is not None:
            self._later.append((time.monotonic() + later[0], later[1]))

    def order(self, damage: Damage) -> None:
        """Do this from now on."""
        for held in self.spoiler.set(damage):
            self._out.publish(held)

    def flush(self) -> None:
        """Pass on what was delayed for long enough."""
        now = time.monotonic()
        while self._later and self._later[0][0] <= now:
            self._out.publish(self._later.pop(0)[1])


def main() -> None:
    """Pass on until the process is ended."""
    link = LINKS[sys.argv[1]]
    rclpy.init()
    node = rclpy.create_node("fault_relay", start_parameter_services=False, enable_rosout=False)
    passage = Passage(node, link)
    done = node.create_publisher(String, DONE, LATCHED_ORDERS)

    def obey(message: String) -> None:
        spoiler = passage.spoiler
        before, spoiler.done = spoiler.done, 0
        passage.order(Damage(**json.loads(message.data)))
        done.publish(String(data=json.dumps({"done": before})))

    node.create_subscription(String, ORDERS, obey, LATCHED_ORDERS)
    node.create_timer(0.001, passage.flush)
    executor = events_executor()
    executor.add_node(node)
    gc.collect()
    gc.freeze()
    gc.disable()  # as in the nodes: a collection takes longer than a cycle
    never: Any = rclpy.task.Future()
    while rclpy.ok():
        try:
            executor.spin_until_future_complete(never, timeout_sec=1.0)
        except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
            break
    leave(0)


if __name__ == "__main__":
    main()
