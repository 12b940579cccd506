"""Products of first-order absorbing factors: R. L. Higdon, Math. Comp. 47 (1986) 437 and 49 (1987) 65."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.stencil import Array, Stencil


class Factor(NamedTuple):
    """One factor cosine d/dt - c d/dx + damping / dt at a left boundary, in a box of two nodes and two levels.

    A plane wave whose angle of incidence has this cosine satisfies it exactly (in the limit of a fine grid).
    """

    cosine: float
    space: float = 0.5
    """Weight of the inner node in the time difference; the outer one has 1 - space."""
    time: float = 0.5
    """Weight of the old level in the space difference; the new one has 1 - time."""
    damping: float = 0.0
    """A positive one pulls a constant offset to zero, which every boundary for waves without it accepts."""


LOWER = Factor(0.05, 0.0, 0.0, 0.0)
UPPER = Factor(1.5, 0.5, 0.5, 1.0)
"""Limits of a stable factor, see `box`; those of the cosine and of the damping only say what is sensible."""


def courant(stencil: Stencil) -> float:
    """Courant number c dt / dx of a 2-D wave equation along the normal (axis 0).

    Raises:
        ValueError: the stencil does not name its wave speed c, or is not two-dimensional.
    """
    c = dict(stencil.parameters).get("c")
    if c is None or stencil.dims != 2:
        raise ValueError(f"{stencil.name} is not a 2-D wave equation with a wave speed c among its parameters")
    return c * stencil.dt / stencil.dx[0]


def box(factor: Factor, courant_number: float) -> Array:
    """Coefficients f[l, k] of a factor, sum_lk f[l, k] w[k, n + 1 - l] = 0 with f[0, 0] = 1.

    With M_t = 1 - a + a / z, M_x = 1 - b + b xi (a, b the weights `time`, `space`) a wave xi^k z^n leaves the residual

        M_t M_x (cosine (1 - 1 / z) / M_t + r (1 - xi) / M_x + damping).

    For a, b <= 1/2 both fractions have a real part >= 0 where |z| >= 1 and |xi| <= 1, that is for the waves that go
    inwards, so with a positive damping the residual vanishes for none of them: no mode grows. And where waves
    propagate (|z| = |xi| = 1) the outgoing one has the conjugate of the second fraction, whose imaginary part has the
    sign of that of the first one for the inward wave: its residual is the smaller one, |reflection| <= 1.

    Args:
        factor: its constants.
        courant_number: c dt / dx.

    Returns:
        Shape (2, 2).
    """
    cosine, space, time, damping = factor
    node, level = np.array([1.0 - space, space]), np.array([1.0 - time, time])
    later, inwards = np.array([1.0, -1.0]), np.array([1.0, -1.0])
    operator = (
        cosine * np.outer(later, node) + courant_number * np.outer(level, inwards) + damping * np.outer(level, node)
    )
    return np.asarray(operator / operator[0, 0])


def compose(first: Array, second: Array) -> Array:
    """Coefficients of two difference operators applied one after the other: their convolution."""
    out = np.zeros((first.shape[0] + second.shape[0] - 1, first.shape[1] + second.shape[1] - 1))
    for level, k in np.ndindex(first.shape):
        out[level : level + second.shape[0], k : k + second.shape[1]] += first[level, k] * second
    return out


def product(factors: Sequence[Factor], courant_number: float) -> BoundaryStencil:
    """Product of first-order factors as an explicit boundary of one node, p + 1 nodes deep and p old levels long.

    Every factor that is stable on its own keeps the product stable (Higdon 1987), and the reflection coefficients
    multiply.

    Args:
        factors: at least one.
        courant_number: c dt / dx along the normal.

    Raises:
        ValueError: there is no factor, or one lies outside the limits `LOWER` and `UPPER`.
    """
    if not factors:
        raise ValueError("a product needs at least one factor")
    for factor in factors:
        for name, value, low, high in zip(Factor._fields, factor, LOWER, UPPER, strict=True):
            if not low <= value <= high:
                raise ValueError(f"{name} of a factor must lie between {low} and {high}, not {value}")
    operator = reduce(compose, (box(f, courant_number) for f in factors))
    coefficients = -operator
    coefficients[0, 0] = 0.0
    return BoundaryStencil(coefficients[None, :, :, None])


def higdon(stencil: Stencil, degrees: Sequence[float], damping: float = 0.0) -> BoundaryStencil:
    """Higdon's boundary that absorbs plane waves at the given angles of incidence.

    Args:
        stencil: of the 2-D wave equation.
        degrees: angles of incidence, one a factor; equal ones give a zero of higher order.
        damping: of every factor.
    """
    return product([Factor(math.cos(math.radians(d)), damping=damping) for d in degrees], courant(stencil))


def diagonal(stencil: Stencil, order: int = 1, damping: float = 0.0) -> Array:
    """Corner rule: a product along the diagonal of the grid, for waves that run into the corner at 45 degrees.

    Nodes on the diagonal are sqrt(dx^2 + dy^2) apart; only the corner itself lies on a boundary, so the rule is
    explicit whatever the sides do.

    Returns:
        Coefficients (1 + N_t, N_x) of the explicit update, entry [l, k] for the node (k, k) from the corner at level
        n + 1 - l.
    """
    r = courant(stencil) * stencil.dx[0] / math.hypot(*stencil.dx)
    return product([Factor(1.0, damping=damping)] * order, r).coefficients[0, :, :, 0]
