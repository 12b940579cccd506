"""Taking each message once although it may come two ways, by a link and by its topic."""

from __future__ import annotations

from collections import OrderedDict

REMEMBERED = 5000
"""Messages back for which it is known that they came already by the other way."""


class Once:
    """Tells which messages are new.

    A message that came both ways, the same to the last byte, is new the first time. One that came twice by one way is
    new twice: a sender that sends again has a reason, and a stranger on the topic is heard and judged like the peer.
    """

    def __init__(self) -> None:
        self._by_link: OrderedDict[int, int] = OrderedDict()
        self._by_topic: OrderedDict[int, int] = OrderedDict()

    def clear(self) -> None:
        """Forget all."""
        self._by_link.clear()
        self._by_topic.clear()

    def from_link(self, data: bytes) -> bool:
        """Tell whether a message that came by the link is new."""
        return _new(data, self._by_link, self._by_topic)

    def from_topic(self, data: bytes) -> bool:
        """Tell whether a message that came by the topic is new."""
        return _new(data, self._by_topic, self._by_link)


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
