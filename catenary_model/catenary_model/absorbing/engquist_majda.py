"""Absorbing boundaries of B. Engquist and A. Majda, Math. Comp. 31 (1977) 629, discretised as boundary stencils."""

from __future__ import annotations

from typing import Literal

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.higdon import courant
from catenary_model.absorbing.stencil import Array, Stencil

TangentialMean = Literal["diagonal", "centred"]


def first_order(stencil: Stencil) -> BoundaryStencil:
    """First approximation, w_t - c w_x = 0 at the left, in a box of two nodes and two levels.

    The box is centred at (dx / 2, n + 1/2); plane waves at angle a reflect (1 - cos a) / (1 + cos a) on a fine grid.
    """
    r = courant(stencil)
    operator = np.zeros((2, 2, 1))
    operator[0, 0], operator[0, 1] = 1.0 + r, 1.0 - r
    operator[1, 0], operator[1, 1] = r - 1.0, -1.0 - r
    return _explicit(operator)


def second_order(stencil: Stencil, mean: TangentialMean = "diagonal") -> BoundaryStencil:
    """Second approximation, w_xt - w_tt / c + c / 2 w_yy = 0 at the left, centred at (dx / 2, n).

    Plane waves at angle a reflect ((1 - cos a) / (1 + cos a))^2 on a fine grid.

    Args:
        stencil: of the 2-D wave equation.
        mean: how w_yy is brought to the middle between the two nodes: "diagonal" is the mean of the outer node at
            n - 1 and the inner one at n + 1, "centred" the mean of both at n, the form known from G. Mur, IEEE Trans.
            EMC 23 (1981) 377. Both are explicit and of second order; compare with both.

    Raises:
        ValueError: the mean is neither of the two.
    """
    r, r_y = courant(stencil), courant(stencil) * stencil.dx[0] / stencil.dx[1]
    operator = np.zeros((3, 2, 3))
    for k, sign in ((1, 1.0), (0, -1.0)):
        operator[0, k, 1] += sign * r / 2.0
        operator[2, k, 1] -= sign * r / 2.0
        operator[:, k, 1] += np.array([-0.5, 1.0, -0.5])
    if mean not in ("diagonal", "centred"):
        raise ValueError(f'the mean is "diagonal" or "centred", not {mean!r}')
    points = ((2, 0), (0, 1)) if mean == "diagonal" else ((1, 0), (1, 1))
    for level, k in points:
        operator[level, k] += r_y**2 / 4.0 * np.array([1.0, -2.0, 1.0])
    return _explicit(operator)


def continuous(degrees: Array, order: int) -> Array:
    """Reflection of the PDE's boundary condition itself, ((1 - cos a) / (1 + cos a))^order."""
    cosine = np.cos(np.radians(degrees))
    return np.asarray(((1.0 - cosine) / (1.0 + cosine)) ** order)


def _explicit(operator: Array) -> BoundaryStencil:
    """Solve sum operator[l, k, m] w = 0 for the new value of the outermost node."""
    centre = operator.shape[2] // 2
    coefficients = -operator / operator[0, 0, centre]
    coefficients[0, 0, centre] = 0.0
    return BoundaryStencil(coefficients[None])
