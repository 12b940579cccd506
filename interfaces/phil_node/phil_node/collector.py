"""The garbage collector of a process in which nodes are active: it stands still until the last one is not."""

from __future__ import annotations

import gc
import weakref

_HELD_BY: weakref.WeakSet[object] = weakref.WeakSet()


def hold(who: object) -> None:
    """Collect, and then no more; nothing, if somebody holds the collector already: collecting takes several cycles."""
    if not _HELD_BY:
        gc.collect()
        gc.freeze()
        gc.disable()
    _HELD_BY.add(who)


def release(who: object) -> None:
    """Let the collector work again, unless somebody else holds it."""
    _HELD_BY.discard(who)
    if not _HELD_BY:
        gc.enable()
        gc.unfreeze()
