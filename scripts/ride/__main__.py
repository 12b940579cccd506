"""Entry point of ``scripts/run.sh``."""

from __future__ import annotations

import sys

from phil_node.parameters import ParameterError
from rich.console import Console

from ride.options import Options, parse
from ride.settings import resolve, write

OK, FAILED, WRONG, INTERRUPTED = 0, 1, 2, 130


def main() -> int:
    """Ride; give the exit code: 0 good, 1 failed or a verdict does not hold, 2 wrong options, 130 interrupted."""
    options = parse()
    console = Console()
    errors = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    try:
        settings = resolve(options.params, options.overrides)
    except ParameterError as error:
        errors.print(str(error))
        return WRONG
    if (options.out / "params.yaml").exists() and not options.overwrite:
        errors.print(f"{options.out} already holds a ride: choose another --out, or --overwrite")
        return WRONG
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        write(settings, options.out / "params.yaml")
    except OSError as error:
        errors.print(f"{options.out} cannot be written: {error.strerror}")
        return WRONG
    return _ride_and_report(options, settings, console, errors)


def _ride_and_report(options: Options, settings: dict[str, dict[str, object]], console: Console, errors: Console) -> int:
    # The middleware is loaded only now, so that --help and wrong parameters answer at once.
    from ride.lifecycle import RideError
    from ride.session import Interrupted, Ride

    train, rig = settings["catenary_model"], settings["test_rig_sim"]
    console.print(
        f"{train['speed_kmh']} km/h, pantograph {rig['pantograph']}, {rig['mode']}, seed {rig['seed']} -> {options.out}",
        highlight=False,
        soft_wrap=True,
    )
    ride = Ride(settings, options.out, options.bag, console)
    code = OK
    try:
        ride.run()
    except RideError as error:
        errors.print(f"the ride failed: {error}")
        errors.print(f"logs: {options.out / 'logs'}")
        code = FAILED
    except Interrupted:
        code = INTERRUPTED
    if options.report and ride.bag_path.exists():
        code = _report(ride, options, console, errors) if code == OK else (_report(ride, options, console, errors), code)[1]
    elif ride.watch is not None:
        from ride.summary import live_summary

        console.print(live_summary(ride.watch, ride.seconds))
    return code


def _report(ride: object, options: Options, console: Console, errors: Console) -> int:
    from energy_monitor.report import ReportError, summary_table, write_report

    try:
        report = write_report(ride.bag_path, options.out, params=options.out / "params.yaml")  # type: ignore[attr-defined]
    except ReportError as error:
        errors.print(f"no report: {error}")
        return FAILED
    console.print(summary_table(report))
    console.print(f"report: {options.out / 'report.html'}", highlight=False, soft_wrap=True)
    return OK if report.ok else FAILED


if __name__ == "__main__":
    sys.exit(main())
