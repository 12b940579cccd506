"""Books of the energy and the momentum that are exchanged on both sides of the emulation, eqs. (3.46), (3.47).

Two of them. The printed sums take force and velocity of both sides at one instant t_k, F_cat(k) being the force that
acts on the wire there. The accumulated work and impulse are those that either side integrated between its samples: what
happens there, and the delay of the loop, are in these alone. Both count the cycles in which the rig follows the
catenary; what is exchanged while it holds, retracts or follows something else belongs to no emulation of the wire.

The controller keeps its own books; these are made from the messages of the other nodes alone, so that a slip there
shows. :class:`Books` adds one cycle at a time, :func:`books_of` and :func:`accumulated_of` do whole rides; both give
the same bits because they add the same numbers in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Meters(NamedTuple):
    """What rig and catenary have accumulated until t_k, since their cycle 0."""

    work_tr: float
    """J, done on the rig."""
    work_cat: float
    """J, done on the wire."""
    impulse_tr: float
    """N s, given to the rig."""
    impulse_cat: float
    """N s, given to the wire."""


class Books:
    """Both books since cycle 0, a cycle at a time.

    ``e_tr``, ``e_cat``, ``exchanged_energy`` in J, ``p_tr``, ``p_cat``, ``exchanged_momentum`` in N s are the sums;
    ``accumulated`` is what the meters of both sides counted.
    """

    __slots__ = (
        "_read",
        "accumulated",
        "cycles",
        "e_cat",
        "e_tr",
        "exchanged_energy",
        "exchanged_momentum",
        "p_cat",
        "p_tr",
        "ts",
    )

    def __init__(self, ts: float) -> None:
        """Open empty books for the cycle time ``ts`` in s."""
        self.ts = ts
        self.clear()

    def clear(self) -> None:
        """Set every sum to zero and forget the meters."""
        self.cycles = 0
        self.e_tr = self.e_cat = self.exchanged_energy = 0.0
        self.p_tr = self.p_cat = self.exchanged_momentum = 0.0
        self.accumulated = Meters(0.0, 0.0, 0.0, 0.0)
        self._read: Meters | None = None

    def add(self, f_tr: float, v_tr: float, f_cat: float, v_cat: float) -> None:
        """Enter one cycle into the sums: forces in N, velocities in m/s, all at t_k."""
        momentum_tr = self.ts * f_tr
        momentum_cat = self.ts * f_cat
        energy_tr = momentum_tr * v_tr
        self.e_tr += energy_tr
        self.e_cat += momentum_cat * v_cat
        self.exchanged_energy += abs(energy_tr)
        self.p_tr += momentum_tr
        self.p_cat += momentum_cat
        self.exchanged_momentum += abs(momentum_tr)
        self.cycles += 1

    def read(self, meters: Meters, counted: bool) -> None:
        """Read the meters at t_k; what they went on since the last reading is entered if it is to be counted."""
        before, self._read = self._read, meters
        if counted and before is not None:
            self.accumulated = Meters(
                *(total + (new - old) for total, new, old in zip(self.accumulated, meters, before, strict=True))
            )

    @property
    def delta_e(self) -> float:
        """Energy error dE in J, eq. (3.46)."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> float:
        """Momentum error dp = p_tr - p_cat in N s, eq. (3.47) with its sign corrected."""
        return self.p_tr - self.p_cat

    @property
    def delta_work(self) -> float:
        """Energy error by the accumulated work, J."""
        return self.accumulated.work_tr - self.accumulated.work_cat

    @property
    def delta_impulse(self) -> float:
        """Momentum error by the accumulated impulse, N s."""
        return self.accumulated.impulse_tr - self.accumulated.impulse_cat


@dataclass(frozen=True)
class BooksHistory:
    """The sums after each cycle of a ride; every array has the length of the ride, units as in :class:`Books`."""

    e_tr: Array
    e_cat: Array
    p_tr: Array
    p_cat: Array
    exchanged_energy: Array
    exchanged_momentum: Array

    @property
    def delta_e(self) -> Array:
        """Energy error dE(k) in J, eq. (3.46)."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> Array:
        """Momentum error dp(k) in N s, eq. (3.47) with its sign corrected."""
        return self.p_tr - self.p_cat


@dataclass(frozen=True)
class MetersHistory:
    """What the meters counted until each cycle of a ride; every array has the length of the ride, J and N s."""

    work_tr: Array
    work_cat: Array
    impulse_tr: Array
    impulse_cat: Array

    @property
    def delta_work(self) -> Array:
        """Energy error by the accumulated work in J."""
        return self.work_tr - self.work_cat

    @property
    def delta_impulse(self) -> Array:
        """Momentum error by the accumulated impulse in N s."""
        return self.impulse_tr - self.impulse_cat


def books_of(
    f_tr: Array, v_tr: Array, f_cat: Array, v_cat: Array, ts: float, counted: Flags | None = None
) -> BooksHistory:
    """Sum up a whole ride: arrays of one entry a cycle (N, m/s), ``ts`` in s; ``counted`` tells which cycles count.

    Raises
    ------
    ValueError
        The arrays differ in shape.
    """
    if not f_tr.shape == v_tr.shape == f_cat.shape == v_cat.shape:
        raise ValueError(f"shapes differ: {f_tr.shape}, {v_tr.shape}, {f_cat.shape}, {v_cat.shape}")
    momentum_tr, momentum_cat = ts * f_tr, ts * f_cat
    energy_tr = momentum_tr * v_tr
    return BooksHistory(
        e_tr=_summed(energy_tr, counted),
        e_cat=_summed(momentum_cat * v_cat, counted),
        p_tr=_summed(momentum_tr, counted),
        p_cat=_summed(momentum_cat, counted),
        exchanged_energy=_summed(np.abs(energy_tr), counted),
        exchanged_momentum=_summed(np.abs(momentum_tr), counted),
    )


def accumulated_of(
    work_tr: Array, work_cat: Array, impulse_tr: Array, impulse_cat: Array, counted: Flags | None = None
) -> MetersHistory:
    """Count a whole ride by its meters (J, N s), one entry a cycle; the first entry is where the count begins."""
    return MetersHistory(
        *(_summed(np.diff(meter, prepend=meter[:1]), counted) for meter in (work_tr, work_cat, impulse_tr, impulse_cat))
    )


def _summed(terms: Array, counted: Flags | None) -> Array:
    return np.asarray(np.cumsum(terms if counted is None else np.where(counted, terms, 0.0)), dtype=np.float64)
