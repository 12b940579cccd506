"""Entry point of ``scripts/doctor.sh``: what of this machine stands against a ride in real time, and what to type."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from phil_base.command_line import Parser, path, real, write_json
from phil_base.workspace import workspace

GOOD, BAD, FAILED, INTERRUPTED = 0, 1, 3, 130
GOOD_WORDS = "nothing stands against a ride in real time at 500 Hz"
WIDTH = 160
"""Columns of the tables where there is no terminal."""
LAST_DOMAIN = 232


def parser() -> Parser:
    """Make the command line."""
    made = Parser(
        prog="scripts/doctor.sh",
        description="Look at this machine: kernel, limits, processors, memory, disk, network, who else is on the ROS "
        "domain, and how late a sleeping thread wakes up; say what to change, in the words to type.",
        epilog="Exit code: 0 nothing stands against a ride in real time at 500 Hz, 1 something does, 2 wrong use.",
    )
    made.add_argument("--json", type=path, metavar="FILE", help="write everything there")
    made.add_argument("--seconds", type=_seconds, default=10.0, metavar="S", help="length of each measurement (10)")
    made.add_argument("--domain", type=_domain, metavar="N", help="ROS domain to look at ($ROS_DOMAIN_ID, or 0)")
    made.add_argument("--bags", type=path, default=workspace() / "rides", metavar="DIR", help="folder for bags (rides)")
    return made


def _seconds(text: str) -> float:
    if not 0.1 <= (value := real(text)) <= 3600.0:
        raise argparse.ArgumentTypeError(f"'{text}' is not allowed: a number from 0.1 to 3600 s")
    return value


def _domain(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 9) or int(text) > LAST_DOMAIN:
        raise argparse.ArgumentTypeError(f"'{text}' is not allowed: a whole number from 0 to {LAST_DOMAIN}")
    return int(text)


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command line; ends the process with code 2 if it is wrong, before anything is looked at."""
    made = parser()
    given = made.parse_args(argv)
    made.check_places(given.json)
    return given


def main() -> int:
    """Look, measure, print, write."""
    given = arguments()
    if given.domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(given.domain)

    from rich.console import Console

    from doctor.examination import examine
    from doctor.finding import CHANGE
    from doctor.sheet import advice, findings_table, wake_up_table

    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    examined = examine(given.seconds, given.bags.absolute(), Console(stderr=True))
    console.print(findings_table(examined.findings))
    console.print(wake_up_table(examined.wake_ups))
    for line in advice(examined.findings):
        console.print(f"- {line}", highlight=False, markup=False, soft_wrap=True)
    against = [found.name for found in examined.findings if found.verdict == CHANGE]
    verdict = f"against a ride in real time at 500 Hz: {', '.join(against)}" if against else GOOD_WORDS
    console.print(verdict, highlight=False, markup=False, soft_wrap=True)
    if given.json and not write_json(given.json, examined.document()):
        return FAILED
    return BAD if against else GOOD


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
