"""What an observer of a ride gets to see in each cycle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from impedance_mpc.controller import EnvironmentReading
from impedance_mpc.cycle import Answer
from phil_base.enumerations import FOLLOWING
from test_rig_sim.rig import RigSample

if TYPE_CHECKING:
    from phil_loop.loop import ClosedLoop


class Moment:
    """A cycle as an observer sees it: everything at t_k, the command of cycle k, and nothing moved yet.

    One object for the whole ride, and the arrays in ``wire`` are views: copy what is to be kept.
    """

    __slots__ = ("command", "cycle", "loop", "mode", "rig", "wire")

    loop: ClosedLoop
    cycle: int
    """k."""
    mode: int
    """What the drive did until t_k, `RigState.mode`."""
    rig: RigSample
    """The rig at t_k, with what only a simulation knows."""
    wire: EnvironmentReading
    """The catenary at t_k, with the segment."""
    command: Answer
    """The command of cycle k."""

    @property
    def following(self) -> bool:
        """Whether the rig did as it was told until t_k."""
        return self.mode in FOLLOWING


class Observer(Protocol):
    """Called once a cycle; may call `ClosedLoop.stop`."""

    def __call__(self, moment: Moment, /) -> object:
        """Take what happened."""
