"""Entry point of ``scripts/bench.sh``: how long things take on this machine, as distributions."""

from __future__ import annotations

import argparse
import gc
import json
import platform
import sys
from pathlib import Path

from bench.realtime.options import WrongUse, add_options, options_from

WRONG, FAILED, INTERRUPTED = 2, 3, 130
NAMES = ("catenary", "lines", "mpc", "realtime")

WIDTH = 132
"""Columns of the tables where there is no terminal."""


def main() -> int:
    """Measure, print, write; 0 unless the measurement itself failed (3): speed is told, not tested."""
    parser = argparse.ArgumentParser(prog="scripts/bench.sh", description=__doc__)
    parser.add_argument("name", choices=NAMES, help="what to measure")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument("--out", type=Path, metavar="DIR", help="draw the distributions there")
    parser.add_argument("--quick", action="store_true", help="few samples: only to see that it works")
    add_options(parser)
    given = parser.parse_args()
    riding = options_from(parser, given)
    try:
        if given.json:
            given.json.touch()
        if given.out:
            given.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"{error.filename} cannot be written: {error.strerror}")

    from rich.console import Console

    from bench.benches import BENCHES
    from bench.distribution import picture, table

    gc.disable()
    if given.name == "realtime":
        from bench.realtime.against import AgainstError
        from bench.realtime.disturbance import DisturbanceError
        from bench.realtime.run import run
        from bench.realtime.session import MeasuringError

        try:
            outcome = run(riding, given.out)
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
        given.json.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    if given.out:
        picture(outcome.title, outcome.samples, given.out / f"bench-{given.name}.png")
        for name, draw in outcome.pictures.items():
            draw(given.out / f"bench-{given.name}-{name}.png")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
