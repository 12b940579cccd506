"""Command lines whose complaints are one line each, and come before any work is begun."""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import sys
from pathlib import Path, PurePath
from tempfile import TemporaryFile
from typing import NoReturn

from phil_base.atomic import write_text
from phil_base.clear_words import clear

UNUSABLE = 2
"""Exit code for a command line or an input that cannot be used."""
MOST_DIGITS = 25
"""Letters of a whole number: more than any has, and few enough that Python reads them."""


class Parser(argparse.ArgumentParser):
    """Parser that names what is wrong in one line and ends with code 2."""

    def error(self, message: str) -> NoReturn:
        """Print the line and leave."""
        said = clear(message.replace("\n", " "))
        self.exit(UNUSABLE, f"{PurePath(self.prog).stem}: error: {said} (options: --help)\n")

    def check_places(self, file: Path | None = None, folder: Path | None = None) -> None:
        """Make the file of ``--json`` and the folder of ``--out``; leave with a line if they cannot be written."""
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                self.error(f"--out {folder} cannot be written: {error.strerror}")
        if file is not None:
            try:
                with file.open("ab"):
                    pass
                if file.is_file():  # what is written later is written beside it first
                    with TemporaryFile(dir=file.resolve().parent):
                        pass
            except OSError as error:
                self.error(f"--json {file} cannot be written: {error.strerror}")


def write_json(file: Path, document: object) -> bool:
    """Write a document whole; False if it cannot be, which is then said: the disk may have filled up meanwhile."""
    try:
        write_text(file, json.dumps(document, indent=1) + "\n")
    except OSError as error:
        print(clear(f"--json {file} cannot be written: {error.strerror}"), file=sys.stderr)
        return False
    return True


def real(text: str) -> float:
    """Read a number as all our files do; Python would take 1_000, "nan" and digits of other scripts as well.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no number, or none that is finite.
    """
    if not re.fullmatch(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", text):
        raise argparse.ArgumentTypeError(f"{text!r} is no number")
    if math.isinf(value := float(text)):
        raise argparse.ArgumentTypeError(f"{text!r} is too large a number")
    return value


def whole(text: str) -> int:
    """Read a whole number, as `real` reads one.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no whole number.
    """
    if not re.fullmatch(rf"[-+]?[0-9]{{1,{MOST_DIGITS}}}", text):
        raise argparse.ArgumentTypeError(f"{text!r} is no whole number")
    return int(text)


def seconds(text: str) -> float:
    """Read a time in s, finite and not negative.

    Raises
    ------
    argparse.ArgumentTypeError
        The text is no such number.
    """
    try:
        value = real(text)
    except argparse.ArgumentTypeError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a time of 0 s or more")
    return value


def path(text: str) -> Path:
    """Take the name of a file or folder.

    Raises
    ------
    argparse.ArgumentTypeError
        It is empty (a variable of the shell that is not set; it would be the current folder), or has bytes that are
        no UTF-8: it could be written neither into the files of a ride nor onto a terminal.
    """
    if not text:
        raise argparse.ArgumentTypeError("an empty name is no folder and no file")
    found = Path(text)
    try:
        os.fsencode(found.absolute()).decode("utf-8")
    except UnicodeError:
        raise argparse.ArgumentTypeError(f"{text!r} has letters that are no UTF-8") from None
    except FileNotFoundError:
        raise argparse.ArgumentTypeError(f"{text!r}: the current folder is not there any more") from None
    return found
