"""Command line of a ride."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from phil_base.command_line import Parser, path, real, whole
from phil_base.workspace import workspace
from phil_loop.shortcuts import SHORTCUTS

EXAMPLES = (
    "scripts/run.sh",
    "scripts/run.sh --speed-kmh 200 --duration 30 --pantograph en50318",
    "scripts/run.sh --line alternating_spans",
    "scripts/run.sh --line my_line.yaml --mode realtime",
    "scripts/run.sh --composed",
    "scripts/run.sh --set impedance_mpc.control=integrated --out rides/without-correction",
)
"""Command lines that the help shows; `my_line.yaml` is a file of the user's."""


@dataclass(frozen=True)
class Options:
    """What was asked for: ``overrides`` (node to dotted parameter to value) beat ``params``, and those ``rig``."""

    out: Path
    params: tuple[Path, ...]
    rig: str | None
    overrides: dict[str, dict[str, Any]]
    bag: bool
    report: bool
    overwrite: bool
    ordinary_scheduling: bool
    composed: bool = False


def parse(argv: Sequence[str] | None = None) -> Options:
    """Read the command line; ends the process with code 2 and a message if it is wrong."""
    parser = Parser(
        prog="scripts/run.sh",
        description="Emulate a train ride: catenary, impedance controller, test rig and monitor in four processes "
        "or in one, recorded into a bag, with a report at the end.",
        epilog="Examples: " + "   |   ".join(EXAMPLES),
    )
    add = parser.add_argument
    add("--speed-kmh", type=real, metavar="V", help="speed of the train in km/h (catenary_model.speed_kmh)")
    add("--line", metavar="NAME_OR_PATH", help="overhead line: a preset or a YAML file (catenary_model.line)")
    add("--discretisation", metavar="KIND", help="of the catenary: fe or fd (catenary_model.discretisation)")
    add("--duration", type=real, metavar="S", help="length of the ride in s, 0: until Ctrl-C (test_rig_sim.duration)")
    add("--mode", choices=("lockstep", "realtime"), help="wait for each other, or follow the clock (test_rig_sim.mode)")
    add("--pantograph", metavar="NAME", help="unit under test (test_rig_sim.pantograph)")
    add("--seed", type=whole, metavar="N", help="seed of the measurement noise (test_rig_sim.seed)")
    add("--rig", metavar="NAME", help="test rig: ideal, nominal or harsh, with the model identified on it (nominal)")
    add(
        "--params",
        type=path,
        action="append",
        default=[],
        metavar="FILE",
        help="ROS parameter file for all nodes together; may be given again, later ones win",
    )
    add("--set", action="append", default=[], metavar="NODE.KEY=VALUE", help="one parameter; may be given again")
    add("--out", type=path, metavar="DIR", help="where bag, report and figures go (rides/DATE-TIME)")
    add("--overwrite", action="store_true", help="replace a ride that is already in DIR")
    add("--no-bag", action="store_true", help="record nothing: no report either, only the monitor's last figures")
    add("--no-report", action="store_true", help="record, but make no report (scripts/analyze.sh makes it later)")
    add(
        "--ordinary-scheduling",
        action="store_true",
        help="do not ask for real-time scheduling (SCHED_FIFO), which is used where the system allows it "
        "(real_time.scheduling = ordinary in all nodes)",
    )
    add(
        "--composed",
        action="store_true",
        help="the four nodes in one process, which hands their messages over itself: the same numbers and topics, "
        "sooner in lockstep; if one of them fails all end",
    )
    given = parser.parse_args(argv)

    overrides = overrides_of(given.set, parser)
    for option, (node, key) in SHORTCUTS.items():
        value = getattr(given, option)
        if value is not None:
            overrides.setdefault(node, {})[key] = value
    out = given.out or workspace() / "rides" / f"{datetime.now():%Y%m%d-%H%M%S}"
    return Options(
        out=out.absolute(),
        params=tuple(given.params),
        rig=given.rig,
        overrides=overrides,
        bag=not given.no_bag,
        report=not (given.no_bag or given.no_report),
        overwrite=given.overwrite,
        ordinary_scheduling=given.ordinary_scheduling,
        composed=given.composed,
    )


def overrides_of(entries: Sequence[str], parser: argparse.ArgumentParser) -> dict[str, dict[str, Any]]:
    """Give what ``--set`` says, node to parameter to value; the parser leaves with a line if it is wrong."""
    found: dict[str, dict[str, Any]] = {}
    for entry in entries:
        target, separator, text = entry.partition("=")
        node, dot, key = target.partition(".")
        if not (separator and dot and node and key):
            parser.error(f"--set {entry}: the form is NODE.KEY=VALUE")
        found.setdefault(node, {})[key] = _value(text, parser)
    return found


def _value(text: str, parser: argparse.ArgumentParser) -> Any:
    # Imported only here: --help has to answer before anything is installed.
    from phil_base.yaml_file import YamlError, parse_yaml

    try:
        return parse_yaml(text)
    except YamlError as error:
        parser.error(f"--set: '{text}' {error}")
