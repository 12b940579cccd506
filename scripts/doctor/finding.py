"""One line of the doctor: what was looked at, what was found, whether it will do, and what to type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

OK, NOTE, CHANGE = "OK", "note", "change"
"""Verdicts. note: would be better otherwise, or is good to know; change: stands against 500 Hz in real time."""


@dataclass(frozen=True)
class Finding:
    """What was looked at, the value with its unit, the verdict, the reason for it, and the words to type."""

    name: str
    value: str
    verdict: str = OK
    why: str = ""
    do: str = ""

    def row(self) -> dict[str, Any]:
        """Give it for the JSON file."""
        return asdict(self)


class Machine:
    """The files in which Linux tells of itself, below a root that a test may give."""

    def __init__(self, root: Path = Path("/")) -> None:
        self.root = root

    def text(self, path: str) -> str:
        """Give the text of a file without the white space around it, empty where it cannot be read."""
        try:
            return (self.root / path.lstrip("/")).read_text(encoding="utf-8", errors="replace").strip()
        except OSError:
            return ""

    def number(self, path: str) -> int | None:
        """Give the first whole number of a file, None without one."""
        words = self.text(path).split()
        try:
            return int(words[0]) if words else None
        except ValueError:
            return None

    def there(self, path: str) -> bool:
        """Tell whether there is such a file."""
        return (self.root / path.lstrip("/")).exists()

    def all(self, pattern: str) -> list[Path]:
        """Give the files that match a pattern, in order."""
        return sorted(self.root.glob(pattern.lstrip("/")))


Look = Callable[[Machine], Iterable[Finding]]


def looked(looks: Iterable[Look], machine: Machine) -> Iterator[Finding]:
    """Look at everything; what cannot be looked at is said, and no reason to stop."""
    for look in looks:
        try:
            yield from look(machine)
        except (OSError, ValueError) as error:
            yield Finding(look.__name__.replace("_", " "), "unknown", NOTE, f"could not be read: {error}")
