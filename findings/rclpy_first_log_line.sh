#!/usr/bin/env bash
# ros-jazzy-rclpy 7.1.6: the first line that a process logs costs a hundred times the next one, the more the more modules
# are loaded
#
# Each call of a logger looks up who called it: rclpy.impl.rcutils_logger takes inspect.getframeinfo() of the frame, and
# that goes by inspect.getmodule() through all of sys.modules, with os.path.realpath() of each file, until it has met them
# all once. With scipy and numba loaded (800 modules and more) the first line of a node takes tens of ms, in whatever
# thread says it and with the interpreter's lock taken again and again; the next lines take some tenths of a ms. A look
# at any frame before (inspect.getframeinfo(inspect.currentframe())) takes the cost where it does no harm.
#
# Seen, on one machine:
#   modules  first line  next lines (median)  first line after a look
#   1155     41 ms       0.2 ms               0.7 ms
# The check: without the look the first line resolves the paths of more than 300 modules and takes more than 10 times the
# time of a next one; after the look it resolves fewer than 50.
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" numpy==2.2.6 scipy==1.15.3 numba==0.61.2 || exit 2
export ROS_LOG_DIR="$temp"
cat >"$temp/one.py" <<'PY'
import inspect
import os
import statistics
import sys
import time

import numba  # noqa: F401
import scipy.signal  # noqa: F401
from rclpy.logging import get_logger

if sys.argv[1] == "look":
    inspect.getframeinfo(inspect.currentframe())
resolved = 0
plain = os.path.realpath


def counted(*arguments, **options):
    global resolved
    resolved += 1
    return plain(*arguments, **options)


def line(number):
    begun = time.perf_counter()
    get_logger("node").warning(f"line {number}")
    return (time.perf_counter() - begun) * 1e3


os.path.realpath = counted
first, count = line(0), resolved
print(len(sys.modules), count, first, statistics.median(line(number) for number in range(1, 20)))
PY
"$temp/venv/bin/python" "$temp/one.py" plain 2>/dev/null >"$temp/plain"
"$temp/venv/bin/python" "$temp/one.py" look 2>/dev/null >"$temp/look"
"$temp/venv/bin/python" - "$temp/plain" "$temp/look" <<'PY'
import sys

found = {}
for path in sys.argv[1:]:
    with open(path) as file:
        found[path.rsplit("/", 1)[1]] = [float(word) for word in file.read().split()[-4:]]
for name, (modules, count, first, following) in found.items():
    print(f"{name}: {modules:.0f} modules, {count:.0f} paths resolved by the first line, {first:.1f} ms, then {following:.2f} ms")
_, count, first, following = found["plain"]
sys.exit(not (count > 300 and first > 10 * following and found["look"][1] < 50))
PY
