#!/usr/bin/env bash
# ros-jazzy-rclpy 7.1.6: each wait for a future that ends by its timeout leaves something with the future for good
#
# spin_until_future_complete(future, timeout_sec) adds a callback to the future that ends the wait, and does not take it
# away when the time is over. A program that waits for one future in steps, to look at something else in between
# (an answer of a service, the end of a ride), grows with each step as long as the future is pending, by six objects
# under the executors in Python and by one under the EventsExecutor; at its end the future calls all of them. The
# documentation of the method speaks of the timeout only.
#
# Seen: Python objects, more after 1000 waits of 0.1 ms than before them, by wait
#   SingleThreadedExecutor    6.0
#   MultiThreadedExecutor     6.0
#   EventsExecutor            1.0
# and of spin_once(), as often: 0.0 with each.
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" numpy==2.2.6 || exit 2
export ROS_LOG_DIR="$temp" ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-77}" ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
"$temp/venv/bin/python" - <<'PY'
import gc
import sys

import rclpy
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.task import Future

WAITS, SECONDS = 1000, 1e-4


def grown(turn):
    """Give how many more objects Python has for each of many turns."""
    for _ in range(100):  # whatever is made once
        turn()
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in range(WAITS):
        turn()
    gc.collect()
    return (sys.getallocatedblocks() - before) / WAITS


def seen_with(make):
    """Give what a wait for one pending future leaves, and what a turn of spin_once() does."""
    node = rclpy.create_node("node", start_parameter_services=False, enable_rosout=False)
    executor, pending = make(), Future()
    executor.add_node(node)
    waits = grown(lambda: executor.spin_until_future_complete(pending, timeout_sec=SECONDS))
    turns = grown(lambda: executor.spin_once(timeout_sec=SECONDS))
    executor.shutdown()
    node.destroy_node()
    return round(waits, 1), round(turns, 1)


rclpy.init()
seen = [seen_with(make) for make in (SingleThreadedExecutor, MultiThreadedExecutor, EventsExecutor)]
print("objects a wait and a turn (single-threaded, multi-threaded, events):", seen)
rclpy.shutdown()
sys.exit(0 if seen == [(6.0, 0.0), (6.0, 0.0), (1.0, 0.0)] else 1)
PY
