"""The executor of every process of the rig."""

from __future__ import annotations

from typing import Any


def events_executor() -> Any:
    """Give the events executor (half the processor time of the other one), or the other one where it is missing."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        return SingleThreadedExecutor()
    return EventsExecutor()
