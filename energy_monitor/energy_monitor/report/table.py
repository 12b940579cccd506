"""The report in short, for a terminal."""

from __future__ import annotations

from rich import box
from rich.table import Table
from rich.text import Text

from energy_monitor.report.results import TRUTH, Report, Verdict, number

_MARKS = {True: ("holds", "green"), False: ("FAILS", "bold red"), None: ("open", "yellow")}


def mark(verdict: Verdict) -> tuple[str, str]:
    """Give the word for a verdict and its colour."""
    if verdict.binding:
        return _MARKS[verdict.ok]
    return {True: "(holds)", False: "(fails)", None: "(open)"}[verdict.ok], "dim"


def summary_table(report: Report) -> Table:
    """Make a table of the verdicts with a line of key figures below."""
    ride, force = report.ride, report.contact_force
    table = Table(
        title=f"ride at {ride.speed * 3.6:.0f} km/h, {ride.simulated_time:.2f} s: {'ok' if report.ok else 'NOT ok'}",
        title_justify="left",
        title_style="bold",
        caption=_caption(report),
        caption_justify="left",
        box=box.SIMPLE_HEAD,
    )
    table.add_column("")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("limit", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    for verdict in report.verdicts:
        word, style = mark(verdict)
        table.add_row(Text(verdict.name), _with_unit(verdict), verdict.limit, Text(word, style=style))
    table.add_section()
    table.add_row("Contact force, mean ± 3 sigma", f"{number(force.mean)} ± {number(3.0 * force.sigma, 3)} N")
    table.add_row("Contact force, extremes", f"{number(force.minimum, 3)} to {number(force.maximum, 3)} N")
    table.add_row("Energy exchanged", f"{number(report.conservation.exchanged_energy)} J")
    table.add_row("Simulated over wall time", number(ride.speed_factor, 3))
    # In lockstep everybody waits for everybody: a cycle takes as long as it takes.
    lockstep = report.parameters.get("test_rig_sim", {}).get("mode") == "lockstep"
    for entry in report.timing:
        if entry.late and not lockstep:
            of_rig = entry.node == "test_rig_sim"
            label = "Late commands" if of_rig else f"Cycles over {entry.budget * 1e3:g} ms, {entry.node}"
            table.add_row(label, str(entry.late))
    if refused := sum(entry.refused for entry in report.timing):
        table.add_row("Messages refused", str(refused))
    return table


def _with_unit(verdict: Verdict) -> str:
    unit = "" if verdict.unit == TRUTH or verdict.value is None else verdict.unit
    return f"{verdict.found} {unit}".rstrip()


def _caption(report: Report) -> Text | None:
    lines = list(report.notes)
    if report.warnings:
        lines.append(f"Different warnings on /diagnostics: {len(report.warnings)}, see the report.")
    return Text("\n".join(lines)) if lines else None
