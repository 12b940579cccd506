"""Further pantographs of the same train: they ride along on the wire, at fixed distances from the one at x = 0.

Each is a chain of masses (`pantograph`) that is coupled within the integration step, whatever acts at x = 0: a given
force, as from the rig, or a pantograph coupled as well. For the finite elements it is one more site of `sites`, a
spring that can only push; contacts within reach of each other are solved together. For the finite differences its
force follows in closed form from the wire's present height. Its uplift comes up as (1 - cos)/2 from cycle 0 on, when
all masses stand at the height of the wire.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model import pantograph
from catenary_model.cycle import soft_start_share, track_position
from catenary_model.pantograph import Pantograph
from phil_base.kernels import njit

Array = NDArray[np.float64]

AT, SPRING, SOFT_START, NODE, MASSES, REAL = range(6)
"""Columns of `Constants.beside`: place x (m), spring in series with the head's answer within a step (N/m), time in
which the uplift comes up (s), node of the grid (fd), number n of masses, and from REAL on `pantograph.Constants`: its
real, uplift, damping, stiffness, inverse."""
UPLIFT = REAL + 4
PLACE, FORCE, HEIGHT, LOST, HEAD, TOUCH, STATIC, SEAT, MOTION = range(9)
"""Columns of `State.aside`: place x (m), contact force (N), height of the contact point (m), time without contact since
the uplift is up (s); within a step: free height of the head over the static wire (m), contact, static height (m), site;
from MOTION on `pantograph.State`: its y and predicted."""

# All is in few arrays: each one more in the bundles makes every call that hands these on longer.


@dataclass(frozen=True)
class Companion:
    """A pantograph that rides along. Raises ValueError naming the field."""

    pantograph: Pantograph
    distance: float
    """From the pantograph at x = 0 back to this one, m; negative: it runs ahead."""
    soft_start: float = 2.0
    """Time in which its uplift comes up, s."""

    def __post_init__(self) -> None:
        if not math.isfinite(self.distance) or self.distance == 0.0:
            raise ValueError(f"distance = {self.distance} m must be finite and not 0")
        if not (math.isfinite(self.soft_start) and self.soft_start >= 0.0):
            raise ValueError(f"soft_start = {self.soft_start} s must be finite and at least 0")


class Bundle(NamedTuple):
    """What the companions add to a model's constants and to its state, see `layout`."""

    beside: Array
    riders: Array
    aside: Array


def bundle(
    several: Sequence[Companion], ts: float, newmark: tuple[float, float], local: float, spacing: float, middle: int
) -> Bundle:
    """Prepare companions for steps of ts (s) on a wire whose mesh lacks the compliance ``local`` (m/N) at the contact.

    Chains of fewer masses are led by masses that nothing moves, so that all have one size and the head is the last.
    """
    count = len(several)
    n = max((one.pantograph.uplift.size for one in several), default=1)
    beside = np.zeros((count, UPLIFT + n + 3 * n * n))
    for row, one in zip(beside, several, strict=True):
        own = pantograph.constants(padded(one.pantograph, n), ts, *newmark)
        head = newmark[0] * ts * ts * own.inverse[n - 1, n - 1]
        series = own.real[pantograph.CONTACT_COMPLIANCE] + head + local
        row[:REAL] = -one.distance, 1.0 / series, one.soft_start, middle + round(-one.distance / spacing), n
        matrices = (own.damping.ravel(), own.stiffness.ravel(), own.inverse.ravel())
        row[REAL:] = np.concatenate([own.real, own.uplift, *matrices])
    places = np.concatenate([[0.0], beside[:, AT]])
    order = np.argsort(places, kind="stable")
    return Bundle(beside, np.stack([places[order], -1.0 - order]), np.zeros((count, MOTION + 6 * n)))


def padded(rider: Pantograph, n: int) -> Pantograph:
    """Give the pantograph led by masses of 1 kg on springs of 1 N/m that nothing moves, n masses in all."""
    lacking = n - rider.uplift.size
    if not lacking:
        return rider
    mass, damping, stiffness = (np.zeros((n, n)) for _ in range(3))
    mass[:lacking, :lacking] = stiffness[:lacking, :lacking] = np.eye(lacking)
    mass[lacking:, lacking:], damping[lacking:, lacking:] = rider.mass, rider.damping
    stiffness[lacking:, lacking:] = rider.stiffness
    uplift = np.concatenate([np.zeros(lacking), rider.uplift])
    return Pantograph(mass, damping, stiffness, uplift, rider.contact_stiffness)


def motion(row: Array, n: int) -> Array:
    """Give displacement (m), velocity and acceleration of the n masses of a companion, (3, n), a view of its row."""
    return row[MOTION : MOTION + 3 * n].reshape(3, n)


def begin(several: Sequence[Companion], c: Any, s: Any) -> None:
    """Put all masses at the height of the static wire, for cycle 0."""
    zeta = float(track_position(c, s))
    for row, known, one in zip(s.aside, c.beside, several, strict=True):
        height = float(static_height(c.static, float(c.real["period"]), zeta + known[AT]))
        n, own = int(known[MASSES]), one.pantograph.uplift.size
        motion(row, n)[:, n - own :] = pantograph.at_rest(one.pantograph, height).y
        row[PLACE], row[HEIGHT] = known[AT], height


@njit(cache=True, fastmath=False)
def static_height(static: Array, period: float, zeta: float) -> float:
    """Height of the static contact wire (m) at a track position (m), from the model's table of it."""
    samples = static.shape[0] - 1
    at = zeta / period
    at = (at - np.floor(at)) * samples
    i = min(int(at), samples - 1)
    return float(static[i, 0] + (at - i) * (static[i + 1, 0] - static[i, 0]))


@njit(cache=True, fastmath=False)
def chain(row: Array) -> pantograph.Constants:
    """Put the constants of a companion together from its row of `Constants.beside`."""
    n = int(row[MASSES])
    d = UPLIFT + n
    k, i, end = d + n * n, d + 2 * n * n, d + 3 * n * n
    matrices = row[d:k].reshape((n, n)), row[k:i].reshape((n, n)), row[i:end].reshape((n, n))
    return pantograph.Constants(row[REAL:UPLIFT], matrices[0], matrices[1], matrices[2], row[UPLIFT:d])


@njit(cache=True, fastmath=False)
def masses(row: Array, n: int) -> pantograph.State:
    """Put the state of a companion of n masses together from its row of `State.aside`."""
    half, end = MOTION + 3 * n, MOTION + 6 * n
    return pantograph.State(row[MOTION:half].reshape((3, n)), row[half:end].reshape((3, n)))


@njit(cache=True, fastmath=False)
def lift(beside: Array, aside: Array, static: Array, period: float, t: float, zeta: float) -> None:
    """Move all companions to the instant t (s) as if there were no contact; where their heads would be is in HEAD."""
    for r in range(beside.shape[0]):
        share = soft_start_share(t, beside[r, SOFT_START])
        head = pantograph.free(chain(beside[r]), masses(aside[r], int(beside[r, MASSES])), share)
        height = static_height(static, period, zeta + beside[r, AT])
        aside[r, HEAD], aside[r, STATIC] = head - height, height


@njit(cache=True, fastmath=False)
def press(known: Array, row: Array, force: float, deviation: float, local: float, t: float, ts: float) -> None:
    """Complete the step of one companion to the instant t (s) with its contact force (N).

    ``deviation`` is the wire's there (m), ``local`` what the mesh lacks in compliance (m/N), ``ts`` the step (s).
    """
    pantograph.finish(chain(known), masses(row, int(known[MASSES])), force)
    row[FORCE] = force
    row[HEIGHT] = row[STATIC] + deviation + local * force
    if force <= 0.0 and t > known[SOFT_START]:
        row[LOST] += ts


@njit(cache=True, fastmath=False)
def meet(beside: Array, aside: Array, w: Array, local: float, t: float, ts: float) -> None:
    """Complete the step of all companions on a grid whose deviation of the instant t (s) is known, w (nodes,) in m.

    From y_free - c_p F = w + C F (`pantograph`), both compliances in the spring's.
    """
    for r in range(beside.shape[0]):
        deviation = w[int(beside[r, NODE])]
        force = max(0.0, beside[r, SPRING] * (aside[r, HEAD] - deviation))
        press(beside[r], aside[r], force, deviation, local, t, ts)


@njit(cache=True, fastmath=False)
def give(beside: Array, aside: Array, new: Array, carry: Array, per_force: float) -> None:
    """Add the forces of all companions to the new level of a grid (nodes,), carried on with these weights.

    ``per_force`` is what a newton moves a node by in a step, m/N.
    """
    half = carry.size // 2
    for r in range(beside.shape[0]):
        node = int(beside[r, NODE])
        for m in range(carry.size):
            new[node + half - m] += per_force * carry[m] * aside[r, FORCE]
