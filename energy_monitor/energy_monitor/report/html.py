"""The report as one HTML file that needs nothing else: figures inside, no script, no external resource."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from energy_monitor.report.results import Report, number, shown
from energy_monitor.report.table import mark
from phil_base.atomic import write_text

CAPTIONS: Mapping[str, str] = {
    "ride": "Overview: both wires with droppers and pantograph at one instant, and the 2.5 s around it.",
    "displacement": (
        "Displacement of the contact point from nominal height: contact wire of the catenary model (w_cat) and drive "
        "of the rig (w_tr), and their difference. Left the whole ride, right 2.5 s of it (shaded on the left). "
        "Compare thesis Fig. 3.15, upper plot."
    ),
    "contact_force": (
        "Contact force as measured, and low-passed at 20 Hz as EN 50317 asks, with its mean and mean ± 3σ after the "
        "run-in. The green band is the range of the standard for the mean force at this speed. Compare thesis "
        "Fig. 3.15, middle plot."
    ),
    "spectrum": (
        "Power spectral density of the measured contact force after the run-in (Welch, Hann windows of 4.1 s with "
        "half overlap), with the frequencies at which spans and droppers pass. Compare thesis Fig. 3.15, lower plot."
    ),
    "conservation": (
        "Error of the energy, eq. (3.46), and of the momentum, eq. (3.47), exchanged on both sides: by "
        "sums at the cycle rate, and by the work and impulse that rig and catenary accumulated between their samples; "
        "the broad lines recomputed from the recorded states, the thin ones as monitor and controller kept both books."
    ),
    "correction": "Correction force F_cor between the bounds that were enforced, eq. (3.49) with cap and dead zone.",
    "wires": (
        "Above: carrier and contact wire with droppers coloured by their force (slack ones dashed with a hollow "
        "mark), masts in grey, the pantograph out of scale. Below: displacement of the contact wire over place and "
        "time."
    ),
    "timing": "Turnaround of each node, wall clock; both axes logarithmic. Differs from run to run.",
}
"""Captions by figure, in the order of the page."""


def write_page(report: Report, figures: Mapping[str, Path], path: Path) -> Path:
    """Write the page with the given PNG figures embedded."""
    write_text(path, page(report, figures))
    return path


def page(report: Report, figures: Mapping[str, Path]) -> str:
    """Render the page."""
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["number"] = number
    environment.filters["mark"] = mark
    template = environment.from_string(_resource("page.html.j2"))
    pictures = [(name, caption, _embedded(figures[name])) for name, caption in CAPTIONS.items() if name in figures]
    tables = [
        ("Ride", shown(report.ride)),
        ("Motion of the rig", shown(report.tracking)),
        ("Contact force", shown(report.contact_force)),
        ("Energy and momentum", shown(report.conservation)),
        ("Correction force", shown(report.correction)),
        ("Optimisation", shown(report.solver)),
        ("Catenary", shown(report.catenary)),
    ]
    return template.render(
        report=report,
        style=Markup(_resource("page.css")),  # our own file: nothing in it comes from a bag
        pictures=pictures,
        tables=[(title, list(rows)) for title, rows in tables],
        failed=[verdict for verdict in report.verdicts if verdict.binding and verdict.ok is False],
        title=f"Ride at {report.ride.speed * 3.6:.0f} km/h",
    )


def _embedded(file: Path) -> str:
    return "data:image/png;base64," + b64encode(file.read_bytes()).decode("ascii")


def _resource(name: str) -> str:
    return files("energy_monitor.report").joinpath(name).read_text(encoding="utf-8")
