"""Entry point of ``scripts/validate.sh``: holds the models against what they must reproduce."""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Sequence
from contextlib import nullcontext

from phil_base.atomic import together
from phil_base.command_line import Parser, path
from phil_study import command

NAMES = {
    "en50318": ("validate.en50318", "the reference models of EN 50318: 2002 with verdicts, 2018 for comparison"),
    "statics": ("validate.statics", "elasticity of the line: a static push by all models, every preset"),
    "reference": ("validate.reference", "convergence and speed of the catenary-fixed reference"),
    "speed": ("validate.speed", "the reference at a speed that changes: start, cruise, brake"),
    "pantographs": ("validate.pantographs", "two pantographs of one train: what the trailing one meets of the other"),
    "absorption": ("validate.absorption", "what the ends send back: wave packets, every kind, both directions"),
    "realtime": ("validate.realtime", "the real-time model against the catenary-fixed reference"),
    "fd-abc": ("validate.fd_abc", "absorbing boundaries by optimisation: a beam, and waves in two dimensions"),
    "longrun": ("validate.longrun", "hours of ride: drift, energy, droppers, recovery from disturbances"),
    "impedance": ("validate.impedance", "the closed loop against the coupling without a rig: motion, books, force"),
    "reduced": ("validate.reduced", "the controller's reduced model against the full one"),
    "rig": ("validate.rig", "the test rig: inner loop, resonances, observers, identified model"),
}
"""Module of every name, imported only when asked for, and what it measures."""

SOLVERS = "daqp", "proxqp"
SELDOM = 10.0
"""Time between two lines of progress where there is no terminal, s."""


def parser() -> Parser:
    """Describe the options."""
    made = command.parser(
        "scripts/validate.sh",
        __doc__,
        tuple(NAMES),
        name="what to validate (see below)",
        out="draw the pictures there",
        quick="shortened: only to see that it works",
        epilog="\n".join(f"{name:12} {what}" for name, (_, what) in NAMES.items()),
    )
    made.add_argument(
        "--solver",
        choices=SOLVERS,
        help=f"of impedance: the controller's solver ({SOLVERS[0]} if nothing is said)",
    )
    made.add_argument(
        "--values",
        type=path,
        metavar="FILE",
        help="of en50318: reference values with edition, source and status, in place of those that come with it",
    )
    return made


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Read the command line; ends the process with code 2 if it is wrong, before anything is measured."""
    options = parser()
    given = options.parse_args(argv)
    if given.solver and given.name != "impedance":
        options.error("--solver is for impedance only")
    if given.values and given.name != "en50318":
        options.error("--values is for en50318 only")
    if given.values:
        from validate.reference_values import ReferenceValuesError, load

        try:
            load(given.values)
        except ReferenceValuesError as error:
            options.error(f"--values {error}")
    options.check_places(given.json, given.out)
    return given


def main() -> int:
    """Measure, print, write; 0 only if every row with a goal holds."""
    given = arguments()

    from rich.console import Console

    from phil_study.outcome import Outcome

    terminal, progress = command.console(), Console(stderr=True)
    module = importlib.import_module(NAMES[given.name][0])
    with progress.status(given.name) as status:
        last = -SELDOM

        def say(what: str) -> None:
            nonlocal last
            if progress.is_terminal:
                status.update(what)
            elif time.monotonic() - last >= SELDOM:
                progress.print(what, highlight=False)
                last = time.monotonic()

        choice = {"solver": given.solver} if given.solver else {}
        choice |= {"file": given.values} if given.values else {}
        with together(given.out) if given.out else nullcontext() as drafts:
            outcome: Outcome = module.run(given.quick, drafts, say, **choice)
    command.show(outcome, terminal)
    if given.quick:
        terminal.print("This was a shortened run: verdicts are given on full runs.")
    if not command.write(outcome, given, "validate", judged=True):
        return command.FAILED
    return 0 if outcome.holds else 1


if __name__ == "__main__":
    command.end(main)
