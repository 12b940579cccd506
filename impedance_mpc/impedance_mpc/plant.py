"""Design plant of the impedance controller: rig, reduced environment and momentum error, eqs. (3.50) to (3.53)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigModel:
    """Closed position loop of the drive at Ts, x_tr = [w_tr, v_tr] (m, m/s), eq. (3.44) with a ramp between samples.

    x_tr(k+1) = A_tr x_tr(k) + B_tr0 u_tr(k) + B_tr1 u_tr(k+1); ``a`` is (2, 2), ``b0`` and ``b1`` are (2,).
    """

    a: Array
    b0: Array
    b1: Array


def pt2_rig(natural_frequency_hz: float, damping_ratio: float, ts: float) -> RigModel:
    """Discretise w'' = omega^2 (u - w) - 2 zeta omega w' exactly for a reference that is linear between samples.

    The rig interpolates its reference between u_tr(k) and u_tr(k+1), so the hold is a triangle (first-order hold),
    not a staircase. With the state [x_tr, u, u'] and u'' = 0 one matrix exponential gives both input columns:
    x_tr(k+1) = A_tr x_tr(k) + G0 u(k) + G1 (u(k+1) - u(k)), hence B_tr0 = G0 - G1, B_tr1 = G1. The column B_tr1 has
    no place in the standard form (3.51). It needs no extra state here because the vector of moves (3.54) holds both
    u_tr(k) and u_tr(k+1) and the condensed prediction can take both; a state-space form would shift the state to
    x_tr - B_tr1 u_tr (this is what scipy's ``cont2discrete(..., 'foh')`` does, and why its C and D change).

    Raises
    ------
    ValueError
        Frequency, damping or step is not positive.
    """
    if not (natural_frequency_hz > 0.0 and damping_ratio > 0.0 and ts > 0.0):
        raise ValueError("natural frequency, damping ratio and step of the rig have to be positive")
    omega = 2.0 * np.pi * natural_frequency_hz
    generator = np.zeros((4, 4))
    generator[0, 1] = ts
    generator[1, :3] = np.array([-(omega**2), -2.0 * damping_ratio * omega, omega**2]) * ts
    generator[2, 3] = 1.0  # u' is counted per step
    step = expm(generator)
    return RigModel(a=step[:2, :2].copy(), b0=step[:2, 2] - step[:2, 3], b1=step[:2, 3].copy())


@dataclass(frozen=True)
class Impedance:
    """The environment to be emulated: M q'' + D q' + K q = f_held + b f_cat, w_cat = c q, v_cat = c q' (thesis 3.1.9).

    ``mass``, ``damping``, ``stiffness`` are (n, n), ``input`` and ``output`` are (n,); ``ts`` in s is the Newmark step.
    A mass-spring-damper is the case n = 1.

    Raises
    ------
    ValueError
        Shapes do not fit, a number is not finite, or step or Newmark parameters make no sense.
    """

    mass: Array
    damping: Array
    stiffness: Array
    input: Array
    output: Array
    ts: float
    newmark_beta: float = 0.25
    newmark_gamma: float = 0.5

    def __post_init__(self) -> None:
        n = self.n
        if n < 1:
            raise ValueError("the impedance model has no degree of freedom")
        for name, shape in (("mass", (n, n)), ("damping", (n, n)), ("stiffness", (n, n)), ("output", (n,))):
            if np.shape(getattr(self, name)) != shape:
                raise ValueError(f"impedance model: '{name}' has shape {np.shape(getattr(self, name))}, not {shape}")
        for name in ("mass", "damping", "stiffness", "input", "output"):
            if not np.all(np.isfinite(getattr(self, name))):
                raise ValueError(f"impedance model: '{name}' holds NaN or infinity")
        if not 0.0 < self.ts < 1.0:
            raise ValueError(f"impedance model: step {self.ts} s is not between 0 and 1 s")
        if not (0.0 <= self.newmark_beta <= 0.5 and 0.0 <= self.newmark_gamma <= 1.0):
            raise ValueError("impedance model: Newmark's beta is not in [0, 0.5] or gamma not in [0, 1]")

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return int(np.size(self.input))

    @classmethod
    def from_flat(
        cls,
        n: int,
        mass: Sequence[float],
        damping: Sequence[float],
        stiffness: Sequence[float],
        force_input: Sequence[float],
        output: Sequence[float],
        ts: float,
        newmark_beta: float,
        newmark_gamma: float,
    ) -> Impedance:
        """Make the model from matrices that are given row by row, n^2 entries each (as a message carries them).

        Raises
        ------
        ValueError
            A size does not fit, or the model is refused for another reason.
        """
        for name, values in (("mass", mass), ("damping", damping), ("stiffness", stiffness)):
            if len(values) != n * n:
                raise ValueError(f"impedance model: '{name}' has {len(values)} entries, not {n} x {n}")
        if len(force_input) != n:
            raise ValueError(f"impedance model: 'input' has {len(force_input)} entries, not {n}")
        square = [np.array(values, dtype=np.float64).reshape(n, n) for values in (mass, damping, stiffness)]
        ends = [np.array(values, dtype=np.float64) for values in (force_input, output)]
        return cls(square[0], square[1], square[2], ends[0], ends[1], ts, newmark_beta, newmark_gamma)


@dataclass(frozen=True)
class NewmarkModel:
    """Newmark's method as a state space, x_cat = [q, q', q'']: x_cat(k+1) = A_cat x_cat(k) + B_f F(k+1), eq. (3.40).

    ``a`` is (3n, 3n), ``b_force`` (3n, n) takes the nodal forces at the new instant, ``b`` = B_f b is B_cat (3n,)
    and ``c`` is C_cat (2, 3n) with outputs w_cat, v_cat.
    """

    a: Array
    b_force: Array
    b: Array
    c: Array


def newmark_state_space(model: Impedance) -> NewmarkModel:
    """Write one step of (3.19) to (3.23) as a matrix; q'' is a state because the method carries it from step to step.

    Raises
    ------
    ValueError
        K_DM = M + gamma dt D + beta dt^2 K is singular.
    """
    n, dt, beta, gamma = model.n, model.ts, model.newmark_beta, model.newmark_gamma
    one = np.eye(n)
    zero = np.zeros((n, n))
    # Predictors of (3.19, 3.20): q and q' before the new acceleration is added.
    displacement = np.hstack([one, dt * one, dt**2 * (0.5 - beta) * one])
    velocity = np.hstack([zero, one, dt * (1.0 - gamma) * one])
    k_dm = model.mass + gamma * dt * model.damping + beta * dt**2 * model.stiffness
    try:
        inverse = np.linalg.inv(k_dm)
    except np.linalg.LinAlgError:
        raise ValueError("impedance model: M + gamma dt D + beta dt^2 K is singular") from None
    acceleration = -inverse @ (model.damping @ velocity + model.stiffness @ displacement)
    gain = np.vstack([beta * dt**2 * one, gamma * dt * one, one])
    a = np.vstack([displacement, velocity, np.zeros((n, 3 * n))]) + gain @ acceleration
    b_force = gain @ inverse
    c = np.zeros((2, 3 * n))
    c[0, :n] = model.output
    c[1, n : 2 * n] = model.output
    return NewmarkModel(a=a, b_force=b_force, b=b_force @ model.input, c=c)


@dataclass(frozen=True)
class DesignPlant:
    """Design plant (3.50) to (3.53): x = [w_tr, v_tr, q, q', q'', dp], u = [u_tr, F_cor], z = F_tr.

    x(k+1) = A x(k) + B_0 u(k) + B_1 u_tr(k+1) + E F_tr(k) + E_h f_held(k) and
    y(k) = C x(k) = [e_pos, e_vel, dp]; nx = 3n + 3, ``a`` (nx, nx), ``b0`` (nx, 2), ``b1`` (nx,), ``e`` (nx,),
    ``e_held`` (nx, n), ``c`` (3, nx). dp = p_tr - p_cat, so dp(k+1) = dp(k) - Ts F_cor(k), eq. (3.47, sign corrected).
    """

    a: Array
    b0: Array
    b1: Array
    e: Array
    e_held: Array
    c: Array
    n: int
    ts: float


def design_plant(rig: RigModel, model: Impedance) -> DesignPlant:
    """Put rig, environment and momentum error together, eq. (3.53)."""
    cat = newmark_state_space(model)
    n = model.n
    nx = 3 * n + 3
    wire = slice(2, 2 + 3 * n)
    a = np.zeros((nx, nx))
    a[:2, :2] = rig.a
    a[wire, wire] = cat.a
    a[-1, -1] = 1.0
    b0 = np.zeros((nx, 2))
    b0[:2, 0] = rig.b0
    b0[wire, 1] = cat.b
    b0[-1, 1] = -model.ts
    b1 = np.zeros(nx)
    b1[:2] = rig.b1
    e = np.zeros(nx)
    e[wire] = cat.b
    e_held = np.zeros((nx, n))
    e_held[wire] = cat.b_force
    c = np.zeros((3, nx))
    c[:2, :2] = np.eye(2)
    c[:2, wire] = -cat.c
    c[2, -1] = 1.0
    return DesignPlant(a=a, b0=b0, b1=b1, e=e, e_held=e_held, c=c, n=n, ts=model.ts)
