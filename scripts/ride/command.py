"""What ``scripts/run.sh`` does once its options are read: check, ride, report."""

from __future__ import annotations

import os
from pathlib import Path

from rich.console import Console

from energy_monitor.beliefs import remark
from phil_base import clear_words
from phil_base.parameters import ParameterError
from phil_node.surroundings import reach
from ride.checks import notices
from ride.folder import clear
from ride.options import Options
from ride.settings import Settings, as_ordinary, line_text, pantograph_text, resolve, write

OK, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130


def carry_out(options: Options) -> int:
    """Ride; give the exit code: 0 good, 1 failed or a verdict does not hold, 2 wrong options, 130 interrupted."""
    settings = prepared(options)
    return WRONG if settings is None else _ride_and_report(options, settings, Console(), _errors())


def _errors() -> Console:
    return Console(stderr=True, highlight=False, soft_wrap=True, markup=False)


def prepared(options: Options) -> Settings | None:
    """Check everything and make the ride's folder, before anything is started; None, and said, if it cannot be."""
    errors = _errors()
    try:
        overrides = as_ordinary(options.overrides) if options.ordinary_scheduling else options.overrides
        settings = resolve(options.params, overrides, options.rig)
        line, pantograph = line_text(settings), pantograph_text(settings)
        said = notices(options.params, settings)
    except ParameterError as error:
        errors.print(str(error))
        return None
    try:
        if not clear(options.out, options.overwrite):
            errors.print(clear_words.clear(f"{options.out} already holds a ride: choose another --out, or --overwrite"))
            return None
        options.out.mkdir(parents=True, exist_ok=True)
        write(settings, line, options.out, pantograph)
    except OSError as error:
        errors.print(clear_words.clear(f"--out {options.out} cannot be written: {error.strerror}"))
        return None
    for notice in (*said, *filter(None, [reach(os.environ)])):
        errors.print(f"note: {notice}")
    return settings


def _ride_and_report(options: Options, settings: Settings, console: Console, errors: Console) -> int:
    # The middleware is loaded only now, so that --help and wrong parameters answer at once.
    from ride.lifecycle import RideError
    from ride.session import Ride, RideInterrupt
    from ride.summary import live_summary

    train, rig = settings["catenary_model"], settings["test_rig_sim"]
    what = f"{train['speed_kmh']:g} km/h, line {train['line']}, pantograph {rig['pantograph']}"
    what += f", {rig['mode']}, seed {rig['seed']}"
    console.print(f"{what} -> {options.out}", highlight=False, soft_wrap=True)
    if doubt := remark(settings):
        console.print(doubt, style="yellow", highlight=False, soft_wrap=True)
    ride = Ride(settings, options, console)
    code = OK
    try:
        ride.run()
    except RideError as error:
        errors.print(f"the ride failed: {error}")
        errors.print(f"logs: {options.out / 'logs'}")
        code = FAILED
    except RideInterrupt:
        code = INTERRUPTED
    except OSError as error:  # a full disk already at the start
        errors.print(f"the ride failed: {error.filename or options.out}: {error.strerror or error}")
        code = FAILED
    if options.report and ride.bag_path.exists() and ride.watch is not None and ride.watch.cycle >= 0:
        verdict = _report(ride.bag_path, options.out, console, errors)
        code = code or verdict
    elif ride.watch is not None and ride.watch.cycle >= 0:
        console.print(live_summary(ride.watch, ride.seconds))
    return code


def _report(bag: Path, out: Path, console: Console, errors: Console) -> int:
    from energy_monitor.report import ReportError, summary_table, write_report

    try:
        report = write_report(bag, out, params=out / "params.yaml")
    except ReportError as error:
        errors.print(f"no report: {error}")
        return FAILED
    console.print(summary_table(report))
    console.print(f"report: {out / 'report.html'}", highlight=False, soft_wrap=True)
    return OK if report.ok else FAILED
