"""What others read is written whole: our sources write files by `phil_base.atomic`, but for those listed here."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import pytest
from test_imports import modules, path_of

OTHERWISE = {
    "phil_base.atomic": "writes the draft",
    "phil_base.kernels": "writes the draft that `whole` gave",
    "phil_base.real_time": "a setting of the kernel in /proc",
    "phil_base.command_line": "opens the file to see that it can be written, and adds nothing",
    "phil_base.forked": "standard output of a process",
    "catenary_model.boundary.control_design.cache": "writes the draft that `whole` gave",
    "energy_monitor.watch": "the null device",
    "energy_monitor.bag_sqlite": "a copy in a temporary folder",
    "energy_monitor.report.style": "pictures, which go into a draft folder of `together`",
    "bench.lines": "a file in a temporary folder",
    "bench.realtime.child": "a log, which grows while it is read",
    "bench.realtime.disturbance": "a log, which grows while it is read",
    "ride.processes": "a log, which grows while it is read",
    "soak.reporting": "a log, which grows while it is read",
    "faults.wall_clock": "a counter shared with another process, written in place",
    "fuzz.hunt": "a note in a folder made anew, for whoever reads the line that names it",
    "fuzz.kinds": "the cases that are tried",
    "fuzz.mutations": "the cases that are tried",
    "fuzz.worker": "a setting of the kernel in /proc",
}
"""Modules that write in another way, and why."""
PICTURES = {"bench", "validate", "soak", "phil_study"}
"""Packages whose pictures go into a draft folder, which their entry makes."""


def written(tree: ast.Module) -> Iterator[str]:
    """Name the calls in a module that write a file in place."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        # Text on a path: `write_text(path, text)` of phil_base.atomic has two arguments.
        on_a_path = name in ("write_text", "write_bytes") and isinstance(node.func, ast.Attribute)
        of_a_path = name == "open" and isinstance(node.func, ast.Attribute)
        modes = [*node.args[0 if of_a_path else 1 :][:1], *(one.value for one in node.keywords if one.arg == "mode")]
        opened = name in ("open", "fdopen") and any(
            isinstance(mode, ast.Constant) and isinstance(mode.value, str) and bool(set(mode.value) & set("wax+"))
            for mode in modes
        )
        dumped = name == "dump" and getattr(getattr(node.func, "value", None), "id", "") in ("json", "pickle")
        if on_a_path or opened or dumped or name in ("savefig", "savez", "savetxt"):
            yield f"line {node.lineno}: {name}"


@pytest.mark.parametrize("module", sorted(modules()))
def test_files_are_written_by_the_one_way(module: str) -> None:
    path = path_of(module)
    assert path is not None
    found = list(written(ast.parse(path.read_text(encoding="utf-8"))))
    if module.split(".")[0] in PICTURES:
        found = [one for one in found if not one.endswith("savefig")]
    if module in OTHERWISE:
        assert found, f"{module} is listed without need"
    else:
        assert not found, f"{module} writes a file in place: {found}; take phil_base.atomic"


@pytest.mark.parametrize(
    "text", ["p.write_text('')", "p.open('w')", "open(p, mode='ab')", "json.dump(x, f)", "np.savez(p)", "f.savefig(p)"]
)
def test_what_writes_in_place_is_found(text: str) -> None:
    assert list(written(ast.parse(text)))


@pytest.mark.parametrize("text", ["write_text(p, '')", "p.open()", "p.open('rb')", "open('a')", "json.dumps(x)"])
def test_what_does_not_is_not(text: str) -> None:
    assert not list(written(ast.parse(text)))
