"""Who imports whom: read from the sources, so that an import within a function or for types alone counts as well."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

import pytest

from phil_base.workspace import workspace

FOUR = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor")
SCRIPTS = ("phil_loop", "phil_study", "bench", "validate", "ride", "doctor", "faults", "fuzz", "soak")
HOMES = {
    "phil_base": "interfaces/phil_base",
    "phil_node": "interfaces/phil_node",
    **{name: name for name in FOUR},
    **dict.fromkeys(SCRIPTS, "scripts"),
}
MESSAGES = {
    "phil_interfaces",
    "std_msgs",
    "std_srvs",
    "sensor_msgs",
    "geometry_msgs",
    "diagnostic_msgs",
    "rcl_interfaces",
}
ROS = {"rclpy", "phil_node", "lifecycle_msgs", "builtin_interfaces", "rosidl_runtime_py", *MESSAGES}
WITH_ROS = {
    "catenary_model": {"node"},
    "impedance_mpc": {"node"},
    "test_rig_sim": {"node", "diagnosis"},
    "energy_monitor": {"node", "record", "links", "listening"},
}
"""Modules of the four packages that run as nodes."""
ONE_THING = (
    # A loop, the ride that it is on and what an observer sees of both, which name each other as types.
    ("phil_loop.loop", "phil_loop.ride", "phil_loop.observing"),
    # A node, and what runs a process of nodes.
    ("phil_node.base", "phil_node.process"),
    # Both ends of a socket: a node forks the process for its topics, which runs the other module.
    ("phil_node.topics", "phil_node.topics_process"),
)


def path_of(module: str) -> Path | None:
    """File of one of our modules."""
    home = HOMES.get(module.split(".")[0])
    if home is None:
        return None
    base = workspace() / home / module.replace(".", "/")
    return next((path for path in (base / "__init__.py", base.with_suffix(".py")) if path.is_file()), None)


def modules() -> Iterator[str]:
    """Names of all our modules, packages' tests left out."""
    for package, home in HOMES.items():
        root = workspace() / home
        for path in sorted((root / package).rglob("*.py")):
            name = path.relative_to(root).with_suffix("").as_posix().replace("/", ".")
            yield name.removesuffix(".__init__")


def imported(tree: ast.Module, module: str) -> Iterator[tuple[str, bool]]:
    """Dotted names that a module imports, and whether it does so at import; what is for types alone is not."""
    later: set[ast.AST] = set()
    for node in ast.walk(tree):
        types_alone = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        if types_alone or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            later.update(ast.walk(node))
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node not in later) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            base = node.module or ""
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                yield (inner if path_of(inner) else base), node not in later


@cache
def arrows() -> Mapping[str, tuple[tuple[str, bool], ...]]:
    """What every module of ours imports."""
    found = {}
    for module in modules():
        path = path_of(module)
        assert path is not None, module
        found[module] = tuple(imported(ast.parse(path.read_text(encoding="utf-8")), module))
    return found


def roots(module: str, at_import: bool = False) -> set[str]:
    """Top-level packages that a module imports."""
    return {name.split(".")[0] for name, early in arrows()[module] if early or not at_import}


def of(*packages: str) -> list[str]:
    """Our modules in these packages."""
    return [module for module in arrows() if module.split(".")[0] in packages]


def circles() -> set[frozenset[str]]:
    """Sets of modules each of which reaches all others of its set."""
    graph = {module: {name for name, _ in to if name in arrows()} for module, to in arrows().items()}
    reached: dict[str, set[str]] = {}
    for module in graph:
        seen: set[str] = set()
        waiting = [module]
        while waiting:
            new = graph[waiting.pop()] - seen
            seen |= new
            waiting += new
        reached[module] = seen
    return {frozenset(o for o in to if module in reached[o]) for module, to in reached.items() if module in to}


@pytest.mark.slow
def test_no_module_imports_itself_by_a_detour() -> None:
    """Not even for types alone, but for what is one thing in several files; whoever parts these takes them out here."""
    assert circles() == {frozenset(modules) for modules in ONE_THING}


def test_phil_base_imports_none_of_ours_and_no_ros() -> None:
    assert {module: roots(module) & (set(HOMES) - {"phil_base"} | ROS) for module in of("phil_base")} == {
        module: set() for module in of("phil_base")
    }


def test_no_package_of_a_node_imports_another_one_or_the_scripts() -> None:
    others = {module: roots(module) & {*FOUR, *SCRIPTS} - {module.split(".")[0]} for module in of(*FOUR)}
    assert {module: names for module, names in others.items() if names} == {}


def test_only_nodes_import_ros() -> None:
    found = {module for module in of(*FOUR) if roots(module) & ROS}
    assert found == {f"{package}.{name}" for package, names in WITH_ROS.items() for name in names}


def test_phil_node_imports_phil_base_alone() -> None:
    found = {module: roots(module) & {*FOUR, *SCRIPTS} for module in of("phil_node")}
    assert {module: names for module, names in found.items() if names} == {}


def test_loop_studies_and_benches_need_no_ros_to_be_imported() -> None:
    """Whatever they import at once, and what that imports, as far as it is ours; the benches of rides ride."""
    riding = ("bench.realtime", "bench.rides")
    begin = [module for module in of("phil_loop", "phil_study", "bench", "validate") if not module.startswith(riding)]
    reached, waiting = set(begin), list(begin)
    while waiting:
        module = waiting.pop()
        assert not roots(module, at_import=True) & ROS, module
        new = {name for name, early in arrows()[module] if early and name in arrows()} - reached
        # A module is imported after the packages that it lies in.
        new |= {name.rsplit(".", depth)[0] for name in new for depth in range(1, name.count(".") + 1)} - reached
        reached |= new
        waiting += new
