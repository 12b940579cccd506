"""A pantograph on the moving catenary, coupled within the step: what the rig should feel if there were no rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import pantograph
from catenary_model.observed import MovingCatenary
from catenary_model.pantograph import Pantograph

Array = NDArray[np.float64]

PIECE = 500
"""Cycles after which a ride tells its progress."""


@dataclass(frozen=True)
class Ride:
    """What a ride gave, one entry a cycle, the first at the end of the first cycle; each array (cycles,)."""

    t: Array
    """Time, s."""
    w: Array
    """Displacement of the contact point, m."""
    v: Array
    """Its velocity in the frame of the train, m/s."""
    F: Array
    """Contact force, N."""
    track: Array
    """Track position, m."""
    slack_droppers: Array
    """Slack droppers in the domain."""


def _record(catenary: MovingCatenary, out: Array) -> Ride:
    last = catenary.cycle
    t: Array = catenary.config.cycle_time * np.arange(last - len(out) + 1, last + 1, dtype=np.float64)
    return Ride(t, *(np.ascontiguousarray(column) for column in out.T))


def joined(parts: Sequence[Ride]) -> Ride:
    """Join records that follow one another."""
    return Ride(*(np.concatenate(columns) for columns in zip(*(astuple(part) for part in parts), strict=True)))


def push(catenary: MovingCatenary, force: Array) -> Ride:
    """Go on from the present state with a given contact force a cycle (N), as `Catenary.step` takes it."""
    given = np.ascontiguousarray(force, dtype=np.float64)
    out = np.zeros((given.size, 5))
    catenary.push_on(given, out)
    return _record(catenary, out)


class Coupled:
    """A pantograph on a catenary: rides of any length, piece by piece, in constant memory.

    >>> from catenary_model.build import Config, build
    >>> train = Coupled(build(Config()), Pantograph.of([20.0], [[100.0]], [[50.0]], 120.0))
    >>> bool(train.go_on(1500).F[-1] > 0.0)
    True
    """

    def __init__(self, catenary: MovingCatenary, rider: Pantograph, soft_start: float = 2.0) -> None:
        """Reset the catenary and put the pantograph under it, at full speed, all masses at the height of the wire.

        Within the first `soft_start` s the uplift comes up as (1 - cos)/2, as in `reference.Reference.ride`.
        """
        config = catenary.config
        catenary.reset()
        self.catenary = catenary
        self._soft_start = float(soft_start)
        self._constants = pantograph.constants(rider, config.step_time, *catenary.rider_newmark)
        self._state = pantograph.at_rest(rider, catenary.w_cat)

    def strike(self, velocity: float) -> None:
        """Add this velocity (m/s, up positive) to all masses of the pantograph, as a blow does."""
        self._state.y[1] += velocity

    def go_on(self, cycles: int, held: float | None = None) -> Ride:
        """Ride on for some cycles; `held` is a contact force (N) that acts on both sides in place of the contact."""
        out = np.zeros((cycles, 5))
        given = math.nan if held is None else float(held)
        self.catenary.ride_on(self._constants, self._state, self._soft_start, given, out)
        return _record(self.catenary, out)


def ride(
    catenary: MovingCatenary,
    rider: Pantograph,
    duration: float,
    soft_start: float = 2.0,
    progress: Callable[[float], None] | None = None,
) -> Ride:
    """Ride `duration` seconds from rest; within the first `soft_start` of them the uplift comes up as (1 - cos)/2.

    The catenary is reset first. `progress` is told the share that is done. Raises ValueError for a duration below one
    cycle.
    """
    cycles = round(duration / catenary.config.cycle_time)
    if cycles < 1:
        raise ValueError(f"duration = {duration} s is shorter than one cycle")
    train = Coupled(catenary, rider, soft_start)
    parts = []
    for first in range(0, cycles, PIECE):
        parts.append(train.go_on(min(PIECE, cycles - first)))
        if progress:
            progress(min(first + PIECE, cycles) / cycles)
    return joined(parts)
