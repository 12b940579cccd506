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
from catenary_model.layout import STEPS
from catenary_model.pantograph import Pantograph
from phil_base.kernels import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

AT, SPRING, SOFT_START, NODE = range(4)
"""Columns of `Constants.beside`: place x (m), spring in series with the head's answer within a step (N/m), time in
which the uplift comes up (s), node of the grid (fd)."""
PLACE, FORCE, HEIGHT, LOST, HEAD, TOUCH, STATIC = range(7)
"""Columns of `State.aside`: place x (m), contact force (N), height of the contact point (m), time without contact since
the uplift is up (s); within a step: free height of the head over the static wire (m), contact, static height (m)."""


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
    numbers: Array
    chains: Array
    lifts: Array
    riders: Array
    rows: Ints
    aside: Array
    masses: Array
    seats: Ints


def bundle(
    several: Sequence[Companion], ts: float, newmark: tuple[float, float], local: float, spacing: float, middle: int
) -> Bundle:
    """Prepare companions for steps of ts (s) on a wire whose mesh lacks the compliance ``local`` (m/N) at the contact.

    Chains of fewer masses are led by masses that nothing moves, so that all have one size and the head is the last.
    """
    count = len(several)
    n = max((one.pantograph.uplift.size for one in several), default=1)
    beside, numbers = np.zeros((count, 4)), np.zeros((count, 4))
    chains, lifts = np.zeros((count, 3, n, n)), np.zeros((count, n))
    for r, one in enumerate(several):
        own = pantograph.constants(padded(one.pantograph, n), ts, *newmark)
        numbers[r] = own.real
        chains[r, 0], chains[r, 1], chains[r, 2], lifts[r] = own.damping, own.stiffness, own.inverse, own.uplift
        head = newmark[0] * ts * ts * own.inverse[n - 1, n - 1]
        series = own.real[pantograph.CONTACT_COMPLIANCE] + head + local
        beside[r] = -one.distance, 1.0 / series, one.soft_start, middle + round(-one.distance / spacing)
    places = np.concatenate([[0.0], beside[:, AT]])
    order = np.argsort(places, kind="stable")
    return Bundle(
        beside=beside,
        numbers=numbers,
        chains=chains,
        lifts=lifts,
        riders=places[order],
        rows=-1 - order.astype(np.int64),
        aside=np.zeros((count, 7)),
        masses=np.zeros((count, 2, 3, n)),
        seats=np.zeros(1 + count, dtype=np.int64),
    )


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


def begin(several: Sequence[Companion], c: Any, s: Any) -> None:
    """Put all masses at the height of the static wire, for cycle 0."""
    zeta = float(track_position(c, s))
    n = s.masses.shape[3]
    for r, one in enumerate(several):
        height = float(static_height(c.static, float(c.real["period"]), zeta + c.beside[r, AT]))
        own = one.pantograph.uplift.size
        s.masses[r, 0, :, n - own :] = pantograph.at_rest(one.pantograph, height).y
        s.aside[r, PLACE], s.aside[r, HEIGHT] = c.beside[r, AT], height


@njit(cache=True, fastmath={"contract"})
def static_height(static: Array, period: float, zeta: float) -> float:
    """Height of the static contact wire (m) at a track position (m), from the model's table of it."""
    samples = static.shape[0] - 1
    at = zeta / period
    at = (at - np.floor(at)) * samples
    i = min(int(at), samples - 1)
    return float(static[i, 0] + (at - i) * (static[i + 1, 0] - static[i, 0]))


@njit(cache=True, fastmath=False)
def lift(c: Any, s: Any) -> None:
    """Move all companions to the new instant as if there were no contact; where their heads would be is in HEAD."""
    t = c.real.ts * s.counter[STEPS]
    zeta = track_position(c, s)
    for r in range(c.beside.shape[0]):
        chain = pantograph.Constants(c.numbers[r], c.chains[r, 0], c.chains[r, 1], c.chains[r, 2], c.lifts[r])
        state = pantograph.State(s.masses[r, 0], s.masses[r, 1])
        head = pantograph.free(chain, state, soft_start_share(t, c.beside[r, SOFT_START]))
        static = static_height(c.static, c.real.period, zeta + c.beside[r, AT])
        s.aside[r, HEAD], s.aside[r, STATIC] = head - static, static


@njit(cache=True, fastmath=False)
def press(c: Any, s: Any, r: int, force: float) -> None:
    """Complete the step of companion r with its contact force (N)."""
    chain = pantograph.Constants(c.numbers[r], c.chains[r, 0], c.chains[r, 1], c.chains[r, 2], c.lifts[r])
    pantograph.finish(chain, pantograph.State(s.masses[r, 0], s.masses[r, 1]), force)
    s.aside[r, FORCE] = force
    if force <= 0.0 and c.real.ts * s.counter[STEPS] > c.beside[r, SOFT_START]:
        s.aside[r, LOST] += c.real.ts


@njit(cache=True, fastmath=False)
def note_height(c: Any, s: Any, r: int, deviation: float) -> None:
    """Note the height of the contact point of companion r for the wire's deviation there (m)."""
    s.aside[r, HEIGHT] = s.aside[r, STATIC] + deviation + c.real.compliance * s.aside[r, FORCE]
