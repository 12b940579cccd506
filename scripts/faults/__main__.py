"""Does faults to a running ride in real time (real nodes, real recorder) and judges the outcome, a row a fault.

Exit code: 0 all rows are good, 1 one is not, 2 wrong options, 3 the set-up failed.
"""

from __future__ import annotations

import argparse
import platform
import sys
import tempfile
import time
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING

from phil_base.command_line import Parser, path, real, write_json
from phil_base.workspace import workspace

if TYPE_CHECKING:
    from faults.catalogue import Fault
    from faults.judge import Row

WIDTH = 220
"""Columns of the table where there is no terminal."""
DOCUMENT = workspace() / "docs" / "faults.md"
GOOD, BAD, WRONG, BROKEN = 0, 1, 2, 3


def parser() -> Parser:
    """Describe the options."""
    made = Parser(prog="scripts/faults.sh", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = made.add_argument
    add("names", nargs="*", metavar="NAME", help="faults to do, patterns like 'kill-*' too (default: all)")
    add("--list", action="store_true", help="name the faults and do none")
    add("--short", action="store_true", help="a handful of faults, within a minute")
    add("--rate", type=real, default=500.0, metavar="HZ", help="cycles a second (default: 500)")
    add("--json", type=path, metavar="FILE", help="write the rows there")
    add("--out", type=path, metavar="DIR", help="keep logs and bags there (default: they are deleted)")
    add("--update-docs", action="store_true", help=f"write the table into docs/{DOCUMENT.name}")
    return made


def arguments(argv: Sequence[str] | None = None) -> tuple[argparse.Namespace, list[Fault]]:
    """Read the command line, give the faults to be done; ends the process with code 2 if it is wrong."""
    options = parser()
    given = options.parse_args(argv)
    if not 50.0 <= given.rate <= 2000.0:
        options.error(f"--rate {given.rate:g}: allowed are 50 to 2000 Hz")

    from faults.catalogue import FAULTS

    chosen = [fault for fault in FAULTS if fault.short] if given.short else list(FAULTS)
    if given.names:
        for name in given.names:
            if not any(fnmatchcase(fault.name, name) for fault in FAULTS):
                options.error(f"there is no fault '{name}': --list names them")
        chosen = [fault for fault in FAULTS if any(fnmatchcase(fault.name, name) for name in given.names)]
    if given.update_docs and len(chosen) != len(FAULTS):
        options.error("--update-docs: the table of the documentation has all faults; leave out --short and names")
    options.check_places(given.json, given.out)
    return given, chosen


def main() -> int:
    """Do the faults, print, write."""
    given, chosen = arguments()
    if given.list:
        for fault in chosen:
            print(f"{fault.name:34} {fault.title}")
        return GOOD
    if given.out:
        return ride(given, chosen, given.out)
    with tempfile.TemporaryDirectory(prefix="phil-faults-") as folder:
        return ride(given, chosen, Path(folder))


def ride(given: argparse.Namespace, chosen: Sequence[Fault], out: Path) -> int:
    """Do the chosen faults in ``out``; give the exit code."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from rich.console import Console

    from faults.runner import Runner
    from faults.table import table, update
    from phil_base.parameters import ParameterError
    from ride.shared_memory import remove_litter, snapshot

    console = Console()
    if not console.is_terminal:
        console.width = WIDTH
    before, begun = snapshot(), time.monotonic()
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    rows: list[Row] = []
    interrupted = False
    try:
        runner = Runner(out.absolute(), given.rate, lambda text: console.print(text, highlight=False, markup=False))
        for row in runner.run(chosen):
            rows.append(row)
            safe = "" if row.safe_after is None else f", safe after {row.safe_after:.2f} s"
            verdict = "ok" if row.ok else "FAILED: " + "; ".join(row.failures)
            console.print(f"    {row.ended}{safe}: {verdict}", highlight=False, markup=False)
    except (ParameterError, RuntimeError, OSError) as error:
        print(f"faults: {error}", file=sys.stderr)
        return BROKEN
    except KeyboardInterrupt:
        interrupted = True
        print("faults: interrupted, all processes of the ride have ended", file=sys.stderr)
    finally:
        rclpy.try_shutdown()
        remove_litter(before)
    minutes = (time.monotonic() - begun) / 60.0
    good = all(row.ok for row in rows) and not interrupted
    foot = (
        f"{sum(row.ok for row in rows)} of {len(rows)} as they have to be, at {given.rate:g} Hz, in {minutes:.1f} min."
    )
    console.print(table(rows))
    console.print(foot, highlight=False)
    written = True
    if given.json:
        document = {
            "name": "faults",
            "machine": platform.machine(),
            "python": platform.python_version(),
            "rate": given.rate,
            "minutes": minutes,
            "ok": good,
            "rows": [row.document() for row in rows],
        }
        written = write_json(given.json, document)
    if given.update_docs and not interrupted:
        update(DOCUMENT, rows, foot)
    if not written:
        return BROKEN
    return GOOD if good else BAD


if __name__ == "__main__":
    sys.exit(main())
