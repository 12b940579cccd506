"""What an operator can do during a ride, as actions for `ClosedLoop.ride`: services and live parameters of the nodes.

An action is anything that takes the loop; these are the usual ones:

>>> from phil_loop import ClosedLoop, settings
>>> loop = ClosedLoop(settings(duration=6.0))
>>> loop.ride(events={0.3: environment("reduced"), 0.5: correction(False), 0.8: land}).outcome
'landed'
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

Action = Callable[[Any], object]
"""Takes the loop."""
Events = Mapping[int | float, Action | Sequence[Action]]
"""Cycle (an integer) or time in s (a float) to what is done right before the command of that cycle, in that order."""


class Operated(Protocol):
    """What an operator can do to a loop; `phil_loop.ClosedLoop` is one."""

    def land(self) -> object:
        """Part softly from the pantograph."""

    def emergency_stop(self) -> object:
        """Go to the safe position."""


def land(loop: Operated) -> None:
    """Part softly from the pantograph and rest there."""
    loop.land()


def emergency_stop(loop: Operated) -> None:
    """Go to the safe position and rest there."""
    loop.emergency_stop()


def operation(name: str) -> Action:
    """Choose the rig's operating mode: hold, position or impedance."""
    return lambda loop: loop.select_operation(name)


def environment(name: str) -> Action:
    """Let the drive follow another environment: catenary, reduced or mass_spring_damper."""
    return lambda loop: loop.select_environment(name)


def correction(on: bool) -> Action:
    """Switch the correction force on or off."""
    return lambda loop: loop.set_correction(on)


def control(name: str) -> Action:
    """Choose the control scheme, see `impedance_mpc.control`."""
    return lambda loop: loop.set_control(name)


def uplift_force(force: float) -> Action:
    """Change the pantograph's uplift force (N)."""
    return lambda loop: loop.set_uplift_force(force)


def by_cycle(events: Events, ts: float) -> dict[int, tuple[Action, ...]]:
    """Give the actions by the cycle k with t_k = k ts nearest to their time.

    Raises
    ------
    ValueError
        A time or cycle is negative or no number.
    """
    found: dict[int, tuple[Action, ...]] = {}
    for when, what in events.items():
        if isinstance(when, bool) or not isinstance(when, (int, float)) or not 0 <= when < float("inf"):
            raise ValueError(f"events: {when!r} is neither a cycle (integer) nor a time in s (float), 0 or above")
        cycle = when if isinstance(when, int) else round(when / ts)
        actions = (what,) if callable(what) else tuple(what)
        found[cycle] = (*found.get(cycle, ()), *actions)
    return found
