"""All parameters of a ride, checked before anything is started."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from catenary_model.line_file import LineFileError, dump_line, preset_names
from catenary_model.parameters import line_of
from phil_node.parameters import Group, ParameterError, build, defaults, infos, nest, read_file, values_of

Settings = dict[str, dict[str, Any]]
"""Node name to flat dotted parameter to value."""

NODES = ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim")
"""The nodes, in the order in which they are brought up."""


def resolve(params: Path | None, overrides: Mapping[str, Mapping[str, Any]]) -> Settings:
    """Merge the nodes' defaults, a parameter file and overrides; give node to flat values, complete and checked.

    Raises
    ------
    ParameterError
        One line for each node or parameter that is unknown, of a wrong type or out of range.
    """
    from_file = read_file(params) if params else {}
    wanted = {name: _nodes_of(name) for name in from_file}
    listed = ", ".join(NODES)
    problems = [f"{params}: there is no node '{name}' (nodes: {listed})" for name, nodes in wanted.items() if not nodes]
    problems += [f"--set: there is no node '{name}' (nodes: {listed})" for name in overrides if name not in NODES]
    models = {name: _model(name) for name in NODES}
    known = {name: {info.name for info in infos(model)} for name, model in models.items()}
    for pattern, nodes in wanted.items():
        for key in from_file[pattern]:
            if len(nodes) > 1 and key != "use_sim_time" and not any(key in known[name] for name in nodes):
                problems.append(f"{params}: no node has a parameter '{key}'")
    settings = {}
    for name in NODES:
        values = defaults(name)
        for pattern, nodes in wanted.items():
            # What is said for many nodes reaches those that know it; what is said for one has to be known.
            given = from_file[pattern]
            if name in nodes:
                values |= {key: value for key, value in given.items() if len(nodes) == 1 or key in known[name]}
        values |= overrides.get(name, {})
        try:
            settings[name] = values_of(build(models[name], values, name))
        except ParameterError as error:
            problems.append(str(error))
    if problems:
        raise ParameterError("\n".join(problems))
    _check_together(settings)
    return settings


def _nodes_of(pattern: str) -> tuple[str, ...]:
    """Give the nodes that an entry of a parameter file is for: a name, a name behind a namespace, or a wildcard."""
    last = pattern.strip("/").split("/")[-1]
    return NODES if last in ("*", "**") else tuple(name for name in NODES if name == last)


def line_text(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """Give the description of the overhead line that the settings name, as the text of a YAML file.

    Raises
    ------
    ParameterError
        There is no such line any more, or it is unusable.
    """
    name = settings["catenary_model"]["line"]
    try:
        line = line_of(name)
    except LineFileError as error:
        raise ParameterError(f"catenary_model: parameter 'line': {error}") from None
    lead = "# The overhead line of this ride. To ride on it again: scripts/run.sh --line THIS_FILE\n"
    return lead + dump_line(line)


def write(settings: Mapping[str, Mapping[str, Any]], line: str, folder: Path) -> None:
    """Write `params.yaml`, a ROS parameter file that gives the same ride again, and `line.yaml`, its overhead line.

    A line that was given as a file is taken from the copy: what happens to the file later does not matter.
    """
    (folder / "line.yaml").write_text(line, encoding="utf-8")
    tree = {name: {"ros__parameters": nest(values)} for name, values in settings.items()}
    catenary = tree["catenary_model"]["ros__parameters"]
    if catenary["line"] not in preset_names():
        catenary["line"] = str((folder / "line.yaml").absolute())
    lead = "# Everything that this ride ran with. To ride the same again: scripts/run.sh --params THIS_FILE\n"
    (folder / "params.yaml").write_text(lead + yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")


def _model(name: str) -> type[Group]:
    found: type[Group] = import_module(f"{name}.parameters").Parameters
    return found


def _check_together(settings: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse nodes that would not fit together."""
    times = {name: values["cycle_time"] for name, values in settings.items()}
    if len(set(times.values())) > 1:
        listed = ", ".join(f"{name} {value:g} s" for name, value in times.items())
        raise ParameterError(f"parameter 'cycle_time' has to be the same in all nodes, but is: {listed}")
