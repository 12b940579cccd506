"""A client that asks but cannot hear, in a process of its own: ``python -m faults.deaf REQUESTS_A_SECOND``.

It wants answers kept for it, which no server of ROS offers: each node takes its requests and finds nobody to answer.
"""

from __future__ import annotations

import sys
import time
from contextlib import suppress

import rclpy
from rcl_interfaces.srv import GetParameters
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile

from faults.begun import announce
from ride.settings import NODES

MEETING = 2.0
"""Time in s that the nodes get to take note of the client."""


def main() -> None:
    """Ask until the process is ended."""
    pause = 1.0 / float(sys.argv[1])
    kept = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    rclpy.init()
    node = rclpy.create_node("deaf", start_parameter_services=False, enable_rosout=False)
    clients = [node.create_client(GetParameters, f"{name}/get_parameters", qos_profile=kept) for name in NODES]
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        time.sleep(MEETING)
        while rclpy.ok():
            for client in clients:
                client.remove_pending_request(client.call_async(GetParameters.Request(names=["mode"])))
            announce()
            time.sleep(pause)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
