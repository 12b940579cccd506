"""All parameters of a ride, checked before anything is started."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import yaml

from catenary_model.line_file import LineFileError, dump_line, preset_names
from catenary_model.parameters import line_of
from catenary_model.reach import beyond_reach
from phil_node.parameters import Group, ParameterError, build, config_file, defaults, infos, nest, read_file, values_of

Settings = dict[str, dict[str, Any]]
"""Node name to flat dotted parameter to value."""

NODES = ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim")
"""The nodes, in the order in which they are brought up."""

FOLLOWS = {"test_rig_sim": {"speed_kmh": "catenary_model"}}
"""Parameters that a node takes over from another node, wherever that one is given a value and it is not."""


def rig_names() -> list[str]:
    """Give the names of the rigs that come with the package: the files in test_rig_sim's config/rigs."""
    return sorted(path.stem for path in config_file("test_rig_sim", "rigs/nominal.yaml").parent.glob("*.yaml"))


def rig_layer(name: str) -> dict[str, dict[str, Any]]:
    """Give what a rig of that name changes: its parameters, and the controller's with the model identified on it.

    Raises
    ------
    ParameterError
        There is no such rig.
    """
    if name not in rig_names():
        raise ParameterError(f"--rig: there is no rig '{name}' (rigs: {', '.join(rig_names())})")
    files = (config_file("impedance_mpc", f"identified/{name}.yaml"), config_file("test_rig_sim", f"rigs/{name}.yaml"))
    found: dict[str, dict[str, Any]] = {}
    for content in map(read_file, files):
        for node, values in content.items():
            found[node] = found.get(node, {}) | values
    return found


def resolve(params: Path | None, overrides: Mapping[str, Mapping[str, Any]], rig: str | None = None) -> Settings:
    """Merge the nodes' defaults, a rig, a parameter file and overrides; give node to flat values, complete and checked.

    Later ones win: what a rig of `rig_names` brings holds where neither file nor overrides say otherwise.

    Raises
    ------
    ParameterError
        One line for each node or parameter that is unknown, of a wrong type or out of range.
    """
    from_rig = rig_layer(rig) if rig else {}
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
    layers: dict[str, list[Mapping[str, Any]]] = {}
    for name in NODES:
        filed: dict[str, Any] = {}
        for pattern, nodes in wanted.items():
            # What is said for many nodes reaches those that know it; what is said for one has to be known.
            given = from_file[pattern]
            if name in nodes:
                filed |= {key: value for key, value in given.items() if len(nodes) == 1 or key in known[name]}
        layers[name] = [defaults(name), from_rig.get(name, {}), filed, overrides.get(name, {})]
    settings = {}
    for name in NODES:
        values: dict[str, Any] = {}
        for level, layer in enumerate(layers[name]):
            for key, leader in FOLLOWS.get(name, {}).items():
                # What is wrong in the other node is said once.
                if key in layers[leader][level] and leader in settings:
                    values[key] = layers[leader][level][key]
            values |= layer
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


def pantograph_text(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """Give the text of the file that describes the pantograph; empty if the settings name none.

    Raises
    ------
    ParameterError
        The file is not there any more.
    """
    rig = settings["test_rig_sim"]
    if rig["pantograph"] != "state_space" or not rig["pantograph_file"]:
        return ""
    try:
        return Path(rig["pantograph_file"]).expanduser().read_text(encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"test_rig_sim: parameter 'pantograph_file': {error}") from None


def write(settings: Mapping[str, Mapping[str, Any]], line: str, folder: Path, pantograph: str = "") -> None:
    """Write `params.yaml`, a ROS parameter file that gives the same ride again, and `line.yaml`, its overhead line.

    A line that was given as a file is taken from the copy: what happens to the file later does not matter. So is a
    pantograph whose text (`pantograph_text`) is given, from `pantograph.yaml`.
    """
    (folder / "line.yaml").write_text(line, encoding="utf-8")
    tree = {name: {"ros__parameters": nest(values)} for name, values in settings.items()}
    catenary = tree["catenary_model"]["ros__parameters"]
    if catenary["line"] not in preset_names():
        catenary["line"] = str((folder / "line.yaml").absolute())
    if pantograph:
        (folder / "pantograph.yaml").write_text(pantograph, encoding="utf-8")
        tree["test_rig_sim"]["ros__parameters"]["pantograph_file"] = str((folder / "pantograph.yaml").absolute())
    lead = "# Everything that this ride ran with. To ride the same again: scripts/run.sh --params THIS_FILE\n"
    (folder / "params.yaml").write_text(lead + yaml.safe_dump(tree, sort_keys=False), encoding="utf-8")


def _model(name: str) -> type[Group]:
    found: type[Group] = import_module(f"{name}.parameters").Parameters
    return found


def _check_together(settings: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse nodes that would not fit together."""
    for key, names in (("cycle_time", NODES), ("speed_kmh", ("catenary_model", "test_rig_sim"))):
        found = {name: settings[name][key] for name in names}
        if len(set(found.values())) > 1:
            unit = next(info.unit for info in infos(_model(names[0])) if info.name == key)
            listed = ", ".join(f"{name} {value:g} {unit}" for name, value in found.items())
            where = "in all nodes" if names == NODES else "in both"
            raise ParameterError(f"parameter '{key}' has to be the same {where}, but is: {listed}")
    _check_reach(settings)


def _check_reach(settings: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse a line whose contact wire is, or is lifted to, where the drive cannot go."""
    wire, controller, rig = settings["catenary_model"], settings["impedance_mpc"], settings["test_rig_sim"]
    if controller["environment"] != "catenary":
        return
    low = max(controller["position_minimum"], -rig["limits.position"])
    high = min(controller["position_maximum"], rig["limits.position"])
    problem = beyond_reach(line_of(wire["line"]), low, high, rig["uplift_force"])
    if problem:
        raise ParameterError(
            f"catenary_model: parameter 'line' = {wire['line']!r}: {problem} (position_minimum, position_maximum of "
            "impedance_mpc; limits.position of test_rig_sim)"
        )
