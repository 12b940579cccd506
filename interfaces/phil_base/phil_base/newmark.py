"""Newmark's method for M q'' + D q' + K q = f at the new instant, as dense algebra: (3.19) to (3.23), (3.40).

For designs, checks and small models, on arrays of any shape that go together. The catenary's own step
(`catenary_model.wires`, `pantograph`, `reference`) is compiled, factorised and written out, as is the environment's in
the controller; these have to agree with what stands here, and tests see to it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Real = NDArray[np.floating[Any]]


def step_matrix(mass: Array, damping: Array, stiffness: Array, ts: float, beta: float, gamma: float) -> Array:
    """K_DM (3.22), in whatever form the three matrices have; ts in s."""
    return mass + gamma * ts * damping + beta * ts**2 * stiffness


def predict(q: Array, q_t: Array, q_tt: Array, ts: float, beta: float, gamma: float) -> tuple[Array, Array]:
    """Q and q' of the new instant without the acceleration there (3.19, 3.20)."""
    return q + ts * q_t + ts**2 * (0.5 - beta) * q_tt, q_t + ts * (1.0 - gamma) * q_tt


def correct(q: Array, q_t: Array, new: Real, ts: float, beta: float, gamma: float) -> tuple[Array, Array]:
    """Add to what `predict` gives the acceleration of the new instant (3.19, 3.20)."""
    return q + beta * ts**2 * new, q_t + gamma * ts * new


def state_space(
    mass: Array, damping: Array, stiffness: Array, ts: float, beta: float, gamma: float
) -> tuple[Array, Array]:
    """One step as x(k+1) = A x(k) + B f(k+1) with x = (q, q', q''), since q'' is carried on (3.40).

    Matrices are (n, n); A is (3 n, 3 n), B (3 n, n).

    Raises
    ------
    numpy.linalg.LinAlgError
        K_DM is singular.
    """
    n = mass.shape[0]
    inverse: Array = np.asarray(np.linalg.inv(step_matrix(mass, damping, stiffness, ts, beta, gamma)), dtype=np.float64)
    q, q_t = predict(np.eye(n, 3 * n), np.eye(n, 3 * n, n), np.eye(n, 3 * n, 2 * n), ts, beta, gamma)
    q_tt = -inverse @ (damping @ q_t + stiffness @ q)
    nothing = np.zeros((n, n))
    A = np.vstack((*correct(q, q_t, q_tt, ts, beta, gamma), q_tt))
    return A, np.vstack((*correct(nothing, nothing, inverse, ts, beta, gamma), inverse))
