"""A pantograph on the moving catenary, coupled within the step: what the rig should feel if there were no rig."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from catenary_model import layout, pantograph, step
from catenary_model.layout import Constants, State
from catenary_model.model import Catenary
from catenary_model.pantograph import Pantograph

Array = NDArray[np.float64]

W, V, F, TRACK, SLACK_DROPPERS = range(5)
_CHUNK = 500


@njit(cache=True, fastmath=False)
def _note(s: State, force: float, row: Array) -> None:
    """Write one row of a record."""
    row[W] = s.point[layout.W_CAT]
    row[V] = s.point[layout.V_CAT]
    row[F] = force
    row[TRACK] = s.point[layout.ZETA]
    row[SLACK_DROPPERS] = s.counter[layout.SLACK]


@njit(cache=True, fastmath=False)
def _run(
    c: Constants,
    s: State,
    pc: pantograph.Constants,
    ps: pantograph.State,
    soft_start: float,
    held: float,
    out: Array,
) -> None:
    """Ride as many cycles as `out` has rows; the uplift comes up within the first soft_start s as (1 - cos)/2.

    `held` is a contact force (N) on both sides in place of the contact, or NaN.
    """
    n = pc.uplift.size
    own = pc.real[pantograph.BETA] * pc.real[pantograph.TS] ** 2 * pc.inverse[n - 1, n - 1]
    local = c.real[layout.COMPLIANCE]
    if np.isnan(held):
        s.contact[layout.K_CONTACT] = 1.0 / (pc.real[pantograph.CONTACT_COMPLIANCE] + own + local)
    else:
        s.contact[layout.GIVEN] = held
    force = 0.0
    for k in range(out.shape[0]):
        s.counter[layout.ITERATIONS] = 0
        for _ in range(c.whole[layout.SUBSTEPS]):
            t = c.real[layout.TS] * (s.counter[layout.STEPS] + 1)
            share = 0.5 - 0.5 * np.cos(np.pi * t / soft_start) if t < soft_start else 1.0
            head = pantograph.free(pc, ps, share)
            zeta = c.real[layout.START] + c.real[layout.SPEED] * t
            step.static_at(c, zeta, s.scratch)
            s.contact[layout.HEAD] = head - s.scratch[0]
            step.substep(c, s)
            force = step.contact_force(s)
            pantograph.finish(pc, ps, force)
        step.observe(c, s, force)
        _note(s, force, out[k])
    s.contact[layout.K_CONTACT] = 0.0
    s.contact[layout.LAST_FORCE] = force


@njit(cache=True, fastmath=False)
def _push(c: Constants, s: State, force: Array, out: Array) -> None:
    """Advance one cycle a given force (N)."""
    for k in range(force.size):
        step.advance(c, s, force[k])
        _note(s, force[k], out[k])


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


def _record(catenary: Catenary, out: Array) -> Ride:
    last = catenary.cycle
    t: Array = catenary.config.cycle_time * np.arange(last - len(out) + 1, last + 1, dtype=np.float64)
    return Ride(t, *(np.ascontiguousarray(column) for column in out.T))


def joined(parts: Sequence[Ride]) -> Ride:
    """Join records that follow one another."""
    return Ride(*(np.concatenate(columns) for columns in zip(*(astuple(part) for part in parts), strict=True)))


def push(catenary: Catenary, force: Array) -> Ride:
    """Go on from the present state with a given contact force a cycle (N), as `Catenary.step` takes it."""
    given = np.ascontiguousarray(force, dtype=np.float64)
    out = np.zeros((given.size, 5))
    _push(catenary.constants, catenary.state, given, out)
    return _record(catenary, out)


class Coupled:
    """A pantograph on a catenary: rides of any length, piece by piece, in constant memory.

    >>> from catenary_model.model import Config
    >>> train = Coupled(Catenary(Config()), Pantograph.of([20.0], [[100.0]], [[50.0]], 120.0))
    >>> bool(train.go_on(1500).F[-1] > 0.0)
    True
    """

    def __init__(self, catenary: Catenary, rider: Pantograph, soft_start: float = 2.0) -> None:
        """Reset the catenary and put the pantograph under it, at full speed, all masses at the height of the wire.

        Within the first `soft_start` s the uplift comes up as (1 - cos)/2, as in `reference.Reference.ride`.
        """
        config = catenary.config
        catenary.reset()
        self.catenary = catenary
        self._soft_start = float(soft_start)
        self._constants = pantograph.constants(rider, config.step_time, config.newmark_beta, config.newmark_gamma)
        self._state = pantograph.at_rest(rider, catenary.w_cat)

    def strike(self, velocity: float) -> None:
        """Add this velocity (m/s, up positive) to all masses of the pantograph, as a blow does."""
        self._state.y[1] += velocity

    def go_on(self, cycles: int, held: float | None = None) -> Ride:
        """Ride on for some cycles; `held` is a contact force (N) that acts on both sides in place of the contact."""
        out = np.zeros((cycles, 5))
        c, s = self.catenary.constants, self.catenary.state
        _run(c, s, self._constants, self._state, self._soft_start, math.nan if held is None else float(held), out)
        return _record(self.catenary, out)


def ride(
    catenary: Catenary,
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
    for first in range(0, cycles, _CHUNK):
        parts.append(train.go_on(min(_CHUNK, cycles - first)))
        if progress:
            progress(min(first + _CHUNK, cycles) / cycles)
    return joined(parts)
