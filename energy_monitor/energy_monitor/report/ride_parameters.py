"""The parameters that a ride ran with, from its file: what of it reaches which node, as ROS has it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from energy_monitor.bag import Bag
from energy_monitor.parameters import Parameters
from energy_monitor.topics import NODES, RIG_STATE
from phil_base.parameter_file import read_parameter_file
from phil_base.parameters import ParameterError, build, defaults, infos
from phil_base.yaml_file import YamlError

Values = Mapping[str, Mapping[str, Any]]


def parameters_of(file: Path, bag: Bag) -> Values:
    """Give the flat values that a file holds for each node of the ride, by the node's name.

    A name with the namespace of the bag's ride, or a pattern that reaches it, goes before a mere name.

    Raises
    ------
    ParameterError
        The file is missing, ROS would refuse it, it says nothing of these nodes, or a value cannot be used.
    """
    try:
        filed = read_parameter_file(file)
    except YamlError as error:
        raise ParameterError(str(error)) from None
    topics = [topic for topic in bag.tables if topic.startswith(bag.namespace) and topic.endswith(f"/{RIG_STATE}")]
    space = topics[0].removesuffix(f"/{RIG_STATE}") if len(topics) == 1 else ""
    found = {node: filed.values(f"/{node}") | filed.values(f"{space}/{node}") for node in NODES}
    found = {node: values for node, values in found.items() if values}
    if filed.nodes and not found:
        names = ", ".join(name for name, _ in filed.nodes)
        raise ParameterError(f"{file}: nothing for a node of this ride ({', '.join(NODES)}), but for {names}")
    try:
        for node, values in found.items():
            _check(node, values)
    except ParameterError as error:
        raise ParameterError(f"{file}: {'; '.join(str(error).splitlines())}") from None
    return found


def _check(node: str, values: Mapping[str, Any]) -> None:
    """Refuse texts where numbers belong, and an evaluation of the force that the monitor would refuse."""
    try:
        usual = defaults(node)
    except (ParameterError, OSError):
        return  # a monitor on its own, without the other packages
    for name, value in values.items():
        if _is_number(usual.get(name)) and not _is_number(value):
            raise ParameterError(f"{node}: parameter '{name}' = {value!r} is not a number")
    if node == "energy_monitor":
        # Of the others an earlier version may have had different ones: they do not matter here.
        known = {info.name for info in infos(Parameters)}
        used = {name: value for name, value in values.items() if name.startswith("contact.") or name == "cycle_time"}
        build(Parameters, usual | {name: value for name, value in used.items() if name in known}, node)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
