"""A viewer in a process of its own: ``python -m faults.viewer SECONDS_A_MESSAGE RELIABILITY``; 0 s: as fast as it can.

It reads the rig's, the controller's and the catenary's topics, all that they offer, and takes its time with each.
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from faults.begun import announce
from faults.relay import LINKS


def main() -> None:
    """Read until the process is ended."""
    pause, reliability = float(sys.argv[1]), sys.argv[2]
    qos = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE if reliability == "reliable" else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )
    rclpy.init()
    node = rclpy.create_node("viewer", start_parameter_services=False, enable_rosout=False)

    def read(_: Any) -> None:
        announce()
        time.sleep(pause)

    for link in LINKS.values():
        node.create_subscription(link.kind, link.topic, read, qos)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
