"""What a relay does to the messages that pass through it; no ROS but the messages' fields."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

ABSURD = 1e15
"""A finite number that no length, speed or force of a rig can have."""
FIELDS = {
    "RigState": ("w_tr", "v_tr", "f_tr"),
    "ImpedanceCommand": ("u_tr", "u_tr_next", "f_cat"),
    "CatenaryState": ("w_cat", "v_cat", "f_cat"),
}
"""What is spoilt in a message of each type."""
ARRAYS = {"CatenaryState": ("segment_displacement", "segment_force")}
NUMBERS = {"nan": math.nan, "infinity": math.inf, "absurd": ABSURD}
KINDS = ("none", "lost", "delayed", "doubled", "swapped", *NUMBERS, "sizes", "old_stamp", "future_stamp")
HOUR = 3600


@dataclass(frozen=True)
class Damage:
    """One kind of `KINDS`, done to a ``share`` of the messages; ``delay`` in s is for "delayed"."""

    kind: str = "none"
    share: float = 0.0
    delay: float = 0.0


class Spoiler:
    """Decides message by message: `pass_on` gives what goes on now and what goes on later (delay in s, message).

    ``change`` gives the message as a kind of damage leaves it; only what is changed is looked into.
    """

    def __init__(self, seed: int = 1, change: Callable[[Any, str], Any] | None = None) -> None:
        self._random = random.Random(seed)
        self._change = change or spoil
        self._held: Any = None
        self.damage = Damage()
        self.done = 0

    def set(self, damage: Damage) -> list[Any]:
        """Do this from now on; give what was held back until now."""
        held, self._held, self.damage = self._held, None, damage
        return [held] if held is not None else []

    def pass_on(self, message: Any) -> tuple[list[Any], tuple[float, Any] | None]:
        """Take a message that may be changed."""
        held, self._held = self._held, None
        after = [held] if held is not None else []
        kind = self.damage.kind
        if kind == "none" or held is not None or self._random.random() >= self.damage.share:
            return [message, *after], None
        self.done += 1
        if kind == "lost":
            return [], None
        if kind == "delayed":
            return [], (self.damage.delay, message)
        if kind == "doubled":
            return [message, message], None
        if kind == "swapped":
            self._held = message
            return [], None
        return [self._change(message, kind)], None


def spoil(message: Any, kind: str) -> Any:
    """Change a message in place, and give it.

    Raises
    ------
    ValueError
        The kind is none of `KINDS`, or a message of this type cannot be spoilt so.
    """
    name = type(message).__name__
    if kind in NUMBERS:
        for field in FIELDS[name]:
            setattr(message, field, NUMBERS[kind])
    elif kind == "sizes" and name in ARRAYS:
        first, second = ARRAYS[name]
        setattr(message, first, getattr(message, first)[:-1])
        setattr(message, second, [])
    elif kind in ("old_stamp", "future_stamp"):
        message.header.stamp.sec += HOUR if kind == "future_stamp" else -HOUR
    else:
        raise ValueError(f"'{kind}' cannot be done to a {name}")
    return message
