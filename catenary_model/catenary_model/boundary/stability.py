"""Spectral radius of the domain with both its ends, and growth of what moves through it.

The radius that counts is that of the whole: both ends, both wires, droppers and masts in between. Frozen in a position
they make the step matrix constant; as they move, the step matrices of one period of the line follow each other, and
what counts is the growth over the period (Floquet).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from catenary_model.boundary.layer import BEHIND, Feedback, Layer
from catenary_model.boundary.springs import Spring, elongations, frozen
from catenary_model.line import Line
from catenary_model.moving_frame import CARRIER, CONTACT, MovingFrame, dense
from phil_base import newmark

Array = NDArray[np.float64]

BAND = 7
"""Half bandwidth of the coupled wires."""


def feedback_matrix(frame: MovingFrame, feedback: Feedback | None) -> tuple[NDArray[np.int64], Array]:
    """Return the degrees of freedom that u acts on (inputs,), and u = F (q, q', q'') as F (inputs, 3, n)."""
    stations = frame.mesh.stations
    inputs, rows = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3, 4 * stations))]
    for wire in (CARRIER, CONTACT) if feedback is not None else ():
        for end, gain in enumerate(feedback.gain[wire]) if feedback is not None else ():
            count, seen = gain.shape[0], gain.shape[1] // 3
            i = np.arange(max(count, seen))
            dof = 4 * (i // 2 if end == BEHIND else stations - 1 - i // 2) + 2 * wire + i % 2
            F = np.zeros((count, 3, 4 * stations))
            F[:, :, dof[:seen]] = gain.reshape(count, 3, seen)
            inputs.append(dof[:count])
            rows.append(F)
    return np.concatenate(inputs), np.concatenate(rows)


def spectral_radius(
    frame: MovingFrame,
    feedback: Feedback | None,
    layer: Layer,
    springs: Iterable[Spring] = (),
    wires: Sequence[int] = (CARRIER, CONTACT),
) -> float:
    """Return the spectral radius of the closed loop, springs frozen where they are.

    Newmark's step. Dense, so for short domains: 200 stations with both wires take about a
    second. Without springs the wires do not feel each other, and one of them may be left out.
    """
    M, D, K = (dense(compact) for compact in (frame.mass, frame.damping, frame.stiffness))
    for first, g, k in elongations(frame.mesh, springs):
        K[first : first + 8, first : first + 8] += k * np.outer(g, g)
    held_still = ~(D.any(axis=1) | K.any(axis=1))  # a clamped one keeps what it has, which is no motion
    kept = np.flatnonzero(np.isin(np.arange(M.shape[0]) % 4 // 2, wires) & ~held_still)
    inputs, F = feedback_matrix(frame, feedback)
    mine = np.isin(inputs, kept)
    at, F = np.searchsorted(kept, inputs[mine]), F[mine][:, :, kept]
    M, D, K = (matrix[np.ix_(kept, kept)] for matrix in (M, D, K))
    n, u, step = kept.size, at.size, (layer.ts, layer.beta, layer.gamma)
    inverse = np.linalg.inv(M)
    # state (q, q', u of the step before): q'' follows from them, M q'' = u - D q' - K q
    q, q_t = np.eye(n, 2 * n + u), np.eye(n, 2 * n + u, n)
    q_tt = np.hstack((-inverse @ K, -inverse @ D, inverse[:, at]))
    held = np.einsum("ukn,knm->um", F, np.stack((q, q_t, q_tt)))
    q_on, q_t_on = newmark.predict(q, q_t, q_tt, *step)
    force = -D @ q_t_on - K @ q_on
    force[at] += held
    q_tt_next = np.linalg.solve(newmark.step_matrix(M, D, K, *step), force)
    closed = np.vstack((*newmark.correct(q_on, q_t_on, q_tt_next, *step), held))
    return float(np.max(np.abs(np.linalg.eigvals(closed))))


class Stepper:
    """Newmark's step of both wires with springs that may change; many states at once."""

    def __init__(self, frame: MovingFrame, feedback: Feedback | None, layer: Layer, states: int = 1) -> None:
        """Start `states` states at rest."""
        self.frame, self.layer = frame, layer
        self.inputs, self.F = feedback_matrix(frame, feedback)
        n = 4 * frame.mesh.stations
        self.x = np.zeros((3, n, states))
        """(q, q', q'')."""
        self._D, self._K = (_banded(compact) for compact in (frame.damping, frame.stiffness))
        self._step = layer.ts, layer.beta, layer.gamma
        self._newmark = newmark.step_matrix(_banded(frame.mass), self._D, self._K, *self._step)

    def step(self, springs: Iterable[Spring] = (), force: Array | None = None) -> None:
        """Go on by one step; springs where they are at its end, force on every degree of freedom there, (n, states)."""
        ts, beta, _ = self._step
        q, q_t, q_tt = self.x
        held = np.einsum("ukn,kns->us", self.F, self.x)
        q_on, q_t_on = newmark.predict(q, q_t, q_tt, *self._step)
        right = -_times(self._D, q_t_on) - _times(self._K, q_on)
        if force is not None:
            right += force
        right[self.inputs] += held
        matrix = self._newmark.copy()
        for first, g, k in elongations(self.frame.mesh, springs):
            block = k * np.outer(g, g)
            right[first : first + 8] -= block @ q_on[first : first + 8]
            for i in range(8):
                for j in range(8):
                    matrix[BAND + i - j, first + j] += beta * ts**2 * block[i, j]
        new = scipy.linalg.solve_banded((BAND, BAND), matrix, right, overwrite_ab=True, check_finite=False)
        self.x = np.stack((*newmark.correct(q_on, q_t_on, new, *self._step), new))


def growth_per_period(
    frame: MovingFrame,
    feedback: Feedback | None,
    layer: Layer,
    line: Line,
    fading_length: float,
    periods: int = 6,
    say: Callable[[int], None] | None = None,
) -> float:
    """Return the factor by which the fastest-growing motion grows while one period of the line passes, all taut.

    Power iteration with four states over `periods` periods, the last of which counts.
    Raises ValueError at rest, where nothing passes.
    """
    if not frame.speed > 0.0:
        raise ValueError(f"speed = {frame.speed}: nothing passes at rest, see spectral_radius")
    stepper = Stepper(frame, feedback, layer, states=4)
    random = np.random.default_rng(1)
    stepper.x[1] = random.standard_normal(stepper.x[1].shape)
    steps = round(line.period / (frame.speed * layer.ts))
    growth = np.nan
    count = 0
    for period in range(periods):
        for _ in range(steps):
            count += 1
            stepper.step(frozen(line, frame.mesh, frame.speed * layer.ts * count, fading_length))
        flat = (stepper.x * np.array([1.0, 1e-2, 1e-4])[:, None, None]).reshape(-1, stepper.x.shape[2])
        basis, factors = np.linalg.qr(flat)
        growth = float(abs(factors[0, 0]))
        stepper.x = basis.reshape(stepper.x.shape) / np.array([1.0, 1e-2, 1e-4])[:, None, None]
        if say is not None:
            say(period + 1)
    return growth


def _banded(compact: Array) -> Array:
    """Turn a compact matrix (n, 6) into scipy's banded form with BAND diagonals on either side, (15, n)."""
    n = compact.shape[0]
    banded = np.zeros((2 * BAND + 1, n))
    for j in range(6):
        column = np.arange(n) - np.arange(n) % 2 - 4 + 4 * (j // 2) + j % 2
        inside = (column >= 0) & (column < n)
        banded[BAND + np.arange(n)[inside] - column[inside], column[inside]] = compact[inside, j]
    return banded


def _times(banded: Array, x: Array) -> Array:
    """Return the product of a banded matrix and columns (n, m)."""
    n = x.shape[0]
    product = np.zeros_like(x)
    for offset in range(-BAND, BAND + 1):
        # row i, column i + offset
        rows = slice(max(0, -offset), min(n, n - offset))
        columns = slice(max(0, offset), min(n, n + offset))
        product[rows] += banded[BAND - offset, columns, None] * x[columns]
    return product
