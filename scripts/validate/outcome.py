"""The result of one validation: measured values beside their goals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from rich.table import Table


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
class Outcome:
    """All rows of a validation and what has to be said about them.

    ``details`` are rows for the file alone, where they are too many for a terminal; ``sheets`` are shown instead.
    """

    title: str
    rows: Sequence[Row]
    notes: Sequence[str] = field(default_factory=tuple)
    details: Sequence[Row] = field(default_factory=tuple)
    sheets: Sequence[Table] = field(default_factory=tuple)
    grouped: bool = False
    """Name a case once, above all its rows that follow one another."""

    @property
    def holds(self) -> bool:
        """Tell whether every row with a goal meets it."""
        return all(row.holds is not False for row in (*self.rows, *self.details))


def table(outcome: Outcome) -> Table:
    """Make the table for the terminal."""
    made = Table(title=outcome.title, title_justify="left")
    heads = ["", "case", "value", "unit", "goal", "verdict", "note"]
    if outcome.grouped:
        heads.remove("case")
    for head in heads:
        made.add_column(head, justify="right" if head == "value" else "left", overflow="fold")
    before = None
    for row in outcome.rows:
        verdict = "" if row.holds is None else "holds" if row.holds else "FAILS"
        cells = [row.name, row.case, f"{row.value:.4g}", row.unit, row.goal, verdict, row.note]
        if outcome.grouped:
            if row.case != before:
                made.add_section()
                made.add_row(f"[bold]{row.case}[/bold]")
            del cells[1]
            before = row.case
        made.add_row(*cells)
    return made
