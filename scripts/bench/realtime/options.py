"""What ``scripts/bench.sh realtime`` takes beyond what every bench takes."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from phil_base.command_line import real, whole

RATES = (50.0, 5000.0)
"""Hz, lowest and highest rate: what the nodes' parameter `cycle_time` allows, and where nothing is left of a cycle."""
ALONE, COMPARED, QUICK, QUICK_COMPARED = 60.0, 10.0, 5.0, 3.0
"""s of a ride where nothing is said."""
PAIRS = 3
HEADING = "realtime"
SHARED = ("seconds", "against")
"""Options that the bench ``rides`` takes as well."""


class WrongUse(Exception):  # noqa: N818 - the user's, told as such
    """What was asked for cannot be: another revision, another parameter."""


@dataclass(frozen=True)
class RealtimeOptions:
    """How to ride: ``rate`` in Hz, ``seconds`` of each ride, ``against`` a revision of the repository or None."""

    disturbed: bool = False
    rate: float = 500.0
    seconds: float = ALONE
    against: str | None = None
    pairs: int = PAIRS
    parameters: tuple[str, ...] = ()
    """For all rides, as ``scripts/run.sh --set`` takes them."""

    @property
    def cycle_time(self) -> float:
        """Give Ts in s."""
        return 1.0 / self.rate


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options to the bench's command line."""
    add = parser.add_argument_group(HEADING).add_argument
    add(
        "--disturbed",
        action="store_true",
        help="meanwhile ten viewers join and leave, a second recorder and a reader of parameters run, and a busy "
        "process for each core, all of ordinary priority",
    )
    add("--rate", type=real, metavar="HZ", help="cycles a second (500)")
    add("--seconds", type=real, metavar="N", help="length of a ride (60; with --against, and of rides, 10)")
    add(
        "--against",
        metavar="REVISION",
        help="ride in turns with that revision of this repository, built beside (rides, too)",
    )
    add(
        "--set", action="append", default=[], metavar="NODE.KEY=VALUE", help="one parameter of all rides, as for run.sh"
    )
    add("--pairs", type=whole, metavar="N", help=f"with --against: rides of either ({PAIRS})")


def options_from(parser: argparse.ArgumentParser, given: argparse.Namespace) -> RealtimeOptions:
    """Check the options; ends the process with code 2 and one line if they are wrong."""
    named = {name: getattr(given, name) for name in ("rate", "seconds", "against", "pairs")}
    named |= {"disturbed": given.disturbed or None, "set": given.set or None}
    if given.name == "rides":
        named = {name: value for name, value in named.items() if name not in SHARED}
    said = [f"--{name}" for name, value in named.items() if value is not None]
    if given.name != "realtime" and said:
        parser.error(f"{said[0]} is an option of realtime, not of {given.name}")
    if given.name != "realtime":
        return RealtimeOptions()
    if given.pairs is not None and given.against is None:
        parser.error("--pairs is for --against")
    rate = 500.0 if given.rate is None else given.rate
    if not RATES[0] <= rate <= RATES[1]:
        parser.error(f"--rate {rate:g}: from {RATES[0]:g} to {RATES[1]:g} Hz")
    usual = (QUICK_COMPARED if given.quick else COMPARED) if given.against else (QUICK if given.quick else ALONE)
    seconds = usual if given.seconds is None else given.seconds
    if not 1.0 <= seconds <= 86400.0:
        parser.error(f"--seconds {seconds:g}: from 1 to 86400 s")
    pairs = (1 if given.quick else PAIRS) if given.pairs is None else given.pairs
    if not 1 <= pairs <= 1000:
        parser.error(f"--pairs {pairs}: from 1 to 1000")
    return RealtimeOptions(given.disturbed, rate, seconds, given.against, pairs, tuple(given.set))
