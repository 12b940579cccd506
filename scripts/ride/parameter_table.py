"""Writes docs/parameters.md from the nodes' parameter models: ``python -m ride.parameter_table``."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from phil_base.atomic import write_text
from phil_base.parameters import Info, defaults, infos
from phil_base.workspace import workspace
from ride.settings import NODES

PATH = workspace() / "docs" / "parameters.md"

HEAD = """# Parameters

Every parameter of every node: what it means, its unit, default and range. Defaults are in `config/NODE.yaml` of each
package. A parameter marked *live* may change while its node is active (`ros2 param set`), all others only while it is
not. This page is made by `python -m ride.parameter_table` and checked by the tests.
"""


def table() -> str:
    """Make the page."""
    parts = [HEAD]
    for name in NODES:
        values = defaults(name)
        parts.append(
            f"\n## {name}\n\n| parameter | meaning | unit | default | allowed |\n| --- | --- | --- | --- | --- |"
        )
        parts += [_row(info, values[info.name]) for info in infos(import_module(f"{name}.parameters").Parameters)]
    return "\n".join(parts) + "\n"


def _row(info: Info, value: Any) -> str:
    live = " *live*" if info.live else ""
    unit = info.unit.replace("|", "\\|") if info.unit else ""
    allowed = info.range().removeprefix(" from ") or info.allowed().removesuffix(f" {info.unit}")
    return f"| `{info.name}` | {info.description}{live} | {unit} | {_show(value)} | {allowed} |"


def _show(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list):
        return ", ".join(_show(entry) for entry in value)
    return str(value)


if __name__ == "__main__":
    PATH.parent.mkdir(exist_ok=True)
    write_text(PATH, table())
