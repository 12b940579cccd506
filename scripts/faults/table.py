"""Rows as a table: on the terminal, and in the documentation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from faults.judge import Peaks, Row
from phil_base.atomic import write_text

BEGIN, END = "<!-- faults: begin (made by scripts/faults.sh --update-docs) -->", "<!-- faults: end -->"
HEAD = ("fault", "the drive", "safe after s", "mm", "m/s", "N", "A", "late", "reported", "bag", "re-arm", "")


def cells(row: Row) -> tuple[str, ...]:
    """Give a row's texts in the order of `HEAD`."""
    safe = "" if row.safe_after is None else f"{row.safe_after:.2f}"
    verdict = "ok" if row.ok else "FAILED: " + "; ".join(row.failures)
    if row.tries > 1:
        verdict += f" (ride {row.tries})"
    return (
        row.title,
        row.ended,
        safe,
        *_peaks(row.peaks),
        str(row.late),
        "; ".join(row.reported),
        row.bag,
        row.rejoined,
        verdict,
    )


def _peaks(peaks: Peaks | None) -> tuple[str, ...]:
    if peaks is None:
        return ("", "", "", "")
    return (f"{peaks.position * 1e3:.0f}", f"{peaks.speed:.2f}", f"{peaks.force:.0f}", f"{peaks.current:.1f}")


def table(rows: Sequence[Row]) -> Table:
    """Make the table for the terminal."""
    made = Table(title="Faults done to a ride in real time", title_justify="left", show_lines=True)
    right = ("safe after s", "mm", "m/s", "N", "A", "late")
    for head in HEAD:
        made.add_column(head, justify="right" if head in right else "left", no_wrap=head in right)
    for row in rows:
        made.add_row(*cells(row), style=None if row.ok else "red")
    return made


def markdown(rows: Sequence[Row]) -> str:
    """Make the table of the documentation."""
    head = (*HEAD[:-1], "verdict")
    lines = [_line(head), _line(["---"] * len(head))]
    lines += [_line([cell.replace("|", "\\|").replace("\n", " ") for cell in cells(row)]) for row in rows]
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def update(document: Path, rows: Sequence[Row], foot: str) -> None:
    """Put the table between the markers of a document.

    Raises
    ------
    ValueError
        The document has no such markers.
    """
    text = document.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise ValueError(f"{document} has no lines '{BEGIN}' and '{END}'")
    before, rest = text.split(BEGIN, 1)
    after = rest.split(END, 1)[1]
    write_text(document, f"{before}{BEGIN}\n\n{markdown(rows)}\n\n{foot}\n\n{END}{after}")
