#!/usr/bin/env bash
# ros-jazzy-rclpy 7.1.6: a parameter file means other types to --params-file than to rclpy's parameter client
#
# The same file can reach a node in two ways: at its start by --ros-args --params-file, which rcl reads (C, own rules
# for scalars), or later by AsyncParameterClient.load_parameter_file (which `ros2 param load` rests on), for which
# rclpy.parameter.parameter_dict_from_yaml_file reads it with PyYAML (YAML 1.1), turns each value into text and
# guesses its type a second time. Both are to read "a valid ROS parameter file". Of 14 values a user would write, 11
# get another type or value, and in both directions: numbers become text, and quoted text becomes numbers and
# booleans, as the quotes are lost before the second guess. Where a node declares its types, the second way is then
# refused; where it takes any type, it goes on with another value.
# The tracker knows the numbers with an exponent (and 0.00001, whose text has one); the rest follows from the same
# place. The documentation of neither says that they differ.
#
# Seen:
#   in the file       --params-file           parameter client
#   1e-06             DOUBLE 1e-06            STRING '1e-06'
#   1.0e6             DOUBLE 1000000.0        STRING '1.0e6'
#   0.00001           DOUBLE 1e-05            STRING '1e-05'
#   [1.5, 1e-3]       DOUBLE_ARRAY            STRING "[1.5, '1e-3']"
#   [1e-3, 2e-3]      DOUBLE_ARRAY            STRING_ARRAY
#   .inf              DOUBLE inf              STRING 'inf'
#   08                DOUBLE 8.0              STRING '08'
#   1:30              STRING '1:30'           INTEGER 90
#   '1.5'             STRING '1.5'            DOUBLE 1.5
#   'on'              STRING 'on'             BOOL True
#   '[1, 2]'          STRING '[1, 2]'         INTEGER_ARRAY
#   1.5, 7, on        the same                the same
set -eu
temp=$(mktemp -d)
trap 'rm -rf "$temp"' EXIT
"${PYTHON:-python3}" -m venv "$temp/venv" &&
    "$temp/venv/bin/pip" install -qq "ros-jazzy-rclpy[fastrtps]==7.1.6" pyyaml==6.0.3 numpy==2.2.6 || exit 2
ROS_LOG_DIR="$temp" "$temp/venv/bin/python" - "$temp" <<'PY'
import sys
from pathlib import Path

import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter, parameter_dict_from_yaml_file


def plain(parameter):
    value = parameter.value
    return parameter.type_.name, list(value) if "ARRAY" in parameter.type_.name else value


def by_node(file):
    """The parameter of a node that is started with the file."""
    context = Context()
    rclpy.init(args=["--ros-args", "--params-file", str(file)], context=context)
    node = rclpy.create_node(
        "node", context=context, automatically_declare_parameters_from_overrides=True, start_parameter_services=False
    )
    parameter = plain(node.get_parameter("value"))
    node.destroy_node()
    rclpy.shutdown(context=context)
    return parameter


def by_client(file):
    """The parameter that the client would send."""
    return plain(Parameter.from_parameter_msg(parameter_dict_from_yaml_file(str(file), use_wildcard=True)["value"]))


EXPECTED = {
    "1e-06": (("DOUBLE", 1e-06), ("STRING", "1e-06")),
    "1.0e6": (("DOUBLE", 1e6), ("STRING", "1.0e6")),
    "0.00001": (("DOUBLE", 1e-05), ("STRING", "1e-05")),
    "[1.5, 1e-3]": (("DOUBLE_ARRAY", [1.5, 1e-3]), ("STRING", "[1.5, '1e-3']")),
    "[1e-3, 2e-3]": (("DOUBLE_ARRAY", [1e-3, 2e-3]), ("STRING_ARRAY", ["1e-3", "2e-3"])),
    ".inf": (("DOUBLE", float("inf")), ("STRING", "inf")),
    "08": (("DOUBLE", 8.0), ("STRING", "08")),
    "1:30": (("STRING", "1:30"), ("INTEGER", 90)),
    "'1.5'": (("STRING", "1.5"), ("DOUBLE", 1.5)),
    "'on'": (("STRING", "on"), ("BOOL", True)),
    "'[1, 2]'": (("STRING", "[1, 2]"), ("INTEGER_ARRAY", [1, 2])),
    "1.5": (("DOUBLE", 1.5), ("DOUBLE", 1.5)),
    "7": (("INTEGER", 7), ("INTEGER", 7)),
    "on": (("BOOL", True), ("BOOL", True)),
}
as_stated = True
file = Path(sys.argv[1]) / "parameters.yaml"
for text, expected in EXPECTED.items():
    file.write_text(f"/**:\n  ros__parameters:\n    value: {text}\n")
    seen = (by_node(file), by_client(file))
    print(f"{text:13} node {seen[0]!s:32} client {seen[1]}")
    as_stated &= seen == expected
sys.exit(0 if as_stated else 1)
PY
