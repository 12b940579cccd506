"""Design plant of the impedance controller: models of the rig and of the environment, eqs. (3.40), (3.44), (3.53)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from phil_base import newmark

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RigModel:
    """Closed position loop of the drive at Ts, x_tr = [w_tr, v_tr] (m, m/s), eq. (3.44) with ramps and a dead time.

    The command of cycle j is a ramp from its start s_j to its end e_j. With the dead time (cycles + share) Ts,

        x_tr(k+1) = A_tr x_tr(k) + tail [s_i, e_i] + head [s_j, e_j],    j = k - cycles,  i = j - 1.

    ``a``, ``tail`` and ``head`` are (2, 2); ``share`` in [0, 1); ``omega`` in rad/s, ``damping`` is zeta.
    """

    a: Array
    tail: Array
    head: Array
    cycles: int
    share: float
    omega: float
    damping: float

    @property
    def b0(self) -> Array:
        """B_tr0 of x_tr(k+1) = A_tr x_tr(k) + B_tr0 u_tr(k) + B_tr1 u_tr(k+1), without dead time, (2,)."""
        return self.head[:, 0]

    @property
    def b1(self) -> Array:
        """B_tr1, likewise, (2,)."""
        return self.head[:, 1]


def pt2_ramp(omega: float, damping: float, duration: float) -> tuple[Array, Array]:
    """Discretise w'' = omega^2 (u - w) - 2 zeta omega w' exactly for one ramp of u from s to e over the duration (s).

    Returns A (2, 2) and B (2, 2) of x = A x + B [s, e]: one exponential of the plant extended by [u, u'].
    """
    generator = np.zeros((4, 4))
    generator[0, 1] = duration
    generator[1, :3] = np.array([-(omega**2), -2.0 * damping * omega, omega**2]) * duration
    generator[2, 3] = 1.0  # u' is counted per duration
    step = expm(generator)
    return step[:2, :2].copy(), np.column_stack([step[:2, 2] - step[:2, 3], step[:2, 3]])


def pt2_rig(natural_frequency_hz: float, damping_ratio: float, ts: float, delay: float = 0.0) -> RigModel:
    """Discretise the PT2 exactly for references that are linear within each cycle and arrive ``delay`` (s) late.

    The rig interpolates its reference between u_tr(k) and u_tr(k+1), so the hold is a ramp, not a staircase. The second
    input column has no place in the standard form (3.51). It needs no extra state here because the vector of moves
    (3.54) holds both u_tr(k) and u_tr(k+1) and the condensed prediction can take both; the dead time needs the ramps
    that are still under way, which the controller knows because it sent them.

    Raises
    ------
    ValueError
        Frequency, damping or step is not positive, or the delay is negative.
    """
    if not (natural_frequency_hz > 0.0 and damping_ratio > 0.0 and ts > 0.0):
        raise ValueError("natural frequency, damping ratio and step of the rig have to be positive")
    if not delay >= 0.0:
        raise ValueError("the delay of the rig must not be negative")
    omega = 2.0 * np.pi * natural_frequency_hz
    cycles = int(delay / ts + 1e-9)
    share = max(0.0, delay / ts - cycles)
    if share < 1e-6:
        share = 0.0
    # First what is left of the ramp before, then the first part of the ramp that has just arrived.
    old_a, old_b = pt2_ramp(omega, damping_ratio, share * ts)
    new_a, new_b = pt2_ramp(omega, damping_ratio, (1.0 - share) * ts)
    rest = np.array([[share, 1.0 - share], [0.0, 1.0]])
    first = np.array([[1.0, 0.0], [share, 1.0 - share]])
    return RigModel(new_a @ old_a, new_a @ old_b @ rest, new_b @ first, cycles, share, omega, damping_ratio)


@dataclass(frozen=True)
class Impedance:
    """The environment to be emulated: M q'' + D q' + K q = f_held + b f_cat, w_cat = c q + dC f_cat (thesis 3.1.9).

    ``mass``, ``damping``, ``stiffness`` are (n, n), ``input`` and ``output`` are (n,); ``ts`` in s is the Newmark step,
    ``compliance`` dC in m/N is what gives way right under the contact. A mass-spring-damper is the case n = 1.

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
    compliance: float = 0.0

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
        if not 0.0 <= self.compliance < 1.0:
            raise ValueError(f"impedance model: local compliance {self.compliance} m/N makes no sense")
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
        compliance: float = 0.0,
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
        return cls(square[0], square[1], square[2], ends[0], ends[1], ts, newmark_beta, newmark_gamma, compliance)


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
    """Write one step of (3.19) to (3.23) as a matrix (3.40); q'' is a state because the method carries it on.

    The full catenary's own step: see ``catenary_model/wires.py``.

    Raises
    ------
    ValueError
        K_DM = M + gamma dt D + beta dt^2 K is singular.
    """
    n = model.n
    try:
        a, b_force = newmark.state_space(
            model.mass, model.damping, model.stiffness, model.ts, model.newmark_beta, model.newmark_gamma
        )
    except np.linalg.LinAlgError:
        raise ValueError("impedance model: M + gamma dt D + beta dt^2 K is singular") from None
    c = np.zeros((2, 3 * n))
    c[0, :n] = model.output
    c[1, n : 2 * n] = model.output
    return NewmarkModel(a=a, b_force=b_force, b=b_force @ model.input, c=c)
