"""Messages that were lost on the way: gaps in the numbers that each publisher gives its messages.

The numbers come with the messages; whose they are does not. With one publisher a gap is a loss. With several, and while
one takes the place of another, numbers jump although nothing is lost: such a time is not counted.

The middleware's own event of a lost message is not used: in rmw_fastrtps (8.4.3) a process that takes such an event
while the next one comes locks for ever, one thread holding the event and waiting for the reader, the other the reverse.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

NUMBER = "publication_sequence_number"
"""Key of the number in what rclpy says of a message; None where the middleware does not count."""
NO_NUMBER = -1


class Numbers:
    """Watches the numbers of a topic's messages; ``counted`` tells whether all of its losses could be counted."""

    def __init__(self, publishers: frozenset[bytes]) -> None:
        """Begin with the topic's publishers by their identities."""
        self.counted = len(publishers) == 1
        self._publishers = publishers
        self._gap = 0
        self._back = False

    @property
    def unsettled(self) -> bool:
        """Tell whether `settle` has something to do: numbers jumped, or there was not one publisher alone."""
        return self._gap > 0 or self._back or len(self._publishers) != 1

    def watch(self, take: Callable[[bytes], None]) -> Callable[[bytes, Mapping[str, Any]], None]:
        """Give a callback for messages and what rclpy says of them that hands the messages on to ``take``."""
        expected, jump = NO_NUMBER, self._jump

        def numbered(data: bytes, info: Mapping[str, Any]) -> None:
            nonlocal expected
            number = info[NUMBER]
            if number == expected:
                expected += 1
            else:
                expected = jump(expected, number)
            take(data)

        return numbered

    def settle(self, publishers: frozenset[bytes]) -> int:
        """Give the losses since the last call; ``publishers`` is who publishes now, nobody if all have left by now."""
        gap, back, before = self._gap, self._back, self._publishers
        self._gap, self._back = 0, False
        self._publishers = publishers or before
        if len(before) == 1 and self._publishers == before and not back:
            return gap
        self.counted = False
        return 0

    def _jump(self, expected: int, number: int | None) -> int:
        """Take a number that was not expected; give the next one."""
        if number is None:
            self.counted = False
            return NO_NUMBER
        if expected != NO_NUMBER:
            self._gap += max(0, number - expected)
            self._back |= number < expected
        return number + 1
