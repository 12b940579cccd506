"""Command lines whose complaints are one line each."""

from __future__ import annotations

import argparse
import math
from pathlib import PurePath
from typing import NoReturn

UNUSABLE = 2
"""Exit code for a command line or an input that cannot be used."""


class Parser(argparse.ArgumentParser):
    """Parser that names what is wrong in one line and ends with code 2."""

    def error(self, message: str) -> NoReturn:
        """Print the line and leave."""
        self.exit(UNUSABLE, f"{PurePath(self.prog).stem}: {message} (options: --help)\n")


def seconds(text: str) -> float:
    """Read a time in s, finite and not negative.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no such number.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time of 0 s or more")
    return value
