"""The command line of studies and benches: their options, and how an outcome is shown and written."""

from __future__ import annotations

import argparse
import platform
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NoReturn

from phil_base.atomic import together
from phil_base.command_line import Parser, path, write_json

if TYPE_CHECKING:
    from rich.console import Console

    from phil_study.outcome import Outcome

WRONG, FAILED, INTERRUPTED = 2, 3, 130
WIDTH = 132
"""Columns of the tables where there is no terminal."""


def parser(
    prog: str,
    description: str | None,
    names: Sequence[str],
    *,
    name: str,
    out: str,
    quick: str,
    epilog: str | None = None,
) -> Parser:
    """Describe what every command line of them takes; ``name``, ``out`` and ``quick`` are what the help says of them.

    The epilog keeps its lines.
    """
    form = argparse.RawDescriptionHelpFormatter if epilog else argparse.HelpFormatter
    made = Parser(prog=prog, description=description, epilog=epilog, formatter_class=form)
    add = made.add_argument
    add("name", choices=tuple(names), help=name)
    add("--json", type=path, metavar="FILE", help="write the figures there")
    add("--out", type=path, metavar="DIR", help=out)
    add("--quick", action="store_true", help=quick)
    return made


def console() -> Console:
    """Give the terminal, or a page of `WIDTH` columns."""
    from rich.console import Console

    made = Console()
    if not made.is_terminal:
        made.width = WIDTH
    return made


def show(outcome: Outcome, on: Console) -> None:
    """Print tables and remarks."""
    for table in outcome.tables():
        on.print(table)
    for note in outcome.notes:
        on.print(f"- {note}", highlight=False, markup=False)


def write(outcome: Outcome, given: argparse.Namespace, of: str, judged: bool) -> bool:
    """Write figures and pictures where ``given`` wants them; False if the figures could not be, which is then said.

    Pictures are called after ``of`` and the name; ``judged``: the file says whether all rows hold.
    """
    written = True
    if given.json:
        written = write_json(
            given.json,
            {
                "name": given.name,
                "title": outcome.title,
                "machine": platform.machine(),
                "python": platform.python_version(),
                "quick": given.quick,
                **({"holds": outcome.holds} if judged else {}),
                **outcome.document(),
            },
        )
    if given.out:
        from phil_study.distribution import picture

        with together(given.out) as drafts:
            if outcome.samples:
                picture(outcome.title, outcome.samples, drafts / f"{of}-{given.name}.png")
            for name, draw in outcome.pictures.items():
                draw(drafts / f"{of}-{given.name}-{name}.png")
    return written


def end(main: Callable[[], int]) -> NoReturn:
    """Run ``main`` as the process; ends it with the code of ``main``, or INTERRUPTED."""
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(INTERRUPTED)
