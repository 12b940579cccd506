"""What a bench hands back: distributions, further tables, remarks, pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from bench.distribution import Distribution

Samples = dict[str, NDArray[np.float64]]


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
    """All that was measured."""

    title: str
    rows: list[Distribution]
    samples: Samples
    """Times in s, by name, for the picture of the distributions."""
    sheets: list[Sheet] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    pictures: dict[str, Callable[[Path], None]] = field(default_factory=dict)
    """Further pictures: end of the file's name, and what draws it into a file."""
