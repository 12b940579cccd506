"""Everything from a bag to the files of its report."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from energy_monitor.analysis import Settings, analyse
from energy_monitor.bag import Bag, BagError, read_bag
from energy_monitor.bag_folder import base_name
from energy_monitor.limits import LimitsError
from energy_monitor.report.document import document_text
from energy_monitor.report.results import Report
from energy_monitor.report.ride_parameters import parameters_of
from energy_monitor.report.verdicts import STANDARD, Limits, read_limits
from phil_base.atomic import together, write_text
from phil_base.clear_words import clear
from phil_base.parameters import ParameterError, defaults

SOFTWARE = ("numpy", "scipy", "numba", "daqp", "rosbags", "matplotlib", "jinja2", "pydantic")


class ReportError(Exception):
    """No report can be made; the text is one line that says why."""

    def __init__(self, text: str) -> None:
        super().__init__(clear(" ".join(text.split())))


def write_report(
    bag_path: Path | str,
    out_dir: Path | str | None = None,
    params: Path | str | None = None,
    *,
    limits: Path | str | None = None,
    run_in: float | None = None,
    html: bool = True,
    json_file: Path | str | None = None,
    namespace: str | None = None,
    ride: int | None = None,
) -> Report:
    """Analyse a bag and write report.json, report.html, ride.png and figures/*.png.

    `out_dir` is by default the ride's folder, or a folder beside the bag. `params` (by default params.yaml beside the
    bag) is the parameter file of the ride, `limits` overrides single limits of the verdicts, `run_in` in s what the
    statistics leave out, `json_file` the place of report.json ("-": standard output). `html` False leaves out page and
    figures. `namespace` and `ride` choose where a bag holds several rides. A file appears when it is whole: what
    interrupts the work leaves an earlier report as it was.

    Raises
    ------
    ReportError
        The bag, the parameter file or the limits cannot be used, or the files cannot be written.
    """
    try:
        bag = read_bag(bag_path, namespace=namespace)
        file = parameter_file(bag, params)
        parameters = parameters_of(file, bag) if file else {}
        monitor = monitor_of(parameters)
        report = analyse(
            bag,
            settings_of(monitor, run_in),
            limits_of(monitor, limits),
            parameters=parameters,
            versions=versions(),
            ride=ride,
        )
        out = Path(out_dir) if out_dir else default_folder(bag)
        del bag  # what the report does not hold of it makes room for the pictures
        if html or not json_file:
            out.mkdir(parents=True, exist_ok=True)
        if html:
            _write_pictures(report, out)
        if str(json_file) == "-":
            sys.stdout.write(document_text(report))
            sys.stdout.flush()
        else:
            write_text(Path(json_file) if json_file else out / "report.json", document_text(report))
    except (BagError, ParameterError, LimitsError) as error:
        raise ReportError(str(error)) from error
    except OSError as error:
        named = error.filename or ("standard output" if str(json_file) == "-" else out_dir or "the report")
        raise ReportError(f"{named}: {error.strerror or error}") from error
    return report


def _write_pictures(report: Report, out: Path) -> None:
    """Make page and figures in a folder of their own, then put them in place."""
    # matplotlib takes half a second to load, which a mere check of the numbers does not need.
    from energy_monitor.report.figures import draw_all
    from energy_monitor.report.html import write_page

    with together(out) as drafts:
        figures = draw_all(report, drafts)
        write_page(report, figures, drafts / "report.html")
        (drafts / "figures").mkdir()
        for figure, file in figures.items():
            file.replace(drafts / "ride.png" if figure == "ride" else drafts / "figures" / file.name)


def parameter_file(bag: Bag, given: Path | str | None) -> Path | None:
    """Find the ride's parameters: the file that is named, else params.yaml in the bag's folder or beside it."""
    if given is not None:
        return Path(given)
    folders = [bag.path, bag.path.parent] if bag.path.is_dir() else [bag.path.parent, bag.path.parent.parent]
    return next((folder / "params.yaml" for folder in folders if (folder / "params.yaml").is_file()), None)


def default_folder(bag: Bag) -> Path:
    """Choose where the report goes: the ride's folder if params.yaml shows it to be one, else beside the bag."""
    if (bag.path.parent / "params.yaml").is_file():
        return bag.path.parent
    folder, name = base_name(bag.path)
    return folder / f"{name}_report"


def monitor_of(parameters: Mapping[str, Mapping[str, Any]]) -> Mapping[str, Any]:
    """Give the monitor's parameters of the ride, completed by the package's defaults, by flat name."""
    return {**_defaults(), **parameters.get("energy_monitor", {})}


def settings_of(monitor: Mapping[str, Any], run_in: float | None) -> Settings:
    """Evaluate as the monitor of the ride did; `run_in` in s overrides its run-in."""
    usual = Settings()
    return Settings(
        run_in=float(monitor.get("contact.run_in", usual.run_in)) if run_in is None else run_in,
        loss_threshold=float(monitor.get("contact.loss_threshold", usual.loss_threshold)),
        cutoff=float(monitor.get("contact.cutoff", usual.cutoff)),
        order=int(monitor.get("contact.order", usual.order)),
        loss_duration=float(monitor.get("contact.loss_duration", usual.loss_duration)),
    )


def limits_of(monitor: Mapping[str, Any], file: Path | str | None) -> Limits:
    """Read the limits; the standard and its table are those of the ride unless the limits name others.

    Raises
    ------
    LimitsError
        The file cannot be used.
    """
    limits = read_limits(file)
    return limits.model_copy(
        update={
            "standard": limits.standard or str(monitor.get("limits.standard", STANDARD)),
            "standard_file": limits.standard_file or str(monitor.get("limits.file", "")),
        }
    )


def _defaults() -> Mapping[str, Any]:
    try:
        return defaults("energy_monitor")
    except (ParameterError, OSError):
        return {}


def versions() -> dict[str, str]:
    """Name the software that made the report, with versions."""
    found = {"Python": platform.python_version()}
    for name in ("energy_monitor", *SOFTWARE):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found
