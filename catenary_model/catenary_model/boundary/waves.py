"""Waves of one wire on the mesh and at the step of the integration: exact, not only for long ones.

A signal z^k with z = exp(i omega Ts) turns Newmark's update (3.19, 3.20) into q' = s_v(z) q and q'' = s_a(z) q, so
that the free wire obeys, at every inner node j of the uniform mesh,

    Z_- q_(j-1) + Z_0 q_j + Z_+ q_(j+1) = 0,    Z = s_a M + s_v D + K,    q_j = (w_j, phi_j)

The wave (3.27), q_j = mu^j (w, phi), leaves a quadratic eigenproblem of size two: four waves for every frequency, two
that die out ahead (they run or reach ahead) and two that die out behind. Of either pair the one that dies out more
slowly is the travelling wave, the other the bending of the wire near a load, or what the mesh makes of waves it cannot
carry.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.layer import Layer
from catenary_model.line import Wire
from catenary_model.moving_frame import wire_elements

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def newmark_factors(omega: Array, step: Layer) -> tuple[Complex, Complex]:
    """Return s_v and s_a, q' = s_v q and q'' = s_a q for signals exp(i omega t) under Newmark's update."""
    z = np.exp(1j * np.asarray(omega) * step.ts)
    with np.errstate(divide="ignore", invalid="ignore"):
        v_of_a = step.ts * ((1.0 - step.gamma) + step.gamma * z) / (z - 1.0)
        q_of_a = (step.ts * v_of_a + step.ts**2 * ((0.5 - step.beta) + step.beta * z)) / (z - 1.0)
        return v_of_a / q_of_a, 1.0 / q_of_a


def element_stiffness(wire: Wire, h: float, speed: float, omega: Array, step: Layer) -> Complex:
    """Return the dynamic stiffness s_a M + s_v D + K of one element at every omega, shape (len(omega), 4, 4)."""
    M, D, K = wire_elements(wire, h, speed)
    s_v, s_a = newmark_factors(omega, step)
    return np.asarray(s_a[:, None, None] * M + s_v[:, None, None] * D + K)


@dataclass(frozen=True)
class Waves:
    """The four waves of a free wire at each frequency; index 0 is the travelling one of a pair."""

    omega: Array
    """Angular frequencies in the frame of the train, rad/s, (n,)."""
    mu: Complex
    """Factor from node to node ahead, (n, 2, 2): [frequency, direction, which], direction as BEHIND, AHEAD."""
    shape: Complex
    """(w, phi) of each wave, scaled to w = 1, (n, 2, 2, 2): [frequency, direction, which, dof]."""

    def wave_number(self, direction: int, h: float) -> Complex:
        """Return omega_x of the travelling wave, w = exp(i (omega_t t + omega_x x)), 1/m, with |Re| <= pi / h."""
        return np.asarray(np.log(self.mu[:, direction, 0]) / (1j * h))


def waves(wire: Wire, h: float, speed: float, omega: Array, step: Layer) -> Waves:
    """Find the waves (3.27) of the mesh at every omega > 0 (rad/s): its quadratic eigenproblem."""
    omega = np.atleast_1d(np.asarray(omega, dtype=np.float64))
    Z = element_stiffness(wire, h, speed, omega, step)
    n = omega.size
    below, above = Z[:, 2:, :2], Z[:, :2, 2:]
    centre = Z[:, 2:, 2:] + Z[:, :2, :2]
    # [q_j, q_(j+1)] -> [q_(j+1), q_(j+2)]
    transfer = np.zeros((n, 4, 4), dtype=np.complex128)
    transfer[:, :2, 2:] = np.eye(2)
    transfer[:, 2:, :2] = -np.linalg.solve(above, below)
    transfer[:, 2:, 2:] = -np.linalg.solve(above, centre)
    mu, vectors = np.linalg.eig(transfer)
    order = np.argsort(np.abs(mu), axis=1)
    mu = np.take_along_axis(mu, order, axis=1)
    vectors = np.take_along_axis(vectors, order[:, None, :], axis=2)
    shapes = np.swapaxes(vectors[:, :2, :] / vectors[:, :1, :], 1, 2)
    # rising |mu|: bending ahead, travelling ahead, travelling behind, bending behind
    both = np.array([[2, 3], [1, 0]])
    return Waves(omega, mu[:, both], shapes[:, both])
