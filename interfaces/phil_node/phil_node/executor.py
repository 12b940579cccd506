"""The executor of every process of the rig."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

LONG = 1e6
"""Time in s that stands for ever: without a limit rclpy's events executor waits for its messages in a busy loop."""


def events_executor() -> Any:
    """Give the events executor (half the processor time of the other one), or the other one where it is missing."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()


def with_info(callback: Callable[[Any, Any], None]) -> Callable[..., None]:
    """Make a callback of a message and what rclpy says of it fit for every executor.

    rclpy tells by the signature what a callback wants, and hands over both as two arguments; but its events executor
    (7.1.6) hands over one, the pair.
    """

    def take(*given: Any) -> None:
        data, info = given if len(given) == 2 else given[0]
        callback(data, info)

    take.__signature__ = inspect.signature(_pair)  # type: ignore[attr-defined]
    return take


def _pair(message: Any, info: Any) -> None:
    """Stand for the signature."""
