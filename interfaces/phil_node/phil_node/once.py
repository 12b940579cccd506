"""Taking each message once although it may come two ways, by a link and by its topic."""

from __future__ import annotations

from array import array
from collections import OrderedDict

REMEMBERED = 5000
"""Messages back for which it is known that they came already by the other way."""

LINK, TOPIC = 0, 1


class Once:
    """Tells which messages are new.

    A message that came both ways, the same to the last byte, is new the first time. One that came twice by one way is
    new twice: a sender that sends again has a reason, and a stranger on the topic is heard and judged like the peer.
    """

    def __init__(self) -> None:
        # While all come one way, which is the rule, a number for each is enough. Its room is there from the start:
        # topics that speak once a second would fill it for an hour.
        self._alone = array("q", bytes(8 * REMEMBERED))
        self.clear()

    def clear(self) -> None:
        """Forget all."""
        self._count, self._way = 0, LINK
        self._ways: tuple[OrderedDict[int, int], OrderedDict[int, int]] | None = None

    def from_link(self, data: bytes) -> bool:
        """Tell whether a message that came by the link is new."""
        if self._ways is None and self._way == LINK:
            self._alone[self._count % REMEMBERED] = hash(data)
            self._count += 1
            return True
        return self._new(data, LINK)

    def remember(self, digest: int) -> None:
        """Take note of a message that came by the link before, by the hash of its bytes; before any by the topic."""
        self._alone[self._count % REMEMBERED] = digest
        self._count += 1

    def from_topic(self, data: bytes) -> bool:
        """Tell whether a message that came by the topic is new."""
        return self._new(data, TOPIC)

    def _new(self, data: bytes, way: int) -> bool:
        if self._ways is None:
            if way == self._way or not self._count:
                self._way = way
                self._alone[self._count % REMEMBERED] = hash(data)
                self._count += 1
                return True
            self._ways = self._both()
        return _new(data, self._ways[way], self._ways[1 - way])

    def _both(self) -> tuple[OrderedDict[int, int], OrderedDict[int, int]]:
        """Give what is remembered of either way, from when all came one way."""
        ways: tuple[OrderedDict[int, int], OrderedDict[int, int]] = OrderedDict(), OrderedDict()
        seen = ways[self._way]
        for number in range(max(0, self._count - REMEMBERED), self._count):
            digest = self._alone[number % REMEMBERED]
            seen[digest] = seen.get(digest, 0) + 1
        return ways


def _new(data: bytes, mine: OrderedDict[int, int], other: OrderedDict[int, int]) -> bool:
    digest = hash(data)
    times = other.get(digest)
    if times is not None:
        if times > 1:
            other[digest] = times - 1
        else:
            del other[digest]
        return False
    mine[digest] = mine.get(digest, 0) + 1
    if len(mine) > REMEMBERED:
        mine.popitem(last=False)
    return True
