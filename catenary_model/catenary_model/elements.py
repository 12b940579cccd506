"""Hermite elements for a beam under tension: shape functions and their integrals (thesis 3.1.2.2, Fig. 3.4).

An element of length h has the degrees of freedom (w_1, phi_1, w_2, phi_2), phi = w_x, and the shape functions
psi(xi) with xi in [0, 1]. All integrals are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phil_base.kernels import njit

Matrix = NDArray[np.float64]


@njit(cache=True, fastmath=False)
def shape_functions(xi: float, h: float, out: Matrix) -> None:
    """Write the four Hermite shape functions (3.12) at xi in [0, 1] of an element of length h (m) into out, (4,)."""
    xi2 = xi * xi
    xi3 = xi2 * xi
    out[0] = 1.0 - 3.0 * xi2 + 2.0 * xi3
    out[1] = h * (xi - 2.0 * xi2 + xi3)
    out[2] = 3.0 * xi2 - 2.0 * xi3
    out[3] = h * (xi3 - xi2)


def shape_derivatives(xi: Matrix, h: float) -> tuple[Matrix, Matrix, Matrix]:
    """Return the shape functions and their first and second derivatives by x at xi, each of shape (4, len(xi))."""
    x = np.asarray(xi, dtype=np.float64)
    x2, x3 = x * x, x * x * x
    value = np.array([1 - 3 * x2 + 2 * x3, h * (x - 2 * x2 + x3), 3 * x2 - 2 * x3, h * (x3 - x2)])
    slope = np.array([6 * (x2 - x) / h, 1 - 4 * x + 3 * x2, 6 * (x - x2) / h, 3 * x2 - 2 * x])
    bend = np.array([(12 * x - 6) / h**2, (6 * x - 4) / h, (6 - 12 * x) / h**2, (6 * x - 2) / h])
    return value, slope, bend


def mass(h: float) -> Matrix:
    """Integral of psi psi^T over an element of length h, shape (4, 4); times rhoA it is the mass matrix."""
    return (h / 420.0) * np.array(
        [
            [156.0, 22.0 * h, 54.0, -13.0 * h],
            [22.0 * h, 4.0 * h * h, 13.0 * h, -3.0 * h * h],
            [54.0, 13.0 * h, 156.0, -22.0 * h],
            [-13.0 * h, -3.0 * h * h, -22.0 * h, 4.0 * h * h],
        ]
    )


def bending(h: float) -> Matrix:
    """Integral of psi_xx psi_xx^T, shape (4, 4); times EI it is the bending stiffness."""
    return (1.0 / h**3) * np.array(
        [
            [12.0, 6.0 * h, -12.0, 6.0 * h],
            [6.0 * h, 4.0 * h * h, -6.0 * h, 2.0 * h * h],
            [-12.0, -6.0 * h, 12.0, -6.0 * h],
            [6.0 * h, 2.0 * h * h, -6.0 * h, 4.0 * h * h],
        ]
    )


def tension(h: float) -> Matrix:
    """Integral of psi_x psi_x^T, shape (4, 4); times T - rhoA v^2 it is the stiffness of a moving tensioned wire."""
    return (1.0 / (30.0 * h)) * np.array(
        [
            [36.0, 3.0 * h, -36.0, 3.0 * h],
            [3.0 * h, 4.0 * h * h, -3.0 * h, -h * h],
            [-36.0, -3.0 * h, 36.0, -3.0 * h],
            [3.0 * h, -h * h, -3.0 * h, 4.0 * h * h],
        ]
    )


def convection(h: float) -> Matrix:
    """Integral of psi psi_x^T, shape (4, 4): the v terms of (3.6). Skew but for the two end displacements -+1/2."""
    return (1.0 / 60.0) * np.array(
        [
            [-30.0, 6.0 * h, 30.0, -6.0 * h],
            [-6.0 * h, 0.0, 6.0 * h, -h * h],
            [-30.0, -6.0 * h, 30.0, 6.0 * h],
            [6.0 * h, h * h, -6.0 * h, 0.0],
        ]
    )
