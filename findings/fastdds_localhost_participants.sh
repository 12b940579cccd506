#!/usr/bin/env bash
# rmw_fastrtps_cpp 8.4.3 with Fast DDS 2.14.5 (ros-jazzy-rclpy 7.1.6): with discovery limited to the own host, the
# participants after the 32nd never find each other
#
# ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST is documented as "a node will only try to discover other nodes on the same
# machine". With Fast DDS it does without multicast: each participant announces itself to 127.0.0.1 on the ports of
# the first 32 participant numbers only. One with a higher number still reaches the first 32, and they answer; but two
# that both have higher numbers never hear of each other. Each sees the first 32 and itself, nothing is logged, and a
# publisher and a subscriber of one topic and QoS stay without a match, while each of them talks to all older nodes.
# A process of rclpy or rclcpp has one participant, so the 33rd and the 34th process of a machine (tools and recorders,
# started last) are enough. The documentation of ROS names a limit near 100 participants for a host with Fast DDS,
# and none of 32 for LOCALHOST.
#
# Seen with 36 participants, each in a context of its own, and a subscription in the 36th:
#   publisher in the 1st, 31st    1 match
#   publisher in the 35th         0 matches
#   nodes that the 1st sees       36
#   nodes that the 36th sees      33
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" numpy==2.2.6 || exit 2
export ROS_LOG_DIR="$temp" ROS_DOMAIN_ID="${ROS_DOMAIN_ID:-77}" ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
"$temp/venv/bin/python" - <<'PY'
import sys
import time

import rclpy
from rcl_interfaces.msg import ParameterEvent
from rclpy.context import Context

COUNT = 36

nodes = []
for number in range(COUNT):
    context = Context()
    rclpy.init(context=context)
    options = {"start_parameter_services": False, "enable_rosout": False}
    nodes.append(rclpy.create_node(f"node_{number}", context=context, **options))
publishers = {number: nodes[number - 1].create_publisher(ParameterEvent, "topic", 1) for number in (1, 31, COUNT - 1)}
nodes[-1].create_subscription(ParameterEvent, "topic", lambda message: None, 1)


def count_nodes():
    """Nodes that the first and the last one see."""
    return [len(nodes[i].get_node_names()) for i in (0, -1)]


end = time.monotonic() + 30.0
while count_nodes()[0] < COUNT and time.monotonic() < end:
    time.sleep(0.5)
time.sleep(6.0)  # two more rounds of announcements after the first node has met all
matches = {number: publisher.get_subscription_count() for number, publisher in publishers.items()}
seen = count_nodes()
print("matches by publisher's participant:", matches)
print("nodes that the first and the last see:", seen)
for node in nodes:
    context = node.context
    node.destroy_node()
    rclpy.shutdown(context=context)
sys.exit(0 if matches == {1: 1, 31: 1, COUNT - 1: 0} and seen == [COUNT, 33] else 1)
PY
