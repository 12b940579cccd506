"""Offline condensing of the predictive controller: the cost (3.55) as a dense quadratic program, constant Hessian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impedance_mpc.plant import Array
from impedance_mpc.predict import CORRECTION, REFERENCE, Layout, Prediction

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
    ``softening`` is the cost of breaking a limit of the drive by 1 mm (position), 100 mm/s (velocity) or 0.1 mm of
    lead (current), and rises with the square of it.
    """

    position: float
    velocity: float
    momentum: float
    correction_force: float
    reference_rate: float
    correction_rate: float
    softening: float


@dataclass(frozen=True)
class Program:
    """The program (3.56): min 1/2 z' H z + (G p)' z over z = [u_tr in mm (Nc), F_cor in N (Nc)] (3.54), and rows.

    The rows bound the drive's position, its velocity, and its acceleration, the latter as the lead u - w - 2 zeta v /
    omega of the reference, which is the acceleration over omega^2: lower <= rows z + row_free p <= upper. They are
    soft: to break one costs 1/2 softness times the square of the excess, so the program always has a solution.

    ``hessian`` H (2 Nc, 2 Nc); ``gradient_t`` is G' (size of p, 2 Nc), transposed so that the sum over p runs along
    contiguous columns. ``rows`` (m, 2 Nc) in mm, mm/s and mm, ``row_free`` (m, size of the part of p that moves the
    drive) with ``row_columns`` naming that part. ``kind`` (m,) is POSITION, VELOCITY or LEAD, ``softness`` (m,).
    """

    hessian: Array
    gradient_t: Array
    rows: Array
    row_free: Array
    row_columns: NDArray[np.int64]
    kind: NDArray[np.int64]
    softness: Array
    layout: Layout
    control_horizon: int


EXCESS = np.array([1.0, 100.0, 0.1])
"""The excess that costs the weight `softening`, by kind: mm, mm/s, mm (0.1 mm of lead are some m/s^2)."""


def _difference(n_c: int) -> Array:
    """First differences of the moves; the first one is against the value before."""
    return np.eye(n_c) - np.eye(n_c, k=-1)


def program(prediction: Prediction, weights: Weights, n_c: int, stride: int) -> Program:
    """Form Hessian, gradient map and constraint rows of the cost (3.55); ``stride`` thins the constraint rows.

    The first ``stride`` instants all have rows: the next commands are decided there. After them a PT2 that follows a
    limited reference cannot do much between two rows ``stride`` cycles apart.
    """
    layout = prediction.layout
    n_p = layout.horizon
    scale = np.concatenate([np.full(n_c, MILLIMETRE), np.ones(n_c)])
    q = np.repeat([weights.position / MILLIMETRE**2, weights.velocity / MILLIMETRE**2, weights.momentum], n_p)
    moved = prediction.moved * scale
    difference = _difference(n_c)
    hessian = moved.T @ (q[:, None] * moved)
    hessian[:n_c, :n_c] += weights.reference_rate * difference.T @ difference
    correction = slice(n_c, 2 * n_c)
    hessian[correction, correction] += weights.correction_rate * difference.T @ difference
    hessian[correction, correction] += weights.correction_force * np.eye(n_c)
    hessian = hessian + hessian.T  # 2 H / 2, symmetric to the last bit

    gradient = 2.0 * moved.T @ (q[:, None] * prediction.free)
    gradient[0, layout.momentum + REFERENCE] -= 2.0 * weights.reference_rate / MILLIMETRE
    gradient[n_c, layout.momentum + CORRECTION] -= 2.0 * weights.correction_rate

    chosen = np.union1d(np.arange(min(stride, n_p)), np.arange(0, n_p, stride))
    lead = np.concatenate([[0], 1 + chosen])
    kind = np.repeat([POSITION, VELOCITY, LEAD], [chosen.size, chosen.size, lead.size])
    free = [prediction.drive_free[chosen], prediction.drive_free[n_p + chosen], prediction.lead_free[lead]]
    moves = [prediction.drive_moved[chosen], prediction.drive_moved[n_p + chosen], prediction.lead_moved[lead]]
    row_free = np.concatenate(free) / MILLIMETRE
    rows = np.zeros((kind.size, 2 * n_c))
    rows[:, :n_c] = np.concatenate(moves)  # m per m: the same number in mm per mm
    used = np.any(rows != 0.0, axis=1)  # with a dead time the first instants are decided already
    columns = np.flatnonzero(np.any(row_free != 0.0, axis=0)).astype(np.int64)
    return Program(
        hessian=hessian,
        gradient_t=np.ascontiguousarray(gradient.T),
        rows=np.ascontiguousarray(rows[used]),
        row_free=np.ascontiguousarray(row_free[np.ix_(used, columns)]),
        row_columns=columns,
        kind=kind[used],
        softness=2.0 * weights.softening / EXCESS[kind[used]] ** 2,
        layout=layout,
        control_horizon=n_c,
    )
