"""How a process beside the ride says that it has begun: a line in its log, written once."""

from __future__ import annotations

from functools import cache

BEGUN = "begun"


@cache
def announce() -> None:
    """Say it, the first time."""
    print(BEGUN, flush=True)
