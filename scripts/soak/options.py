"""Command line of a soak."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from phil_base.command_line import UNUSABLE, Parser, path, real, whole
from phil_base.workspace import workspace

RATES = (50.0, 5000.0)
"""Hz, lowest and highest rate: what the nodes' parameter `cycle_time` allows, and where nothing is left of a cycle."""
MINUTES = (0.1, 1440.0)
MODES = ("realtime", "lockstep")


@dataclass(frozen=True)
class Options:
    """How long (``minutes`` of the ride's time) and how fast (``rate`` in Hz) to ride, and where the outcome goes."""

    out: Path
    minutes: float = 30.0
    rate: float = 500.0
    mode: str = MODES[0]
    viewers: int = 2
    json: Path | None = None
    parameters: tuple[str, ...] = ()
    """As ``scripts/run.sh --set`` takes them."""

    @property
    def cycle_time(self) -> float:
        """Give Ts in s."""
        return 1.0 / self.rate

    @property
    def seconds(self) -> float:
        """Give the length of the ride in s."""
        return self.minutes * 60.0

    @property
    def cycles(self) -> int:
        """Give the number of cycles of the ride."""
        return max(1, round(self.seconds * self.rate))


def parse(argv: Sequence[str] | None = None) -> Options:
    """Read the command line; ends the process with code 2 and one line if it is wrong."""
    parser = Parser(
        prog="scripts/soak.sh",
        description="Ride for a long time in real time, with recording and viewers that join and leave; look once a "
        "second at memory, processor, threads, files and logs of each process; then at the bag and its report. What "
        "grows, drifts or is lost is told.",
        epilog="Exit code: 0 all holds, 1 something does not, 2 wrong options, 3 the ride did not come to its end, "
        "130 interrupted.",
    )
    add = parser.add_argument
    add("--minutes", type=real, default=30.0, metavar="N", help="length of the ride (30)")
    add("--rate", type=real, default=500.0, metavar="HZ", help="cycles a second (500)")
    add("--mode", choices=MODES, default=MODES[0], help="follow the clock (realtime), or wait for each other")
    add("--viewers", type=whole, default=2, metavar="N", help="viewers, reliable and best effort by turns (2)")
    add("--set", action="append", default=[], metavar="NODE.KEY=VALUE", help="one parameter, as for scripts/run.sh")
    add("--out", type=path, metavar="DIR", help="where ride, report and picture go (rides/soak-DATE-TIME)")
    add("--json", type=path, metavar="FILE", help="write the outcome there, with all that was sampled")
    given = parser.parse_args(argv)
    for name, value, (low, high) in (("minutes", given.minutes, MINUTES), ("rate", given.rate, RATES)):
        if not low <= value <= high:
            parser.error(f"--{name} {value:g} has to be within {low:g} and {high:g}")
    if not 0 <= given.viewers <= 20:
        parser.error(f"--viewers {given.viewers} has to be within 0 and 20")
    out = given.out or workspace() / "rides" / f"soak-{datetime.now():%Y%m%d-%H%M%S}"
    if given.set:
        # Only now, so that --help and what can be said without it come at once.
        from ride.beforehand import refusal

        if refused := refusal(parser, given.set, given.mode, 1.0 / given.rate):
            print(refused, file=sys.stderr)
            sys.exit(UNUSABLE)
    try:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            parser.error(f"--out {out} already exists: choose another one")
    except OSError as error:
        parser.error(f"--out {out} cannot be written: {error.strerror}")
    parser.check_places(given.json, out)
    return Options(
        out=out.absolute(),
        minutes=given.minutes,
        rate=given.rate,
        mode=given.mode,
        viewers=given.viewers,
        json=given.json,
        parameters=tuple(given.set),
    )
