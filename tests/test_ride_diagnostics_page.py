"""Every sentence that a node may say on /diagnostics or in its log, and every figure, is explained in the page."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "diagnostics.md"

SAYING = {"Diagnosis", "add", "refuse", "retract", "error", "warning", "info", "_refuse", "_object", "_objects"}
"""Functions whose arguments are sentences, wherever they are called in a node's code."""
SENTENCES = {
    "interfaces/phil_node/phil_node/base.py": ("_attempt", "_LifecycleNodeMixin__change_state"),
    "interfaces/phil_node/phil_node/health.py": ("diagnosis", "_misses_clock"),
    "interfaces/phil_node/phil_node/timing.py": ("refuse",),
    "interfaces/phil_base/phil_base/guard.py": ("objection",),
    "interfaces/phil_node/phil_node/bounded_log.py": ("_line",),
    "catenary_model/catenary_model/node.py": ("diagnose", "silence", "_on_command"),
    "catenary_model/catenary_model/sequence.py": ("judge", "objection"),
    "impedance_mpc/impedance_mpc/node.py": ("diagnose", "silence", "_receive_model", "_refuse", "_object"),
    "test_rig_sim/test_rig_sim/node.py": ("diagnose", "silence", "start", "_report"),
    "test_rig_sim/test_rig_sim/diagnosis.py": ("*",),
    "test_rig_sim/test_rig_sim/supervisor.py": ("objection", "bridge", "_go_on", "_retract_on", "_unit"),
    "test_rig_sim/test_rig_sim/limits.py": ("check", "warning"),
    "energy_monitor/energy_monitor/node.py": ("diagnose", "silence", "_on_rig", "_on_command", "_on_catenary"),
    "energy_monitor/energy_monitor/audit.py": ("complaints", "_refuse"),
}
FIGURES = {
    "interfaces/phil_node/phil_node/health.py": ("diagnosis",),
    "interfaces/phil_node/phil_node/timing.py": ("summary",),
    "interfaces/phil_node/phil_node/wires.py": ("figures",),
    "interfaces/phil_base/phil_base/real_time.py": ("apply", "_give"),
    **{f"{name}/{name}/node.py": ("diagnose",) for name in ("catenary_model", "impedance_mpc", "test_rig_sim")},
    "energy_monitor/energy_monitor/node.py": ("diagnose",),
}
CALLS = ("interfaces/phil_node/phil_node/*.py", "energy_monitor/energy_monitor/[an]*.py")
OF_SCRIPTS = ("command_line.py", "identify.py")
"""Say what is wrong with a script's command line, on the terminal."""
CALLS = (*CALLS, *(f"{name}/{name}/*.py" for name in ("catenary_model", "impedance_mpc", "test_rig_sim")))


def template(node: ast.expr) -> str:
    """Give the text of a string with {} for what is put in; empty for anything else."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    return ""


def strings(tree: ast.AST) -> Iterator[str]:
    """Yield the texts below a node, but no docstrings, keys of dictionaries, or single words."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(child) for child in ast.walk(node) if child is not node}
        elif isinstance(node, ast.Dict):
            skipped |= {id(key) for key in node.keys if key is not None}
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            skipped.add(id(node.value))
        elif isinstance(node, ast.keyword) and node.arg in ("doc", "help"):
            skipped |= {id(child) for child in ast.walk(node)}
    for node in ast.walk(tree):
        if id(node) not in skipped and isinstance(node, (ast.Constant, ast.JoinedStr)):
            text = template(node).strip(" ;:")
            if re.search(r"[A-Za-z]{2,} +\S|\S +[A-Za-z]{2,}", text):
                yield normal(text)


def functions(path: str, names: tuple[str, ...]) -> Iterator[ast.AST]:
    tree = ast.parse((ROOT / path).read_text())
    found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    if names == ("*",):
        yield tree
        return
    missing = set(names) - {node.name for node in found}
    assert not missing, f"{path} has no {missing}: correct the list here"
    yield from (node for node in found if node.name in names)


def sentences() -> set[str]:
    found = {text for path, names in SENTENCES.items() for tree in functions(path, names) for text in strings(tree)}
    for pattern in CALLS:
        for path in (path for path in ROOT.glob(pattern) if path.name not in OF_SCRIPTS):
            for node in ast.walk(ast.parse(path.read_text())):
                if not isinstance(node, ast.Call):
                    continue
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                if name in SAYING:
                    found |= {text for argument in node.args for text in strings(argument)}
    return found


def figures() -> set[str]:
    found = set()
    for path, names in FIGURES.items():
        for tree in functions(path, names):
            for node in ast.walk(tree):
                keys: list[ast.expr | None] = []
                if isinstance(node, ast.Dict):
                    keys = list(node.keys)
                elif isinstance(node, ast.DictComp):
                    keys = [node.key]
                elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Subscript):
                    keys = [node.targets[0].slice]
                elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "take":
                    keys = [node.args[0]]
                found |= {normal(text) for key in keys if key is not None and (text := template(key))}
    return {key for key in found if re.search("[A-Za-z]", key)}


def normal(text: str) -> str:
    return re.sub(r"\{[^{}]*\}", "{}", text)


@pytest.fixture(scope="module")
def spans() -> set[str]:
    return {normal(span) for span in re.findall(r"`([^`\n]+)`", PAGE.read_text())}


def test_every_sentence_is_explained(spans: set[str]) -> None:
    found = sentences()
    assert len(found) > 50  # the collector sees them
    missing = sorted(text for text in found if not any(text in span for span in spans))
    assert not missing, f"docs/diagnostics.md does not explain: {missing}"


def test_every_figure_is_explained(spans: set[str]) -> None:
    found = figures()
    assert len(found) > 50
    assert not (missing := sorted(found - spans)), f"docs/diagnostics.md does not explain: {missing}"


def test_nothing_is_explained_that_no_node_says(spans: set[str]) -> None:
    """What stands in the first column of a table is in the code."""
    code = sentences() | figures()
    text = PAGE.read_text().split("## All nodes")[1].split("## Starting and ending")[0]
    rows = [line.split("|")[1] for line in text.splitlines() if line.startswith("| `")]
    first = {normal(span) for row in rows for span in re.findall(r"`([^`]+)`", row)}
    unknown = sorted(span for span in first if not any(said in span for said in code))
    assert len(first) > 100 and not unknown, f"no node says: {unknown}"
