"""Books of the energy and the momentum that are exchanged on both sides of the emulation, eqs. (3.46), (3.47).

The controller keeps its own books; these are made from the messages of the other nodes alone, so that a slip there
shows. :class:`Books` adds one cycle at a time, :func:`books_of` does whole rides; both give the same bits because they
add the same products in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Books:
    """Running sums of (3.46) and (3.47) since cycle 0, a cycle at a time.

    ``e_tr``, ``e_cat``, ``exchanged_energy`` in J, ``p_tr``, ``p_cat``, ``exchanged_momentum`` in N s.
    """

    __slots__ = ("cycles", "e_cat", "e_tr", "exchanged_energy", "exchanged_momentum", "p_cat", "p_tr", "ts")

    def __init__(self, ts: float) -> None:
        """Open empty books for the cycle time ``ts`` in s."""
        self.ts = ts
        self.clear()

    def clear(self) -> None:
        """Set every sum to zero."""
        self.cycles = 0
        self.e_tr = self.e_cat = self.exchanged_energy = 0.0
        self.p_tr = self.p_cat = self.exchanged_momentum = 0.0

    def add(self, f_tr: float, v_tr: float, f_cat: float, v_cat: float) -> None:
        """Enter one cycle: forces in N, velocities in m/s, all of cycle k; ``f_cat`` is F_tr + F_cor (3.45)."""
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

    @property
    def delta_e(self) -> float:
        """Energy error dE in J, eq. (3.46)."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> float:
        """Momentum error dp = p_tr - p_cat = -sum Ts F_cor in N s, eq. (3.47) with its sign corrected."""
        return self.p_tr - self.p_cat


@dataclass(frozen=True)
class BooksHistory:
    """The books after each cycle of a ride; every array has the length of the ride, units as in :class:`Books`."""

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


def books_of(f_tr: Array, v_tr: Array, f_cat: Array, v_cat: Array, ts: float) -> BooksHistory:
    """Keep the books of a whole ride: arrays of one entry a cycle (N, m/s), ``ts`` in s.

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
        e_tr=np.cumsum(energy_tr),
        e_cat=np.cumsum(momentum_cat * v_cat),
        p_tr=np.cumsum(momentum_tr),
        p_cat=np.cumsum(momentum_cat),
        exchanged_energy=np.cumsum(np.abs(energy_tr)),
        exchanged_momentum=np.cumsum(np.abs(momentum_tr)),
    )
