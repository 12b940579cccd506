"""A pantograph that rides on a wire model: Newmark's step, coupled within the step, contact that can only push.

    M y'' + D y' + K y = share(t) f_up - e_head F,      F = max(0, k_c (y_head - w))

y are the displacements of its masses from the position in which no spring is loaded, head last; w is the height of the
wire above it. Within a Newmark step both sides are affine in the contact force of the new instant,

    y_head(k+1) = y_free - c_p F,    c_p = beta Ts^2 (K_DM^-1)_hh,          w(k+1) = w_free + C F,

so F(k+1) follows in closed form, without lag, and its sign decides whether there is contact (both compliances are
positive: there is exactly one answer). How the wire comes to w_free and C is no concern of this module: any wire model
in any frame will do. Contact lost at k+1 means F = 0 there, not that it stays lost.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phil_base.kernels import njit
from phil_base.newmark import step_matrix

Array = NDArray[np.float64]

TS, BETA, GAMMA, CONTACT_COMPLIANCE = range(4)
"""Entries of `Constants.real`."""


@dataclass(frozen=True)
class Pantograph:
    """Linear pantograph with n masses; the contact acts on the last one. Raises ValueError naming the field."""

    mass: Array
    """M, kg, (n, n)."""
    damping: Array
    """D, N s/m, (n, n)."""
    stiffness: Array
    """K, N/m, (n, n)."""
    uplift: Array
    """f_up, constant forces on the masses, N, (n,)."""
    contact_stiffness: float = 50e3
    """k_c, N/m; infinity is a head that cannot be pushed in."""

    def __post_init__(self) -> None:
        n = self.uplift.size
        for name in ("mass", "damping", "stiffness"):
            if getattr(self, name).shape != (n, n):
                raise ValueError(f"{name} has shape {getattr(self, name).shape}, for {n} masses ({n}, {n}) is needed")
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} must be finite")
        if not self.contact_stiffness > 0.0:
            raise ValueError(f"contact_stiffness = {self.contact_stiffness} must be above 0")
        if n < 1 or np.linalg.eigvalsh(0.5 * (self.mass + self.mass.T)).min() <= 0.0:
            raise ValueError("mass must be positive definite")

    @classmethod
    def of(
        cls,
        mass: ArrayLike,
        damping: ArrayLike,
        stiffness: ArrayLike,
        static_force: float,
        contact_stiffness: float = 50e3,
    ) -> Pantograph:
        """Make one from masses (n,) or (n, n) in kg, D, K and the static force (N) on the first mass."""
        M = np.array(mass, dtype=np.float64)
        M = np.diag(M) if M.ndim == 1 else M
        uplift = np.zeros(M.shape[0])
        uplift[0] = static_force
        return cls(M, np.array(damping, np.float64), np.array(stiffness, np.float64), uplift, contact_stiffness)


class Constants(NamedTuple):
    """A pantograph for one time step and one choice of Newmark's parameters."""

    real: Array
    """Numbers, see TS, BETA, ..."""
    damping: Array
    """D, (n, n)."""
    stiffness: Array
    """K, (n, n)."""
    inverse: Array
    """K_DM^-1, (n, n)."""
    uplift: Array
    """f_up, (n,)."""


class State(NamedTuple):
    """All that a step changes."""

    y: Array
    """Displacement (m), velocity and acceleration of the masses, (3, n)."""
    predicted: Array
    """Work: predicted displacement and velocity, acceleration without contact, (3, n)."""


def constants(pantograph: Pantograph, ts: float, beta: float, gamma: float) -> Constants:
    """Prepare a pantograph for steps of ts (s) with Newmark's beta and gamma, see `catenary_model.wires`."""
    M, D, K = pantograph.mass, pantograph.damping, pantograph.stiffness
    compliance = 0.0 if math.isinf(pantograph.contact_stiffness) else 1.0 / pantograph.contact_stiffness
    inverse = np.asarray(np.linalg.inv(step_matrix(M, D, K, ts, beta, gamma)), dtype=np.float64)
    real = np.array([ts, beta, gamma, compliance])
    return Constants(real, D.copy(), K.copy(), inverse, pantograph.uplift.copy())


def at_rest(pantograph: Pantograph, height: float) -> State:
    """Put all masses at this height (m), without speed and with the acceleration that the springs alone give."""
    n = pantograph.uplift.size
    state = State(np.zeros((3, n)), np.zeros((3, n)))
    state.y[0] = height
    state.y[2] = np.linalg.solve(pantograph.mass, -pantograph.stiffness @ state.y[0])
    return state


@njit(cache=True, fastmath=False)
def free(c: Constants, s: State, share: float) -> float:
    """Step to k+1 as if there were no contact, with the uplift times share (1); return y_free of the head, m."""
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    n = c.uplift.size
    yp, vp, a = s.predicted[0], s.predicted[1], s.predicted[2]
    for i in range(n):
        yp[i] = s.y[0, i] + ts * s.y[1, i] + ts * ts * (0.5 - beta) * s.y[2, i]
        vp[i] = s.y[1, i] + ts * (1.0 - gamma) * s.y[2, i]
        a[i] = 0.0
    for j in range(n):
        load = share * c.uplift[j]
        for k in range(n):
            load -= c.damping[j, k] * vp[k] + c.stiffness[j, k] * yp[k]
        for i in range(n):
            a[i] += c.inverse[i, j] * load
    return yp[n - 1] + beta * ts * ts * a[n - 1]


@njit(cache=True, fastmath=False)
def contact_force(c: Constants, head: float, w_free: float, compliance: float) -> float:
    """Return F(k+1) >= 0 (N) for y_free = head (m) and a wire that answers w_free + compliance F (m, m/N)."""
    n = c.uplift.size
    own = c.real[BETA] * c.real[TS] * c.real[TS] * c.inverse[n - 1, n - 1]
    return max(0.0, (head - w_free) / (c.real[CONTACT_COMPLIANCE] + own + compliance))


@njit(cache=True, fastmath=False)
def finish(c: Constants, s: State, force: float) -> None:
    """Complete the step that `free` began with the contact force (N)."""
    ts, beta, gamma = c.real[TS], c.real[BETA], c.real[GAMMA]
    n = c.uplift.size
    for i in range(n):
        a = s.predicted[2, i] - c.inverse[i, n - 1] * force
        s.y[0, i] = s.predicted[0, i] + beta * ts * ts * a
        s.y[1, i] = s.predicted[1, i] + gamma * ts * a
        s.y[2, i] = a
