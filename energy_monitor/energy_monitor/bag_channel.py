"""What the readers of bag files share: a channel, the files of a bag, and what was found wrong with them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from phil_base.clear_words import clear

CDR = "cdr"


class BagError(Exception):
    """A bag cannot be used; the message is one line for the person who named it."""

    def __init__(self, text: str = "") -> None:
        super().__init__(clear(text))


class DefinitionError(BagError):
    """A bag does not say, or not so that it can be read, what messages of a type hold."""


@dataclass(frozen=True)
class Channel:
    """One topic of one bag file: its name, message type, definition (text, its language) and how messages are encoded.

    `metadata` is what an MCAP keeps beside a channel (the offered quality of service).
    """

    topic: str
    msgtype: str
    definition: str
    encoding: str
    message_encoding: str = CDR
    metadata: Mapping[str, str] = field(default_factory=dict, compare=False)


Wanted = Callable[[Channel], bool]
Record = tuple[Channel, int, bytes]
"""Channel, log time in ns, payload."""
BATCH = 4096
"""Records that are handed on together: one by one each would go through every layer of the readers."""


@dataclass
class Source:
    """The storage files of one bag, in order, and what reading them showed.

    `complete` turns false when a file ends without its footer, as after a SIGKILL, or is missing. `unlisted` are the
    files that metadata.yaml does not name. `left_out` counts messages by topic and reason.
    """

    path: Path
    files: tuple[Path, ...]
    storage: str
    complete: bool = True
    listed: bool = False
    unlisted: frozenset[Path] = frozenset()
    channels: dict[str, Channel] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    left_out: Counter[tuple[str, str]] = field(default_factory=Counter)

    def note(self, text: str) -> None:
        """Remember a remark for the report, once."""
        if text not in self.notes:
            self.notes.append(text)

    def cut_off(self, file: Path) -> None:
        """Remember that a file has no end."""
        self.complete = False
        self.note(
            f"The recording was cut off ({file.name} has no end): what was written up to then is analysed. Other tools "
            f"read it after: scripts/record.sh --recover {self.path}"
        )

    def damaged(self, file: Path, what: str) -> None:
        """Remember that a part of a file cannot be read."""
        self.complete = False
        self.note(f"{file.name} is damaged: {what}.")


def type_name(name: str) -> str:
    """Give a type's full name: the older form package/Name means package/msg/Name."""
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


def left_out(count: int, topic: str, why: str) -> str:
    """Say that messages of a topic are not used."""
    messages, are = ("message", "is") if count == 1 else ("messages", "are")
    return f"{count} {messages} on {topic} {are} left out: {why}."
