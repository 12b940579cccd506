"""The closed loop as a library: catenary, controller and rig of one ride, in one process and without ROS.

>>> from phil_loop import ClosedLoop, settings
>>> record = ClosedLoop(settings(speed_kmh=250)).ride(1.0)
>>> record.rig.w_tr.shape
(500,)

What is named here is loaded when it is first asked for, so that a command line that only reads options loads nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from phil_loop.controllers import Controller
    from phil_loop.loop import ClosedLoop
    from phil_loop.observing import Moment, Observer
    from phil_loop.record import Record
    from phil_loop.resolution import resolve, settings
    from phil_loop.ride import Ride

__all__ = ["ClosedLoop", "Controller", "Moment", "Observer", "Record", "Ride", "resolve", "settings"]

_HOME = {
    "ClosedLoop": "loop",
    "Controller": "controllers",
    "Moment": "observing",
    "Observer": "observing",
    "Record": "record",
    "Ride": "ride",
    "resolve": "resolution",
    "settings": "resolution",
}


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'phil_loop' has no attribute '{name}'")
    return getattr(import_module(f"phil_loop.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
