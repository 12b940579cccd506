"""What the design plant (3.50) to (3.53) does over the horizon, as one linear map of all that a cycle knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from impedance_mpc.plant import Array, Impedance, RigModel, newmark_state_space


@dataclass(frozen=True)
class Layout:
    """Where each quantity stands in the vector p of all that a cycle knows: the state (3.50), and more.

    p = [x_tr, q, q', q'', f_held, ramps under way, predicted contact force, others]; ``n`` degrees of freedom of the
    environment, ``ramps`` the number of earlier commands that the rig has not finished with, ``horizon`` is Np.
    """

    n: int
    ramps: int
    horizon: int

    @property
    def wire(self) -> int:
        """Start of q; q', q'' and f_held follow it, n each."""
        return 2

    @property
    def ramp(self) -> int:
        """Start of the earlier commands, newest first, start and end of the ramp of each (m)."""
        return 2 + 4 * self.n

    @property
    def force(self) -> int:
        """Start of the contact force predicted for t_(k+1) to t_(k+Np) (N)."""
        return self.ramp + 2 * self.ramps

    @property
    def momentum(self) -> int:
        """Momentum error dp (N s); what `OTHERS` names follows it."""
        return self.force + self.horizon

    @property
    def size(self) -> int:
        """Length of p."""
        return self.momentum + OTHERS


MOMENTUM, FORCE_NOW, POSITION_BIAS, VELOCITY_BIAS, DRIFT, REFERENCE, CORRECTION = range(7)
"""Last entries of p: dp, the force on the wire at t_k, what w_cat and v_cat have beyond the model (m, m/s), the
target's drift against the wire (m/s), the reference that the rig stands at (m), F_cor of the command before (N)."""
OTHERS = 7


@dataclass(frozen=True)
class Prediction:
    """Outputs over the horizon, Y = free p + moved U for i = 1 .. Np.

    Y stacks all position errors (m), all velocity errors (m/s), all momentum errors (N s): (3 Np,). U = [u_tr(k) ..
    u_tr(k+Nc-1), F_cor(k) .. F_cor(k+Nc-1)] in m and N, (2 Nc,); moves beyond Nc are held. F_cor(j) acts on the wire at
    t_(j+1). Of the inputs (3.52), u is in U, and z, the contact force, is in p: what is forecast of it. ``drive_free``
    (2 Np, size of p) and ``drive_moved`` (2 Np, Nc) give the drive's own positions, then velocities; ``lead_free`` and
    ``lead_moved``, for i = 0 .. Np, what the reference that arrives then leads it by (m).
    """

    free: Array
    moved: Array
    drive_free: Array
    drive_moved: Array
    lead_free: Array
    lead_moved: Array
    layout: Layout


def _ramps(rig: RigModel, layout: Layout, n_c: int) -> tuple[Array, Array]:
    """Give start and end of every ramp by p and moves, first the oldest one under way: (ramps + Np, 2, size p + Nc)."""
    size = layout.size
    every = np.zeros((layout.ramps + layout.horizon, 2, size + n_c))
    for past in range(layout.ramps):
        for side in range(2):
            every[layout.ramps - 1 - past, side, layout.ramp + 2 * past + side] = 1.0
    for j in range(layout.horizon):
        for side in range(2):
            every[layout.ramps + j, side, size + min(j + side, n_c - 1)] = 1.0
    return every[:, :, :size], every[:, :, size:]


def _drive(rig: RigModel, layout: Layout, n_c: int) -> tuple[Array, Array, Array, Array]:
    """Positions and velocities of the drive for i = 1 .. Np, and its leads for i = 0 .. Np, by p and by the moves."""
    n_p = layout.horizon
    free, moved = _ramps(rig, layout, n_c)
    # state, then delayed reference, by p and by the moves
    x_free, x_moved = np.zeros((n_p + 1, 2, layout.size)), np.zeros((n_p + 1, 2, n_c))
    x_free[0, 0, 0] = x_free[0, 1, 1] = 1.0
    lead_free, lead_moved = np.zeros((n_p + 1, layout.size)), np.zeros((n_p + 1, n_c))
    lead_time = 2.0 * rig.damping / rig.omega
    for i in range(n_p + 1):
        old = layout.ramps - 1 + i - rig.cycles  # ramp whose rest comes first, `rig.share` of the cycle
        new = min(old + 1, len(free) - 1)
        for ramps, x, lead in ((free, x_free, lead_free), (moved, x_moved, lead_moved)):
            # The start of the ramp that arrives nearest to the instant: every start gets a bound of its own, or a plan
            # could zigzag between two of them.
            lead[i] = ramps[new if rig.share < 0.5 else old, 0] - x[i, 0] - lead_time * x[i, 1]
            if i < n_p:
                x[i + 1] = rig.a @ x[i] + rig.tail @ ramps[old] + rig.head @ ramps[new]
    return (
        np.concatenate([x_free[1:, 0], x_free[1:, 1]]),
        np.concatenate([x_moved[1:, 0], x_moved[1:, 1]]),
        lead_free,
        lead_moved,
    )


def _environment(model: Impedance, layout: Layout) -> tuple[Array, Array]:
    """Displacement (m), then velocity (m/s), of the environment for i = 1 .. Np: by p, and by the forces on it.

    Only rows C A^i are formed (two rows times a matrix), never powers of A. The second result is (2 Np, Np), column j
    for the force at t_(k+j+1).
    """
    n, n_p = model.n, layout.horizon
    cat = newmark_state_space(model)
    by_p, by_force = np.zeros((2, n_p, layout.size)), np.zeros((2, n_p, n_p))
    rows = cat.c.copy()
    held = np.zeros((2, n))
    markov = np.zeros((n_p, 2))
    state, held_at = slice(layout.wire, layout.wire + 3 * n), slice(layout.wire + 3 * n, layout.wire + 4 * n)
    for i in range(n_p):
        markov[i] = rows @ cat.b
        held = held + rows @ cat.b_force
        rows = rows @ cat.a
        by_p[:, i, state] = rows
        by_p[:, i, held_at] = held
        for j in range(i + 1):
            by_force[:, i, j] = markov[i - j]
    # What gives way right under the contact follows the force at once, in straight lines.
    one, before = model.compliance * np.eye(n_p), model.compliance * np.eye(n_p, k=-1)
    by_force[0] += one
    by_force[1] += (one - before) / model.ts
    others = layout.momentum
    by_p[1, 0, others + FORCE_NOW] -= model.compliance / model.ts
    by_p[0, :, others + POSITION_BIAS] = 1.0
    by_p[1, :, others + VELOCITY_BIAS] = 1.0
    return by_p.reshape(2 * n_p, -1), by_force.reshape(2 * n_p, n_p)


def predict(rig: RigModel, model: Impedance, prediction_horizon: int, control_horizon: int) -> Prediction:
    """Condense rig, environment and momentum error, (3.51) with (3.53), over Np instants and Nc moves.

    Raises
    ------
    ValueError
        Not 1 <= Nc <= Np.
    """
    n_p, n_c = prediction_horizon, control_horizon
    if not 1 <= n_c <= n_p:
        raise ValueError(f"control horizon {n_c} is not between 1 and the prediction horizon {n_p}")
    layout = Layout(model.n, rig.cycles + 1, n_p)
    drive_free, drive_moved, lead_free, lead_moved = _drive(rig, layout, n_c)
    wire_p, wire_force = _environment(model, layout)
    # force on the wire at t_(k+j+1) = predicted contact force + F_cor(k+j)
    correction = np.zeros((n_p, n_c))
    correction[np.arange(n_p), np.minimum(np.arange(n_p), n_c - 1)] = 1.0
    wire_p[:, layout.force : layout.force + n_p] += wire_force

    free, moved = np.zeros((3 * n_p, layout.size)), np.zeros((3 * n_p, 2 * n_c))
    free[: 2 * n_p] = drive_free - wire_p
    moved[: 2 * n_p, :n_c] = drive_moved
    moved[: 2 * n_p, n_c:] = -wire_force @ correction
    others = layout.momentum
    free[2 * n_p :, others + MOMENTUM] = 1.0
    moved[2 * n_p :, n_c:] = -model.ts * np.cumsum(correction, axis=0)
    # A target that drifts against the wire by 1 m/s (approach at the start).
    free[:n_p, others + DRIFT] = -model.ts * np.arange(1, n_p + 1)
    free[n_p : 2 * n_p, others + DRIFT] = -1.0
    return Prediction(free, moved, drive_free, drive_moved, lead_free, lead_moved, layout)
