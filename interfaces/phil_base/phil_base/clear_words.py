"""Words about files that somebody else wrote: what is quoted from them neither fills a screen nor steers a terminal."""

from __future__ import annotations

MOST_LETTERS = 900
"""Length of a line; of a longer one the middle is left out."""
_END = 200


class ClearError(ValueError):
    """An error whose text is one or more lines, each of at most 900 letters that can be printed."""

    def __init__(self, text: str = "") -> None:
        super().__init__(clear(text))


def clear(text: str) -> str:
    r"""Give a text with every line cut to a length that can be read, and what cannot be printed written as an escape.

    >>> clear("a\tb\n\x1b[31mred")
    'a\\tb\n\\x1b[31mred'
    """
    return "\n".join(map(_line, text.split("\n")))


def _line(line: str) -> str:
    if len(line) > MOST_LETTERS:
        line = f"{line[: MOST_LETTERS - _END]} ... {line[-_END:]}"
    if line.isprintable():
        return line
    line = "".join(letter if letter.isprintable() else _escaped(letter) for letter in line)
    return line if len(line) <= MOST_LETTERS + 5 else _line(line)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape").decode("ascii")
