"""Changes of a node's parameters while it lives: what is taken, and the reason why not."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable
from typing import Any, TypeVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter

from phil_base.parameter_file import is_rclpys
from phil_base.parameters import Group, Info, ParameterError, build, infos, nearest, values_of
from phil_base.yaml_file import YamlError, parse_yaml

P = TypeVar("P", bound=Group)


class UnknownParameterError(ParameterNotDeclaredException):
    """A parameter that the node does not have was to be set; the text names it and the one that may be meant.

    rclpy answers a request for an undeclared parameter with the text of this kind of exception; its own has no names.
    """

    def __init__(self, node: str, name: str, known: Iterable[str]) -> None:
        Exception.__init__(self, f"{node} has no parameter '{name}'{nearest(name, known)}")


def as_declared(node: str, model: type[Group], changes: list[Parameter]) -> list[Parameter]:
    """Give every change the type that its parameter has, where that loses nothing.

    An integer is a number. A number that came as a text is one too: rclpy's client that loads parameter files turns
    1.0e-06 into '1e-06', which YAML 1.1 takes for a text.

    Raises
    ------
    UnknownParameterError
        There is no parameter of that name.
    """
    known = {info.name: info for info in infos(model)}
    found = []
    for change in changes:
        info = known.get(change.name)
        if info is None and not is_rclpys(change.name):
            raise UnknownParameterError(node, change.name, known)
        found.append(change if info is None else _as_declared(info, change))
    return found


def merged(group: P, changes: Iterable[Parameter]) -> P:
    """Give the parameters with the changes; what rclpy itself declares is left out. Raises ParameterError."""
    values = values_of(group)
    for change in changes:
        if change.name in values:
            value = change.value
            values[change.name] = list(value) if hasattr(value, "tolist") else value
    return build(type(group), values)


def fixed_while_active(node: str, live: Collection[str], changes: Iterable[Parameter]) -> str:
    """Say which change is refused while the node is active, empty if none is: only live parameters may change."""
    for change in changes:
        if change.name not in live:
            return f"'{change.name}' cannot change while active: deactivate {node} first"
    return ""


class Changes:
    """Takes changes of a node's parameters: live ones at once, others with its next design.

    ``stale`` tells that the present design is one of older parameters.
    """

    def __init__(self, node: Any, model: type[Group]) -> None:
        self.stale = False
        self._node, self._model = node, model
        self._live = frozenset(info.name for info in infos(model) if info.live)
        node.add_pre_set_parameters_callback(self._prepare)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._take)

    def _prepare(self, changes: list[Parameter]) -> list[Parameter]:
        return as_declared(self._node.get_name(), self._model, changes)

    def _check(self, changes: list[Parameter]) -> SetParametersResult:
        node = self._node
        reason = fixed_while_active(node.get_name(), self._live, changes) if node.active else ""
        if not reason:
            try:
                merged(node.parameters, changes)
            except ParameterError as error:
                reason = str(error)
        return SetParametersResult(successful=not reason, reason=reason)

    def _take(self, changes: list[Parameter]) -> None:
        node = self._node
        ours = values_of(node.parameters).keys()
        names = frozenset(change.name for change in changes if change.name in ours)
        if not names:
            return
        with node.lock:
            node.parameters = merged(node.parameters, changes)
            if node.configured and not names <= self._live:
                self.stale = True
            elif node.configured:
                node.changed(names)


def _as_declared(info: Info, change: Parameter) -> Parameter:
    value = change.value
    if info.kind is float:
        number = _number(value)
        return change if number is None else Parameter(change.name, Parameter.Type.DOUBLE, number)
    if info.kind is list:
        entries = _parsed(value) if isinstance(value, str) else value
        if isinstance(entries, Iterable) and not isinstance(entries, str | bytes):
            numbers = [_number(entry) for entry in entries]
            if numbers and None not in numbers:
                return Parameter(change.name, Parameter.Type.DOUBLE_ARRAY, numbers)
    return change


def _number(value: Any) -> float | None:
    """Give a number, or a text that is one, as a float; None for all else."""
    if isinstance(value, str):
        value = _parsed(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def _parsed(text: str) -> Any:
    try:
        return parse_yaml(text)
    except YamlError:
        return None
