#!/usr/bin/env bash
# ros-jazzy-rclpy 7.1.6: under the EventsExecutor a subscription whose callback asks for the message info is called with
# one argument, a pair, and the error of that is lost
#
# Node.create_subscription() takes a callback of one argument (the message) or of two (message and message info); rclpy
# tells by the signature. The executors in Python call callback(message, info). The EventsExecutor of
# rclpy.experimental calls callback((message, info)): a TypeError, which its error handling then turns into
# "SystemError: null argument to internal routine". So a node that works with one executor ends with the other.
#
# Seen, with one message published to a callback of two arguments:
#   SingleThreadedExecutor    called with 2 arguments
#   EventsExecutor            SystemError
# and with a callback whose __signature__ has two parameters, but that takes what comes:
#   SingleThreadedExecutor    called with 2 arguments
#   EventsExecutor            called with 1 argument
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" numpy==2.2.6 || exit 2
export ROS_LOG_DIR="$temp" ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-77}" ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
"$temp/venv/bin/python" - <<'PY'
import inspect
import sys
import time

import rclpy
from rcl_interfaces.msg import ParameterEvent
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.task import Future

rclpy.init()


def call(make, tolerant):
    """Give what came of one message: how many arguments the callback had, or the error."""
    node = rclpy.create_node("node", start_parameter_services=False, enable_rosout=False)
    called = Future()

    def any_number(*arguments):
        called.set_result(len(arguments))

    def two(message, info):
        any_number(message, info)

    any_number.__signature__ = inspect.signature(two)
    node.create_subscription(ParameterEvent, "topic", any_number if tolerant else two, 1)
    publisher = node.create_publisher(ParameterEvent, "topic", 1)
    while publisher.get_subscription_count() == 0:
        time.sleep(0.05)
    executor = make()
    executor.add_node(node)
    publisher.publish(ParameterEvent())
    try:
        executor.spin_until_future_complete(called, timeout_sec=5.0)
        return called.result()
    except Exception as error:
        return type(error).__name__
    finally:
        executor.shutdown()
        node.destroy_node()


seen = [call(make, tolerant) for tolerant in (False, True) for make in (SingleThreadedExecutor, EventsExecutor)]
print("arguments of the callback (single-threaded, events; then the same of a tolerant one):", seen)
rclpy.shutdown()
sys.exit(0 if seen == [2, "SystemError", 2, 1] else 1)
PY
