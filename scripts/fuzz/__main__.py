"""Entry point of ``scripts/fuzz.sh``: damage every kind of file that is read here, and look at what comes of it."""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from phil_base.command_line import Parser, path, whole, write_json
from phil_base.workspace import workspace

NAMES = ("yaml", "line", "pantograph", "trajectory", "limits", "report-limits", "bag", "command-line")
GOOD, BAD, WRONG, FAILED = 0, 1, 2, 3
MOST = 10**7
WITH_BAG = {"bag", "command-line"}


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command line; ends the process with code 2 if it is wrong."""
    parser = Parser(
        prog="scripts/fuzz.sh",
        description="Damage every kind of file that is read here, and the command lines of all scripts, and look at "
        "what comes of it. Each case must lead to a result or to exit code 2 with one clear line (one for each wrong "
        "parameter): no traceback, no hang, no memory without end.",
        epilog="Exit code: 0 no fault, 1 faults, 2 wrong options, 3 the ride for the bag failed.",
    )
    add = parser.add_argument
    add("kind", nargs="?", default="all", choices=(*NAMES, "all"), help="kind of file: " + ", ".join(NAMES) + " (all)")
    add("--mutations", type=whole, default=1000, metavar="N", help="damaged files of each kind (1000)")
    add("--seed", type=whole, metavar="N", help="other damages (without it the same ones each time)")
    add("--bag", type=path, metavar="DIR", help="bag of a ride to damage (else a ride of 1 s is recorded first)")
    add("--out", type=path, metavar="DIR", help="where the smallest case of each fault goes (rides/fuzz)")
    add("--repeat", type=path, metavar="DIR", help="read one such case again, and print what becomes of it")
    add("--json", type=path, metavar="FILE", help="write the outcome there")
    given = parser.parse_args(argv)
    if not 1 <= given.mutations <= MOST:
        parser.error(f"--mutations {given.mutations}: from 1 to {MOST}")
    try:
        if given.repeat and not (given.repeat / "note.txt").is_file():
            parser.error(f"--repeat {given.repeat}: there is no case with a note.txt")
        if given.bag and not (given.bag / "metadata.yaml").is_file():
            parser.error(f"--bag {given.bag}: is no folder of a bag with metadata.yaml")
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        parser.error(f"{error.filename}: {error.strerror}")
    parser.check_places(given.json, given.out)
    return given


def main() -> int:
    """Hunt, print, write; give the exit code."""
    given = arguments()
    if given.repeat:
        return repeat(given.repeat)
    from rich.console import Console
    from rich.table import Table

    from fuzz.hunt import Row, hunt
    from fuzz.kinds import KINDS

    console = Console()
    names = NAMES if given.kind == "all" else (given.kind,)
    out = given.out or workspace() / "rides" / "fuzz"
    rows: list[Row] = []
    begin = time.monotonic()
    with TemporaryDirectory(prefix="phil_fuzz_") as name:
        folder = Path(name)
        bag = given.bag or (recorded(folder / "ride") if WITH_BAG & set(names) else None)
        if WITH_BAG & set(names) and bag is None:
            print("fuzz: the ride that was to be recorded failed: try scripts/run.sh --duration 1", file=sys.stderr)
            return FAILED
        for each in names:
            kind = KINDS[each]
            row = hunt(kind, kind.examples(bag), given.mutations, given.seed, folder / each)
            for number, fault in enumerate(row.faults.values(), 1):
                fault.keep(out / f"{each}-{number}")
            rows.append(row)
            console.print(f"{each}: {row.cases} cases, {len(row.faults)} faults", highlight=False)
    table = Table(title="Damaged files", title_justify="left")
    for head in ("kind", "cases", "refused", "read", "slowest s", "most MiB", "faults"):
        table.add_column(head, justify="left" if head == "kind" else "right")
    for row in rows:
        figures = (row.cases, row.refused, row.read, f"{row.seconds:.2f}", f"{row.mib:.0f}", len(row.faults))
        table.add_row(row.kind, *map(str, figures))
    console.print(table)
    for row in rows:
        for fault in row.faults.values():
            console.print(f"{row.kind}, {fault.entry}: {fault.what} -> {fault.folder}", highlight=False, soft_wrap=True)
    if given.json:
        document = {
            "mutations": given.mutations,
            "seed": given.seed,
            "seconds": time.monotonic() - begin,
            "ok": not any(row.faults for row in rows),
            "rows": [_row(row) for row in rows],
        }
        if not write_json(given.json, document):
            return FAILED
    return BAD if any(row.faults for row in rows) else GOOD


def _row(row: Any) -> dict[str, Any]:
    faults = [{"what": f.what, "entry": f.entry, "folder": str(f.folder)} for f in row.faults.values()]
    figures = {key: getattr(row, key) for key in ("kind", "cases", "refused", "read", "seconds", "mib")}
    return figures | {"faults": faults}


def recorded(out: Path) -> Path | None:
    """Record a ride of 1 s; None if it fails."""
    command = [sys.executable, "-m", "ride", "--duration", "1", "--no-report", "--out", str(out)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    return out / "bag" if done.returncode == 0 else None


def repeat(folder: Path) -> int:
    """Let the entry that a note names read its case in this process, with whatever comes of it."""
    from fuzz.entries import ENTRIES

    words = (folder / "note.txt").read_text(encoding="utf-8").splitlines()
    entry, name = (
        next(word.removeprefix(lead) for word in words if word.startswith(lead)) for lead in ("entry: ", "read: ")
    )
    return ENTRIES[entry]((folder / "case" / name).absolute())


if __name__ == "__main__":
    sys.exit(main())
