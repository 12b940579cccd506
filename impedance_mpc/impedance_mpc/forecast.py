"""Prediction of the contact force over the horizon, from what has been measured so far.

The command of cycle k sets the force on the wire at t_(k+1), when the pantograph's force will be another one than at
t_k: a force that is passed on as it is arrives one cycle late, and the wire's energy differs from the rig's by what
that costs. Three kinds:

- ``constant``: F_tr(k), as in the thesis.
- ``linear``: a Kalman filter for the force and its rate; the rate dies out over the horizon.
- ``contact``: the head is a mass m_h on the contact spring k_c, which was measured, under a load d that is not known,

      F = k_c max(0, x),   x' = v_h - v_tr,   v_h' = (d - F) / m_h,

  x the penetration, v_h the head's velocity. A Kalman filter estimates x, v_h and d from F_tr and the drive's measured
  way; the prediction takes the drive along the plan of the cycle before. Contact that ends and returns is part of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from impedance_mpc.plant import Array
from phil_base.kernels import njit

CONSTANT, LINEAR, CONTACT = 0, 1, 2
KINDS = {"constant": CONSTANT, "linear": LINEAR, "contact": CONTACT}


@dataclass(frozen=True)
class ForecastRule:
    """What the forecast is told.

    ``kind`` is one of `KINDS`; ``stiffness`` k_c in N/m and ``head_mass`` m_h in kg; ``noise`` is the standard
    deviation of one F_tr in N, ``load_noise`` in N/sqrt(s) how fast the unknown load wanders, ``rate_noise`` in
    N/s/sqrt(s) how fast the rate of a linear forecast does, which dies out within ``decay`` (s).

    Raises
    ------
    ValueError
        The kind is unknown or a number is not positive.
    """

    kind: str
    stiffness: float
    head_mass: float
    noise: float
    load_noise: float
    rate_noise: float
    decay: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(f"force prediction '{self.kind}' is none of {', '.join(KINDS)}")
        numbers = (self.stiffness, self.head_mass, self.noise, self.load_noise, self.rate_noise, self.decay)
        if not min(numbers) > 0.0:
            raise ValueError("all numbers of the force prediction have to be positive")


class Design(NamedTuple):
    """What the compiled step needs; for a linear forecast the state is (F, F'), for a contact one (x, v_h, d)."""

    kind: int
    stiffness: float
    touching: Array  # (3, 3), transition while the head touches; linear: the force and its rate
    flying: Array  # (3, 3), transition while it does not
    way: Array  # (3,), effect of the drive's way in m within the cycle
    gain: Array  # (3,), Kalman gain on the force
    decay: float  # what is left of a linear forecast's rate after a cycle


def _kalman(transition: Array, output: Array, process: Array, noise: float) -> Array:
    """Give the steady gain (n,) for a scalar measurement."""
    covariance = solve_discrete_are(transition.T, output[:, None], process, np.array([[noise**2]]))
    return np.asarray(covariance @ output / (output @ covariance @ output + noise**2))


def _sampled(generator: Array, intensity: Array, ts: float) -> tuple[Array, Array]:
    """Transition and process covariance over ts (s) of x' = generator x + white noise of this intensity (Van Loan)."""
    n = len(generator)
    big = np.zeros((2 * n, 2 * n))
    big[:n, :n], big[:n, n:], big[n:, n:] = -generator, intensity, generator.T
    step = expm(big * ts)
    transition = step[n:, n:].T
    return transition, transition @ step[:n, n:]


def design(rule: ForecastRule, ts: float) -> Design:
    """Design the filter for cycles of ts (s)."""
    kind = KINDS[rule.kind]
    touching, flying, way, gain = np.eye(3), np.eye(3), np.zeros(3), np.zeros(3)
    if kind == LINEAR:
        transition, process = _sampled(np.array([[0.0, 1.0], [0.0, 0.0]]), np.diag([0.0, rule.rate_noise**2]), ts)
        touching[:2, :2] = transition
        gain[:2] = _kalman(transition, np.array([1.0, 0.0]), process, rule.noise)
    elif kind == CONTACT:
        k, m = rule.stiffness, rule.head_mass
        generator = np.array([[0.0, 1.0, 0.0], [-k / m, 0.0, 1.0 / m], [0.0, 0.0, 0.0]])
        touching, process = _sampled(generator, np.diag([0.0, 0.0, rule.load_noise**2]), ts)
        gain = _kalman(touching, np.array([k, 0.0, 0.0]), process, rule.noise)
        # x is lowered by the drive's way at an even speed: the fourth column of one more exponential
        extended = np.zeros((4, 4))
        extended[:3, :3], extended[0, 3] = generator, -1.0
        way = expm(extended * ts)[:3, 3] / ts
        generator[1, 0] = 0.0
        flying = expm(generator * ts)
    return Design(kind, rule.stiffness, touching, flying, way, gain, math.exp(-ts / rule.decay))


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def _contact_step(d: Design, x: Array, way: float) -> None:
    """Move penetration, velocity and load (3,) on by one cycle, during which the drive goes this way (m)."""
    t = d.touching if x[0] > 0.0 else d.flying
    a = t[0, 0] * x[0] + t[0, 1] * x[1] + t[0, 2] * x[2]
    b = t[1, 0] * x[0] + t[1, 1] * x[1] + t[1, 2] * x[2]
    if x[0] > 0.0:
        a += d.way[0] * way
        b += d.way[1] * way
    else:
        a -= way
    x[0], x[1] = a, b


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def start(d: Design, x: Array, force: float, v_tr: float) -> None:
    """Set the filter (3,) to a steady force (N) on a drive that moves at v_tr (m/s)."""
    x[:] = 0.0
    if d.kind == CONTACT:
        x[0], x[1], x[2] = force / d.stiffness, v_tr, force
    else:
        x[0] = force


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def observe(d: Design, x: Array, force: float, way: float) -> None:
    """Move the filter (3,) on to t_k: the drive went this way (m) since t_(k-1), and F_tr(k) (N) was measured."""
    if d.kind == CONTACT:
        _contact_step(d, x, way)
        innovation = force - d.stiffness * max(0.0, x[0])
        # A head that is apart from the drive is seen no more until it is back.
        if x[0] > 0.0 or innovation > 0.0:
            if x[0] < 0.0:
                x[0] = 0.0
            for i in range(3):
                x[i] += d.gain[i] * innovation
    elif d.kind == LINEAR:
        x[0] += d.touching[0, 1] * x[1]
        innovation = force - x[0]
        x[0] += d.gain[0] * innovation
        x[1] += d.gain[1] * innovation


@njit(cache=True, fastmath=False)  # type: ignore[untyped-decorator]
def forecast(d: Design, x: Array, force: float, way: Array, out: Array, work: Array) -> None:
    """Predict the force at t_(k+1) .. t_(k+Np) into out (Np,), N.

    ``x`` (3,) is the filter at t_k and stays, ``force`` is F_tr(k), ``way`` (Np,) the drive's way in each coming cycle
    in m, ``work`` (3,) is overwritten.
    """
    if d.kind == CONTACT:
        for i in range(3):
            work[i] = x[i]
        for i in range(out.size):
            _contact_step(d, work, way[i])
            out[i] = d.stiffness * max(0.0, work[0])
    elif d.kind == LINEAR:
        now, rate = x[0], x[1] * d.touching[0, 1]
        for i in range(out.size):
            now += rate
            rate *= d.decay
            out[i] = max(0.0, now)
    else:
        for i in range(out.size):
            out[i] = force
