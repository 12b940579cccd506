"""What a study or a bench found: values beside their goals, distributions of times, tables, remarks, pictures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from phil_study import distribution
from phil_study.distribution import Distribution

Samples = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Row:
    """One measured value; the goal is ``low <= value <= high``, either side may be open."""

    name: str
    case: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    note: str = ""

    @property
    def holds(self) -> bool | None:
        """Tell whether the goal is met; None without a goal. What is not a finite number meets no goal."""
        if self.low is None and self.high is None:
            return None
        if not math.isfinite(self.value):
            return False
        return (self.low is None or self.value >= self.low) and (self.high is None or self.value <= self.high)

    @property
    def goal(self) -> str:
        """Say the goal in words; empty without one."""
        if self.low is not None and self.high is not None:
            return f"{self.low:g} .. {self.high:g}"
        if self.low is not None:
            return f">= {self.low:g}"
        return "" if self.high is None else f"<= {self.high:g}"

    def row(self) -> dict[str, object]:
        """Give the figures for JSON."""
        return {
            "name": self.name,
            "case": self.case,
            "value": self.value if math.isfinite(self.value) else None,
            "unit": self.unit,
            "low": self.low,
            "high": self.high,
            "holds": self.holds,
            "note": self.note or None,
        }


@dataclass(frozen=True)
class Sheet:
    """A further table; its rows go to the JSON file as they are, under its name."""

    name: str
    """Key in the JSON file."""
    title: str
    columns: dict[str, str]
    """Key of an entry of a row, and what stands above it on the terminal."""
    rows: Sequence[dict[str, object]]

    def table(self) -> Table:
        """Make the table for the terminal."""
        made = Table(title=self.title, title_justify="left")
        shown = [[_shown(row.get(key)) for key in self.columns] for row in self.rows]
        for number, head in enumerate(self.columns.values()):
            text = all(isinstance(row.get(list(self.columns)[number]), str | None) for row in self.rows)
            made.add_column(head, justify="left" if text else "right")
        for line in shown:
            made.add_row(*line)
        return made


def _shown(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "holds" if value else "FAILS"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Outcome:
    """All that was found, and what has to be said about it; ``rows`` are measured values or distributions of times.

    ``details`` are rows for the file alone, where they are too many for a terminal; ``overviews`` are shown instead.
    """

    title: str
    rows: Sequence[Row | Distribution]
    notes: Sequence[str] = ()
    details: Sequence[Row] = ()
    overviews: Sequence[Table] = ()
    sheets: Sequence[Sheet] = ()
    samples: Samples = field(default_factory=dict)
    """Times in s, by name, for the picture of the distributions."""
    pictures: Mapping[str, Callable[[Path], None]] = field(default_factory=dict)
    """Further pictures: end of the file's name, and what draws it into a file."""
    grouped: bool = False
    """Name a case once, above all its rows that follow one another."""

    @property
    def holds(self) -> bool:
        """Tell whether every row with a goal meets it."""
        return all(row.holds is not False for row in (*self.rows, *self.details))

    def tables(self) -> list[Table]:
        """Make the tables for the terminal: overviews, rows, sheets."""
        values = [row for row in self.rows if isinstance(row, Row)]
        times = [row for row in self.rows if isinstance(row, Distribution)]
        made = list(self.overviews)
        if values:
            made.append(table(self.title, values, self.grouped))
        if times:
            made.append(distribution.table(self.title, times))
        return [*made, *(sheet.table() for sheet in self.sheets)]

    def document(self) -> dict[str, object]:
        """Give what the JSON file says of rows, sheets and notes."""
        return {
            "rows": [row.row() for row in (*self.rows, *self.details)],
            **{sheet.name: list(sheet.rows) for sheet in self.sheets},
            "notes": list(self.notes),
        }


def table(title: str, rows: Sequence[Row], grouped: bool = False) -> Table:
    """Make the table of measured values for the terminal; ``grouped``: a case is named once, above its rows."""
    made = Table(title=title, title_justify="left")
    heads = ["", "case", "value", "unit", "goal", "verdict", "note"]
    if grouped:
        heads.remove("case")
    for head in heads:
        made.add_column(head, justify="right" if head == "value" else "left", overflow="fold")
    before = None
    for row in rows:
        verdict = "" if row.holds is None else "holds" if row.holds else "FAILS"
        cells = [row.name, row.case, f"{row.value:.4g}", row.unit, row.goal, verdict, row.note]
        if grouped:
            if row.case != before:
                made.add_section()
                made.add_row(f"[bold]{row.case}[/bold]")
            del cells[1]
            before = row.case
        made.add_row(*cells)
    return made
