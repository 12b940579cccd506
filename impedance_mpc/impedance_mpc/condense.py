"""Offline condensing of the predictive controller: the cost (3.55) as a dense quadratic program, constant Hessian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impedance_mpc.plant import Array, DesignPlant

MILLIMETRE = 1e-3
"""m: the program counts the reference in mm and the correction force in N, so that both are of order 1 to 100."""


POSITION, VELOCITY, LEAD = 0, 1, 2
"""What a constraint row bounds."""


@dataclass(frozen=True)
class Weights:
    """Weights of (3.55), each the cost of one unit of error: Q on the outputs, R on the moves.

    ``position`` per mm^2, ``velocity`` per (mm/s)^2 and ``momentum`` per (N s)^2, for each of the Np instants;
    ``correction_force`` per N^2, ``reference_rate`` per (mm/cycle)^2 and ``correction_rate`` per (N/cycle)^2, for
    each of the Nc moves. The reference itself is not penalised: its mean is the height of the wire, not an effort.
    """

    position: float
    velocity: float
    momentum: float
    correction_force: float
    reference_rate: float
    correction_rate: float


@dataclass(frozen=True)
class Prediction:
    """Outputs over the horizon, Y = Phi x + Phi_h f_held + Gamma_z F_tr + Gamma U + bias, for i = 1 .. Np.

    Y stacks all position errors (m), all velocity errors (m/s), all momentum errors (N s), so it is (3 Np,).
    U = [u_tr(k) .. u_tr(k+Nc-1), F_cor(k) .. F_cor(k+Nc-1)] in m and N is (2 Nc,), moves beyond Nc are held.
    ``phi`` (3 Np, nx), ``phi_held`` (3 Np, n), ``gamma_z`` (3 Np,), ``gamma`` (3 Np, 2 Nc). F_tr and f_held are held.
    ``drive_phi`` (2 Np, 2) and ``drive_gamma`` (2 Np, Nc) give the drive's own positions, then velocities.
    """

    phi: Array
    phi_held: Array
    gamma_z: Array
    gamma: Array
    drive_phi: Array
    drive_gamma: Array


def predict(plant: DesignPlant, prediction_horizon: int, control_horizon: int) -> Prediction:
    """Condense the design plant over Np instants and Nc moves.

    Only rows C A^i are formed (three rows times a matrix), never powers of A.

    Raises
    ------
    ValueError
        Not 1 <= Nc <= Np.
    """
    n_p, n_c = prediction_horizon, control_horizon
    if not 1 <= n_c <= n_p:
        raise ValueError(f"control horizon {n_c} is not between 1 and the prediction horizon {n_p}")
    nx, n = plant.a.shape[0], plant.n
    phi = np.zeros((3, n_p, nx))
    phi_held = np.zeros((3, n_p, n))
    gamma_z = np.zeros((3, n_p))
    gamma = np.zeros((3, n_p, 2 * n_c))
    # Markov parameters C A^j B of the three inputs, j = 0 .. Np-1, and their sums for what is held.
    rows = plant.c.copy()
    markov0 = np.zeros((n_p, 3, 2))
    markov1 = np.zeros((n_p, 3))
    held_sum = np.zeros((3, n))
    z_sum = np.zeros(3)
    for j in range(n_p):
        markov0[j] = rows @ plant.b0
        markov1[j] = rows @ plant.b1
        held_sum = held_sum + rows @ plant.e_held
        z_sum = z_sum + rows @ plant.e
        rows = rows @ plant.a
        phi[:, j] = rows
        phi_held[:, j] = held_sum
        gamma_z[:, j] = z_sum
    for i in range(1, n_p + 1):
        for j in range(i):
            # The input between t_(k+j) and t_(k+j+1) acts on y(k+i) through C A^(i-1-j).
            move, following = min(j, n_c - 1), min(j + 1, n_c - 1)
            gamma[:, i - 1, move] += markov0[i - 1 - j, :, 0]
            gamma[:, i - 1, following] += markov1[i - 1 - j]
            gamma[:, i - 1, n_c + move] += markov0[i - 1 - j, :, 1]
    return Prediction(
        phi=phi.reshape(3 * n_p, nx),
        phi_held=phi_held.reshape(3 * n_p, n),
        gamma_z=gamma_z.reshape(3 * n_p),
        gamma=gamma.reshape(3 * n_p, 2 * n_c),
        drive_phi=phi[:2, :, :2].reshape(2 * n_p, 2).copy(),
        drive_gamma=gamma[:2, :, :n_c].reshape(2 * n_p, n_c).copy(),
    )


@dataclass(frozen=True)
class Layout:
    """Where each quantity stands in the vector p of all that a cycle knows; n degrees of freedom of the environment.

    p = [w_tr, v_tr, q, q', q'', dp, f_held, F_tr, w bias, v bias, drift, u_tr before, F_cor before], (4n + 9,).
    """

    n: int

    @property
    def rig(self) -> slice:
        """Rig's state x_tr."""
        return slice(0, 2)

    @property
    def displacement(self) -> slice:
        """Displacements q."""
        return slice(2, 2 + self.n)

    @property
    def velocity(self) -> slice:
        """Velocities q'."""
        return slice(2 + self.n, 2 + 2 * self.n)

    @property
    def acceleration(self) -> slice:
        """Accelerations q''."""
        return slice(2 + 2 * self.n, 2 + 3 * self.n)

    @property
    def momentum(self) -> int:
        """Momentum error dp."""
        return 2 + 3 * self.n

    @property
    def held(self) -> slice:
        """Held forces f_held."""
        return slice(3 + 3 * self.n, 3 + 4 * self.n)

    @property
    def force(self) -> int:
        """Contact force F_tr; the two biases, the drift, u_tr before and F_cor before follow it."""
        return 3 + 4 * self.n

    @property
    def size(self) -> int:
        """Length of p."""
        return 4 * self.n + 9


@dataclass(frozen=True)
class Program:
    """The program min 1/2 z' H z + (G p)' z, z = [u_tr in mm (Nc), F_cor in N (Nc)], and rows on the drive.

    The rows bound the drive's position, its velocity, and its acceleration, the latter as the lead u - w - 2 zeta v /
    omega of the reference, which is the acceleration over omega^2.

    ``hessian`` H (2 Nc, 2 Nc); ``gradient_t`` is G' (size of p, 2 Nc), transposed so that the sum over p runs along
    contiguous columns. ``rows`` (m, 2 Nc) gives the part of the drive's predicted positions (mm), velocities (mm/s)
    and leads (mm) that the moves make, ``row_rig`` (m, 2) the part of x_tr (m, m/s), and ``row_step`` (m,) the part of
    a reference of 1 mm that is held: the row for the plan "stop here". ``kind`` (m,) is POSITION, VELOCITY or LEAD.
    """

    hessian: Array
    gradient_t: Array
    rows: Array
    row_rig: Array
    row_step: Array
    kind: NDArray[np.int64]
    layout: Layout
    control_horizon: int


def _difference(n_c: int) -> Array:
    """First differences of the moves; the first one is against the value before."""
    return np.eye(n_c) - np.eye(n_c, k=-1)


def program(
    plant: DesignPlant, prediction: Prediction, weights: Weights, n_c: int, stride: int, lead_time: float
) -> Program:
    """Form Hessian, gradient map and constraint rows of the cost (3.55); ``stride`` thins the constraint rows.

    ``lead_time`` is 2 zeta / omega of the rig in s.

    The first ``stride`` instants all have rows: the next commands are decided there. After them a PT2 that follows a
    limited reference cannot do much between two rows ``stride`` cycles apart.
    """
    n_p = prediction.gamma.shape[0] // 3
    scale = np.concatenate([np.full(n_c, MILLIMETRE), np.ones(n_c)])
    q = np.repeat([weights.position / MILLIMETRE**2, weights.velocity / MILLIMETRE**2, weights.momentum], n_p)
    gamma = prediction.gamma * scale
    difference = _difference(n_c)
    hessian = gamma.T @ (q[:, None] * gamma)
    hessian[:n_c, :n_c] += weights.reference_rate * difference.T @ difference
    hessian[n_c:, n_c:] += weights.correction_rate * difference.T @ difference
    hessian[n_c:, n_c:] += weights.correction_force * np.eye(n_c)
    hessian = hessian + hessian.T  # 2 H / 2, symmetric to the last bit

    layout = Layout(plant.n)
    free = np.zeros((3 * n_p, layout.size))
    free[:, : layout.momentum + 1] = prediction.phi
    free[:, layout.held] = prediction.phi_held
    free[:, layout.force] = prediction.gamma_z
    # What the full model has at the contact point beyond c q (local compliance) is held: it lowers e = tr - cat.
    free[:n_p, layout.force + 1] = -1.0
    free[n_p : 2 * n_p, layout.force + 2] = -1.0
    # A target that drifts against the wire by 1 m/s (approach at the start).
    free[:n_p, layout.force + 3] = -plant.ts * np.arange(1, n_p + 1)
    free[n_p : 2 * n_p, layout.force + 3] = -1.0
    gradient = 2.0 * gamma.T @ (q[:, None] * free)
    gradient[0, layout.force + 4] -= 2.0 * weights.reference_rate / MILLIMETRE
    gradient[n_c, layout.force + 5] -= 2.0 * weights.correction_rate

    chosen = np.union1d(np.arange(min(stride, n_p)), np.arange(0, n_p, stride))
    position, velocity = chosen, n_p + chosen
    lead, lead_rig = _leads(prediction, chosen, n_c, lead_time)
    drive = np.concatenate([prediction.drive_gamma[position], prediction.drive_gamma[velocity], lead])
    rows = np.zeros((drive.shape[0], 2 * n_c))
    rows[:, :n_c] = drive  # m per m: the same number in mm per mm
    row_rig = np.concatenate([prediction.drive_phi[position], prediction.drive_phi[velocity], lead_rig])
    return Program(
        hessian=hessian,
        gradient_t=np.ascontiguousarray(gradient.T),
        rows=rows,
        row_rig=row_rig / MILLIMETRE,
        row_step=rows.sum(axis=1),
        kind=np.repeat([POSITION, VELOCITY, LEAD], [chosen.size, chosen.size, lead.shape[0]]),
        layout=layout,
        control_horizon=n_c,
    )


def _leads(prediction: Prediction, chosen: Array, n_c: int, lead_time: float) -> tuple[Array, Array]:
    """Give the rows of u - w - lead_time v, in m, at t_k and at the chosen instants: of the moves, and of x_tr.

    With lead_time = 2 zeta / omega this is the acceleration of the PT2 over omega^2.
    """
    n_p = prediction.drive_phi.shape[0] // 2
    moves, rig = np.zeros((1 + chosen.size, n_c)), np.zeros((1 + chosen.size, 2))
    moves[0, 0] = 1.0
    rig[0] = [-1.0, -lead_time]
    for row, i in enumerate(chosen, start=1):
        moves[row] = -prediction.drive_gamma[i] - lead_time * prediction.drive_gamma[n_p + i]
        moves[row, min(i + 1, n_c - 1)] += 1.0
        rig[row] = -prediction.drive_phi[i] - lead_time * prediction.drive_phi[n_p + i]
    return moves, rig
