"""Bridge between a parameter model and the ROS parameters of a node."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from phil_base.parameter_file import is_rclpys
from phil_base.parameters import Group, Info, build, infos, values_of

G = TypeVar("G", bound=Group)

INT64_MAX = 2**63 - 1


def declare(node: Node, model: type[G], default_values: Mapping[str, Any]) -> G:
    """Declare every parameter of ``model`` on ``node``: defaults, overridden by what the node was started with.

    The node has to be made with ``automatically_declare_parameters_from_overrides=True``: that is the public way to
    see the overrides, unknown ones included.

    Raises
    ------
    ParameterError
        An override is unknown, of a wrong type or out of range.
    """
    overrides = {
        name: _plain(entry.value) for name, entry in node.get_parameters_by_prefix("").items() if not is_rclpys(name)
    }
    group = build(model, {**default_values, **overrides}, node.get_name())
    for name in overrides:
        node.undeclare_parameter(name)
    values = values_of(group)
    for info in infos(model):
        node.declare_parameter(info.name, values[info.name], descriptor(info), ignore_override=True)
    return group


def descriptor(info: Info) -> ParameterDescriptor:
    """Describe one parameter for ``ros2 param describe``: text, unit, range, and whether it may change while active."""
    unit = f" [{info.unit}]" if info.unit else ""
    when = "may change at any time" if info.live else "cannot change while active"
    found = ParameterDescriptor(
        name=info.name,
        description=f"{info.description}{unit} ({when})",
        additional_constraints=info.allowed(),
    )
    bounded = info.low is not None or info.high is not None
    if info.kind is float and bounded:
        low = -1e308 if info.low is None else float(info.low)
        high = 1e308 if info.high is None else float(info.high)
        found.floating_point_range = [FloatingPointRange(from_value=low, to_value=high, step=0.0)]
    elif info.kind is int and bounded:
        low_int = -INT64_MAX if info.low is None else int(info.low)
        high_int = INT64_MAX if info.high is None else int(info.high)
        found.integer_range = [IntegerRange(from_value=low_int, to_value=high_int, step=1)]
    return found


def _plain(value: Any) -> Any:
    """Give arrays as lists; all else as it is."""
    return list(value) if hasattr(value, "tolist") or isinstance(value, tuple) else value
