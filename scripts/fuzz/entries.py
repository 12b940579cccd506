"""What reads each kind of file: the same functions, in the same order, as the commands that users type."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from fuzz.commands import command

Entry = Callable[[Path], int]
"""Takes the file or folder of a case; says on standard error what is wrong; gives the exit code that a user gets."""

WRONG = 2


def _refused(error: Exception) -> int:
    print(error, file=sys.stderr)
    return WRONG


def yaml(file: Path) -> int:
    """Everything that ``scripts/run.sh --params FILE`` does before a process is started."""
    from phil_base.parameters import ParameterError, read_file
    from ride.checks import notices
    from ride.options import parse
    from ride.settings import line_text, pantograph_text, resolve, write

    out = file.parent / "ride"
    options = parse(["--params", str(file), "--out", str(out)])
    try:
        settings = resolve(options.params, options.overrides, options.rig)
        line, pantograph = line_text(settings), pantograph_text(settings)
        said = notices(options.params, settings)
        out.mkdir()
        write(settings, line, out, pantograph)
        again = read_file(out / "params.yaml")
    except ParameterError as error:
        return _refused(error)
    for node, values in settings.items():
        values = values | {"line": again[node]["line"]} if "line" in values else values
        if "pantograph_file" in values:
            values = values | {"pantograph_file": again[node]["pantograph_file"]}
        assert again[node] == values, f"{node}: params.yaml gives another ride"
    for notice in said:
        print(f"note: {notice}", file=sys.stderr)
    return 0


def line(file: Path) -> int:
    """Read an overhead line, write it and read it back, and bring the catenary on it to rest."""
    from catenary_model.build import Config, build, check
    from catenary_model.line_file import LineFileError, dump_line, load_line, parse_line

    try:
        found = load_line(file)
    except LineFileError as error:
        return _refused(error)
    assert parse_line(dump_line(found), "again", found.name) == found, "the line that is written is another one"
    config = replace(Config(), line=found)
    try:
        check(config)
    except ValueError as error:
        print(f"{file}: {error}", file=sys.stderr)
        return WRONG
    if len(found.spans) < 50:  # the design of a longer one is the same
        model = build(config)
        model.step(100.0)
    return 0


def _rig(changes: dict[str, object]) -> int:
    """Build the parameters of a rig and what is designed from them, as a ride does before it starts."""
    from phil_base.parameters import ParameterError, build, defaults
    from ride.checks import check_builds
    from test_rig_sim.parameters import Parameters

    try:
        check_builds({"test_rig_sim": build(Parameters, defaults("test_rig_sim") | changes, "test_rig_sim")})
    except ParameterError as error:
        return _refused(error)
    return 0


def pantograph(file: Path) -> int:
    """Stand up the rig on a pantograph that a file describes."""
    return _rig({"pantograph": "state_space", "pantograph_file": str(file)})


def trajectory(file: Path) -> int:
    """Prepare the rig to follow a trajectory from a file."""
    return _rig({"operating_mode": "position", "trajectory.kind": "file", "trajectory.file": str(file)})


def limits(file: Path) -> int:
    """Read a table of contact-force limits and judge by every standard in it."""
    import numpy as np

    from energy_monitor.contact_quality import contact_quality_of
    from energy_monitor.limits import LimitsError, evaluate, load, verdict

    try:
        table = load(file)
    except LimitsError as error:
        return _refused(error)
    force = 100.0 + 30.0 * np.sin(np.arange(2000) * 0.05)
    statistics = contact_quality_of(force, 0.002, 2.0, 2.0)
    for standard in table.values():
        verdict(evaluate(standard, statistics, 250.0))
    return 0


def report_limits(file: Path) -> int:
    """Read the limits of a report, as ``scripts/analyze.sh --limits FILE`` does."""
    from energy_monitor.limits import LimitsError
    from energy_monitor.report.verdicts import read_limits

    try:
        read_limits(file)
    except LimitsError as error:
        return _refused(error)
    return 0


def report(folder: Path) -> int:
    """Make the report of the ride in a folder, without figures."""
    from energy_monitor.report.cli import main

    return main([str(folder), "--out", str(folder.parent / "report"), "--no-html"])


def recover(folder: Path) -> int:
    """Write the bag in a ride's folder anew, as ``scripts/record.sh --recover`` does."""
    from energy_monitor.record import main

    out = folder.parent / "recovered"
    try:
        return main(["--recover", str(folder), "--out", str(out)])
    finally:
        shutil.rmtree(out, ignore_errors=True)


ENTRIES: dict[str, Entry] = {
    entry.__name__: entry
    for entry in (yaml, line, pantograph, trajectory, limits, report_limits, report, recover, command)
}
