"""What ``scripts/bench.sh rides`` takes beyond what every bench takes."""

from __future__ import annotations

import argparse
from dataclasses import dataclass

from phil_base.command_line import whole

SECONDS, QUICK_SECONDS = 10.0, 2.0
"""s of a ride where nothing is said."""
ROUNDS = 3
LONGEST = 86400.0


@dataclass(frozen=True)
class RidesOptions:
    """How to ride: ``seconds`` of each ride, ``rounds`` of them, ``against`` a revision of the repository or None."""

    seconds: float = SECONDS
    rounds: int = ROUNDS
    against: str | None = None
    composed: bool = False
    """Also with the four nodes in one process."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options to the bench's command line; ``--against`` and ``--seconds`` it shares with ``realtime``."""
    add = parser.add_argument_group("rides only").add_argument
    add("--rounds", type=whole, metavar="N", help=f"rides of each kind, in turns ({ROUNDS})")
    add("--composed", action="store_true", help="ride with the four nodes in one process as well")


def options_from(parser: argparse.ArgumentParser, given: argparse.Namespace) -> RidesOptions:
    """Check the options; ends the process with code 2 and one line if they are wrong."""
    named = {"rounds": given.rounds, "composed": given.composed or None}
    said = [f"--{name}" for name, value in named.items() if value is not None]
    if given.name != "rides":
        if said:
            parser.error(f"{said[0]} is an option of rides, not of {given.name}")
        return RidesOptions()
    seconds = (QUICK_SECONDS if given.quick else SECONDS) if given.seconds is None else given.seconds
    if not 1.0 <= seconds <= LONGEST:
        parser.error(f"--seconds {seconds:g}: from 1 to {LONGEST:g} s")
    rounds = (1 if given.quick else ROUNDS) if given.rounds is None else given.rounds
    if not 1 <= rounds <= 1000:
        parser.error(f"--rounds {rounds}: from 1 to 1000")
    return RidesOptions(seconds, rounds, given.against, given.composed)
