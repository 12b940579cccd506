"""Accuracy and time of the finite elements and the finite differences side by side, for the terminal."""

from __future__ import annotations

from collections.abc import Mapping

from rich import box
from rich.table import Table

from catenary_model.config import DISCRETISATIONS

COLUMNS = {
    "error of force": "error\n/ sigma",
    "correlation of force": "corr.",
    "truncation": "trunc.",
    "displacement, rms of difference": "w\nmm",
    "time of a cycle": "cycle\nus",
}
"""Figures that the sheet shows, and the heads of their columns."""


class SideBySide:
    """Collects the figures of every case, a row a case and a group of columns a discretisation."""

    def __init__(self) -> None:
        self._cases: dict[str, dict[str, Mapping[str, tuple[float, str, str]]]] = {}

    def add(self, case: str, discretisation: str, measured: Mapping[str, tuple[float, str, str]]) -> None:
        """Take the figures of one ride: value, unit and note by name."""
        self._cases.setdefault(case, {})[discretisation] = measured

    def sheet(self) -> Table:
        """Make the table."""
        made = Table(
            title="finite elements (fe) and finite differences (fd) on the same ride, against the same reference",
            title_justify="left",
            box=box.SIMPLE_HEAD,
            padding=(0, 1, 0, 0),
            pad_edge=False,
        )
        made.add_column("")
        for head in COLUMNS.values():
            for one in DISCRETISATIONS:
                made.add_column(f"{one}\n{head}", justify="right", no_wrap=True)
        for case, found in self._cases.items():
            cells = [f"{found[one][name][0]:.4g}" for name in COLUMNS for one in DISCRETISATIONS]
            made.add_row(case, *cells)
        return made
