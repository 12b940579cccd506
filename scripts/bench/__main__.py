"""Entry point of ``scripts/bench.sh``: how long things take on this machine, as distributions."""

from __future__ import annotations

import argparse
import gc
import platform
import sys
from collections.abc import Sequence

from bench.realtime.options import RealtimeOptions, WrongUse, add_options, options_from
from bench.rides import options as rides_options
from bench.rides.options import RidesOptions
from phil_base.command_line import Parser, path, write_json

WRONG, FAILED, INTERRUPTED = 2, 3, 130
NAMES = ("catenary", "lines", "mpc", "realtime", "rides")

WIDTH = 132
"""Columns of the tables where there is no terminal."""


def arguments(argv: Sequence[str] | None = None) -> tuple[argparse.Namespace, RealtimeOptions, RidesOptions]:
    """Read the command line; ends the process with code 2 if it is wrong, before anything is measured."""
    parser = Parser(prog="scripts/bench.sh", description=__doc__)
    parser.add_argument("name", choices=NAMES, help="what to measure")
    parser.add_argument("--json", type=path, metavar="FILE", help="write the figures there")
    parser.add_argument("--out", type=path, metavar="DIR", help="draw the distributions there")
    parser.add_argument("--quick", action="store_true", help="few samples: only to see that it works")
    add_options(parser)
    rides_options.add_options(parser)
    given = parser.parse_args(argv)
    riding, rides = options_from(parser, given), rides_options.options_from(parser, given)
    if riding.parameters and riding.against is None:  # another revision may have other parameters
        from ride.beforehand import refusal

        if refused := refusal(parser, riding.parameters, "realtime", riding.cycle_time):
            print(refused, file=sys.stderr)
            sys.exit(WRONG)
    parser.check_places(given.json, given.out)
    return given, riding, rides


def main() -> int:
    """Measure, print, write; 0 unless the measurement itself failed (3): speed is told, not tested."""
    given, riding, rides = arguments()

    from rich.console import Console

    from bench.benches import BENCHES
    from bench.distribution import picture, table

    gc.disable()
    if given.name in ("realtime", "rides"):
        from bench.realtime.against import AgainstError
        from bench.realtime.disturbance import DisturbanceError
        from bench.realtime.run import run
        from bench.realtime.session import MeasuringError
        from bench.rides.run import run as run_rides

        try:
            outcome = run(riding, given.out) if given.name == "realtime" else run_rides(rides, given.quick)
        except WrongUse as error:
            print(error, file=sys.stderr)
            return WRONG
        except (AgainstError, DisturbanceError, MeasuringError) as error:
            print(f"nothing was measured: {error}", file=sys.stderr)
            return FAILED
    else:
        outcome = BENCHES[given.name](given.quick)
    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    console.print(table(outcome.title, outcome.rows))
    for sheet in outcome.sheets:
        console.print(sheet.table())
    for note in outcome.notes:
        console.print(f"- {note}", highlight=False, markup=False)
    written = True
    if given.json:
        machine = {"machine": platform.machine(), "python": platform.python_version(), "quick": given.quick}
        document = {
            "name": given.name,
            "title": outcome.title,
            **machine,
            "rows": [row.row() for row in outcome.rows],
            **{sheet.name: list(sheet.rows) for sheet in outcome.sheets},
            "notes": outcome.notes,
        }
        written = write_json(given.json, document)
    if given.out:
        picture(outcome.title, outcome.samples, given.out / f"bench-{given.name}.png")
        for name, draw in outcome.pictures.items():
            draw(given.out / f"bench-{given.name}-{name}.png")
    return 0 if written else FAILED


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
