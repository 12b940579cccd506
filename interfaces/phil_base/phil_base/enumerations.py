"""Numbers of the messages that have a name: modes of the rig, correction, solver and environment of a command.

Whoever runs without ROS takes them from here, a node from here too; a test compares every name and number with the
constants of RigState.msg and ImpedanceCommand.msg. Members are ints: they compare with what a message or a bag carries.
"""

from __future__ import annotations

from enum import IntEnum


class Named(IntEnum):
    """Constants of a message, with the words that tables, reports and diagnostics say."""

    @property
    def words(self) -> str:
        """Name in small letters, with blanks."""
        return self.name.lower().replace("_", " ")


class Mode(Named):
    """What the drive did between t_(k-1) and t_k: MODE_* of RigState."""

    HOLD = 0
    TRACKING = 1
    BRIDGING = 2
    HOLDING = 3
    RETRACTING = 4
    STOPPED = 5
    POSITION = 6
    APPROACHING = 7
    LANDING = 8


FOLLOWING = (Mode.TRACKING, Mode.BRIDGING, Mode.HOLDING)
"""Modes of a drive that does as it is told; in all others its force goes to the environment, but not into the books."""


class SolverStatus(Named):
    """How the plan of a command was found, of ImpedanceCommand."""

    SOLVED = 0
    """The quadratic program was solved to its tolerance."""
    FALLBACK = 2
    """It was not: the plan of the cycle before, shifted by one cycle."""


class Correction(Named):
    """What became of the bounds (3.49) on the correction force: CORRECTION_* of ImpedanceCommand."""

    OFF = 0
    """Correction force switched off."""
    ACTIVE = 1
    """Bounds of (3.49) are enforced as they are."""
    CAPPED = 2
    """Bounds of (3.49) were cut by the cap or the rate limit."""
    PROJECTED = 3
    """Bounds of (3.49) and what cap and rate limit allow do not meet: the nearest end of the latter is used."""
    DEAD_ZONE = 4
    """The wire is too slow for the force to move energy: the force is free within cap and rate limit."""
    SETTLED = 5
    """The energy error is within its tolerance: the force is free within cap and rate limit, to work off momentum."""


class EnvironmentKind(Named):
    """What the rig is to behave like: ENVIRONMENT_* of ImpedanceCommand."""

    CATENARY = 0
    REDUCED = 1
    MASS_SPRING_DAMPER = 2
