"""All parameters of a ride, resolved and checked before anything is started or built. No ROS."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

from catenary_model.parameters import line_of
from catenary_model.reach import beyond_reach
from phil_base.parameter_file import is_rclpys, reaches, read_parameter_file
from phil_base.parameters import (
    Group,
    ParameterError,
    build,
    config_file,
    defaults,
    flatten,
    infos,
    nearest,
    read_file,
    values_of,
)
from phil_base.yaml_file import YamlError
from phil_loop.builds import check_builds
from phil_loop.shortcuts import SHORTCUTS

Settings = dict[str, dict[str, Any]]
"""Node name to flat dotted parameter to value."""

NODES = ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim")
"""The nodes, in the order in which they are brought up."""

FOLLOWS = {
    "test_rig_sim": {"speed_kmh": "catenary_model"},
    **{name: {"mode": "test_rig_sim"} for name in NODES if name != "test_rig_sim"},
}
"""Parameters that a node takes over from another node, wherever that one is given a value and it is not."""


CLOCKS = ("lockstep", "realtime")
"""Values of `mode`, which the other nodes take over from the rig before the rig itself is checked."""


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


def as_ordinary(overrides: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Give the overrides with which no node asks for real-time scheduling."""
    found = {name: dict(values) for name, values in overrides.items()}
    for name in NODES:
        found.setdefault(name, {})["real_time.scheduling"] = "ordinary"
    return found


def settings(
    *,
    speed_kmh: float | None = None,
    line: str | Path | None = None,
    pantograph: str | None = None,
    duration: float | None = None,
    mode: str | None = None,
    seed: int | None = None,
    discretisation: str | None = None,
    rig: str | None = None,
    params: str | Path | Sequence[Path] | None = None,
    **nodes: Mapping[str, Any],
) -> Settings:
    """Give all parameters of a ride by the names of the run script, complete and checked as it does.

    Further keywords are nodes, each with a mapping from its parameters, dotted or nested, to values; they lose against
    the short names. What is left out comes from ``params`` (ROS parameter files), the ``rig`` and the nodes' defaults.

    >>> settings(speed_kmh=200, impedance_mpc={"control": "integrated"})["impedance_mpc"]["control"]
    'integrated'

    Raises
    ------
    ParameterError
        One line for each keyword, node or parameter that is unknown, of a wrong type or out of range.
    """
    given = {
        "speed_kmh": speed_kmh,
        "line": None if line is None else str(line),
        "pantograph": pantograph,
        "duration": duration,
        "mode": mode,
        "seed": seed,
        "discretisation": discretisation,
    }
    overrides: dict[str, dict[str, Any]] = {}
    for node, values in nodes.items():
        if node not in NODES:
            known = (*SHORTCUTS, "rig", "params", *NODES)
            raise ParameterError(f"settings: there is no '{node}'{nearest(node, known)} (known: {', '.join(known)})")
        if not isinstance(values, Mapping):
            raise ParameterError(f"settings: '{node}' = {values!r} is not allowed: a mapping from parameters to values")
        overrides[node] = flatten(values)
    for option, value in given.items():
        if value is not None:
            node, key = SHORTCUTS[option]
            overrides.setdefault(node, {})[key] = value
    return resolve(params, overrides, rig)


def resolve(
    params: str | Path | Sequence[Path] | None, overrides: Mapping[str, Mapping[str, Any]], rig: str | None = None
) -> Settings:
    """Merge the nodes' defaults, a rig, parameter files and overrides; give node to flat values, complete and checked.

    Later ones win: what a rig of `rig_names` brings holds where neither file nor overrides say otherwise.

    Raises
    ------
    ParameterError
        One line for each node or parameter that is unknown, of a wrong type or out of range.
    """
    from_rig = {} if rig is None else rig_layer(rig)
    models = {name: _model(name) for name in NODES}
    known = {name: {info.name for info in infos(model)} for name, model in models.items()}
    filed, own, problems = _filed(files_of(params), known) if params else ({}, {}, [])
    listed = ", ".join(NODES)
    problems += [f"--set: there is no node '{name}' (nodes: {listed})" for name in overrides if name not in NODES]
    layers = {
        name: [defaults(name), from_rig.get(name, {}), filed.get(name, {}), overrides.get(name, {})] for name in NODES
    }
    groups: dict[str, Group] = {}
    for name in NODES:
        values: dict[str, Any] = {}
        for level, layer in enumerate(layers[name]):
            for key, leader in FOLLOWS.get(name, {}).items():
                # What is wrong in the other node is said once.
                theirs = layers[leader][level].get(key)
                if theirs is not None and (leader in groups or theirs in CLOCKS):
                    values[key] = theirs
            values |= layer
        try:
            groups[name] = build(models[name], values, name)
        except ParameterError as error:
            problems.append(str(error))
    if problems:
        raise ParameterError("\n".join(problems))
    settings = {name: values_of(group) | own.get(name, {}) for name, group in groups.items()}
    _check_together(settings)
    check_builds(groups)
    return settings


def nodes_of(pattern: str, nodes: tuple[str, ...]) -> tuple[str, ...]:
    """Give the nodes that an entry of a parameter file reaches: by name, or by wildcards."""
    return tuple(name for name in nodes if reaches("/" + pattern.lstrip("/"), f"/{name}"))


def files_of(params: str | Path | Sequence[Path] | None) -> tuple[Path, ...]:
    """Give the parameter files as a tuple: one, several or none."""
    return (Path(params),) if isinstance(params, (str, Path)) else tuple(map(Path, params or ()))


def _filed(files: Sequence[Path], known: Mapping[str, set[str]]) -> tuple[Settings, Settings, list[str]]:
    """Give what parameter files say to each node: of its own parameters, of rclpy's, and what is wrong with them."""
    params = ", ".join(map(str, files))
    try:
        file = read_parameter_file(*files)
    except YamlError as error:
        raise ParameterError(str(error)) from None
    filed: Settings = {}
    own: Settings = {}
    problems: list[str] = []
    for pattern, entries in file.nodes:
        nodes = nodes_of(pattern, NODES)
        last = pattern.rpartition("/")[2]
        if not nodes and last not in NODES and get_close_matches(last, NODES, 1):
            # ROS would say nothing: a slip of the pen would be lost. A node of another namespace is another node.
            problems.append(f"{params}: there is no node '{pattern}' (nodes: {', '.join(NODES)})")
        for entry in entries:
            key, value = entry.name, entry.value
            if nodes and is_rclpys(key):
                free = key.startswith("qos_overrides") and value is not None
                if not (free or isinstance(value, bool)):
                    problems.append(f"{params}: parameter '{key}' = {value!r} is not allowed: true or false")
                for name in nodes:
                    own.setdefault(name, {})[key] = value
                continue
            if len(nodes) > 1 and not any(key in known[name] for name in nodes):
                problems.append(
                    f"{params}: no node has a parameter '{key}'{nearest(key, set().union(*known.values()))}"
                )
            for name in nodes:
                # What is said for many nodes reaches those that know it; what is said for one has to be known.
                if len(nodes) == 1 or key in known[name]:
                    filed.setdefault(name, {})[key] = value
    return filed, own, problems


def _model(name: str) -> type[Group]:
    found: type[Group] = import_module(f"{name}.parameters").Parameters
    return found


def _check_together(settings: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse nodes that would not fit together."""
    for key, names in (("cycle_time", NODES), ("mode", NODES), ("speed_kmh", ("catenary_model", "test_rig_sim"))):
        found = {name: settings[name][key] for name in names}
        if len(set(found.values())) > 1:
            unit = next(info.unit for info in infos(_model(names[0])) if info.name == key)
            shown = [value if isinstance(value, str) else f"{value:g} {unit}" for value in found.values()]
            listed = ", ".join(f"{name} {value}" for name, value in zip(found, shown, strict=True))
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
