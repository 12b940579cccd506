"""The doctor's tables on the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.markup import escape
from rich.table import Table

from doctor.finding import CHANGE, NOTE, Finding
from doctor.wake_up import EDGES, WakeUps

COLOURS = {CHANGE: "red", NOTE: "yellow"}


def findings_table(findings: Iterable[Finding]) -> Table:
    """Make the table of everything that was looked at."""
    made = Table(title="This machine, for a ride at 500 Hz in real time", title_justify="left")
    for head in ("", "found", "verdict", "because"):
        made.add_column(head)
    for found in findings:
        colour = COLOURS.get(found.verdict, "green")
        verdict = f"[{colour}]{found.verdict}[/]"
        made.add_row(found.name, escape(found.value), verdict, escape(found.why))
    return made


def wake_up_table(rows: Sequence[tuple[str, WakeUps]]) -> Table:
    """Make the table of the latencies; each row with who measured it. Heights of the histogram are logarithmic."""
    title = f"Wake-ups at 1 kHz: late by ms; histogram from {EDGES[0] * 1e6:g} us to {EDGES[-1]:g} s"
    made = Table(title=title, title_justify="left")
    for head in ("measured by", "scheduling", "CPU"):
        made.add_column(head)
    for head in ("median", "p99", "p99.9", "max"):
        made.add_column(head, justify="right")
    made.add_column("histogram", no_wrap=True)
    for who, row in rows:
        figures = [f"{value * 1e3:.3f}" for value in row.figures().values()]
        made.add_row(who, row.scheduling, row.cpu, *figures, row.line())
    return made


def advice(findings: Iterable[Finding]) -> list[str]:
    """Give what to type, one line for each thing; what stands against a ride first."""
    order = {CHANGE: 0, NOTE: 1}
    wanted = sorted((found for found in findings if found.do), key=lambda found: order.get(found.verdict, 2))
    return [f"{found.verdict}, {found.name}: {found.do}" for found in wanted]
