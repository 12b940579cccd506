"""Command line: make the report of a recorded ride."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from phil_base.command_line import MOST_DIGITS, UNUSABLE, Parser, path, seconds

OK, FAILED, INTERRUPTED = 0, 1, 130


def arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the command line."""
    parser = Parser(
        prog="scripts/analyze.sh",
        description="Make the report of a recorded ride: report.json, report.html, ride.png and figures.",
        epilog="Exit code: 0 every requirement holds, 1 one fails, 2 the bag or another input cannot be used, "
        "130 interrupted.",
    )
    add = parser.add_argument
    add(
        "bag", type=path, help="folder of a bag or of a ride, or a single .mcap or .db3 file, also one that was cut off"
    )
    add("--out", type=path, metavar="DIR", help="folder of the report (the ride's own, or BAG_report beside the bag)")
    add("--params", type=path, metavar="FILE", help="parameters that the ride ran with (params.yaml beside the bag)")
    add("--limits", type=path, metavar="FILE", help="YAML with limits of the verdicts that replace the usual ones")
    add("--run-in", type=seconds, metavar="S", help="seconds at the beginning that the statistics leave out")
    add("--namespace", metavar="NS", help="namespace of the ride's nodes, where the bag holds several")
    add("--ride", type=number, metavar="N", help="which ride, from 1, where the bag holds several (the last one)")
    add("--no-html", action="store_true", help="numbers only: neither page nor figures")
    add(
        "--json",
        type=path,
        metavar="FILE",
        help="where the numbers go (report.json in the report's folder); -: standard output, the summary then goes to "
        "standard error",
    )
    return parser.parse_args(argv)


def number(text: str) -> int:
    """Read the number of a ride, from 1.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no such number.
    """
    if not (text.isascii() and text.isdecimal() and len(text) <= MOST_DIGITS and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not the number of a ride (1, 2, ..)")
    return int(text)


def main(argv: Sequence[str] | None = None) -> int:
    """Make the report and print its summary; 0 every requirement holds, 1 one fails, 2 unusable input, 130 stopped."""
    options = arguments(argv)
    try:
        return _analyze(options)
    except KeyboardInterrupt:
        print("analyze: interrupted", file=sys.stderr)
        return INTERRUPTED


def _analyze(options: argparse.Namespace) -> int:
    import numpy as np
    from rich.console import Console

    from energy_monitor.report.table import summary_table
    from energy_monitor.report.write import ReportError, write_report

    try:
        # A damaged message may hold any number: what comes of it is in the report, and not in lines about overflow.
        with np.errstate(all="ignore"):
            report = write_report(
                options.bag,
                options.out,
                options.params,
                limits=options.limits,
                run_in=options.run_in,
                html=not options.no_html,
                json_file=options.json,
                namespace=options.namespace,
                ride=options.ride,
            )
    except ReportError as error:
        print(f"analyze: {error}", file=sys.stderr)
        return UNUSABLE
    Console(stderr=str(options.json) == "-").print(summary_table(report))
    return OK if report.ok else FAILED


if __name__ == "__main__":
    sys.exit(main())
