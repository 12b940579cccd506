"""Entry point of ``scripts/bench.sh``: how long things take on this machine, as distributions."""

from __future__ import annotations

import argparse
import gc
import importlib
import sys
from collections.abc import Sequence

from bench.realtime.options import RealtimeOptions, WrongUse, add_options, options_from
from bench.rides import options as rides_options
from bench.rides.options import RidesOptions
from phil_base.command_line import Parser
from phil_study import command

NAMES = ("catenary", "lines", "mpc", "realtime", "rides")


def parser() -> Parser:
    """Describe the options."""
    made = command.parser(
        "scripts/bench.sh",
        __doc__,
        NAMES,
        name="what to measure",
        out="draw the distributions there",
        quick="few samples: only to see that it works",
    )
    add_options(made)
    rides_options.add_options(made)
    return made


def arguments(argv: Sequence[str] | None = None) -> tuple[argparse.Namespace, RealtimeOptions, RidesOptions]:
    """Read the command line; ends the process with code 2 if it is wrong, before anything is measured."""
    options = parser()
    given = options.parse_args(argv)
    riding, rides = options_from(options, given), rides_options.options_from(options, given)
    if riding.parameters and riding.against is None:  # another revision may have other parameters
        from ride.beforehand import refusal

        if refused := refusal(options, riding.parameters, "realtime", riding.cycle_time):
            print(refused, file=sys.stderr)
            sys.exit(command.WRONG)
    options.check_places(given.json, given.out)
    return given, riding, rides


def main() -> int:
    """Measure, print, write; 0 unless the measurement itself failed (3): speed is told, not tested."""
    given, riding, rides = arguments()

    from phil_study.outcome import Outcome

    gc.disable()
    if given.name in ("realtime", "rides"):
        from bench.realtime.against import AgainstError
        from bench.realtime.disturbance import DisturbanceError
        from bench.realtime.run import run
        from bench.realtime.session import MeasuringError
        from bench.rides.run import run as run_rides

        try:
            outcome: Outcome = run(riding, given.out) if given.name == "realtime" else run_rides(rides, given.quick)
        except WrongUse as error:
            print(error, file=sys.stderr)
            return command.WRONG
        except (AgainstError, DisturbanceError, MeasuringError) as error:
            print(f"nothing was measured: {error}", file=sys.stderr)
            return command.FAILED
    else:
        outcome = importlib.import_module(f"bench.{given.name}").run(given.quick)
    command.show(outcome, command.console())
    return 0 if command.write(outcome, given, "bench", judged=False) else command.FAILED


if __name__ == "__main__":
    command.end(main)
