"""Offline design of the inner position loop: LQR and disturbance observer at the inner rate."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from scipy.linalg import expm, solve_discrete_are

from test_rig_sim.drive import Drive

Array = npt.NDArray[np.float64]


class Weights(NamedTuple):
    """Weights of the LQR's cost: sum of position_weight e^2 + velocity_weight v^2 + current_weight i^2."""

    position_weight: float  # 1/m^2
    velocity_weight: float  # s^2/m^2
    current_weight: float  # 1/A^2


class Noise(NamedTuple):
    """What the Kalman filter is told: it trades its speed against the encoder's noise."""

    disturbance_noise: float  # N/sqrt(s), random walk of the unknown force
    position_noise: float  # m, standard deviation of one encoder sample


class InnerLoop(NamedTuple):
    """The control law and observer as the real-time step needs them."""

    position_gain: float  # A/m
    velocity_gain: float  # A s/m
    force_constant: float  # N/A
    weight_force: float  # N, m g
    current_limit: float  # A
    transition: Array  # (3, 3), observer's prediction of (w, v, d)
    input: Array  # (3,), effect of the known force (N) within one inner step
    correction: Array  # (3,), Kalman gain on the position's innovation


def _discrete(drive: Drive, period: float) -> tuple[Array, Array]:
    """Slider (w, v) and constant disturbance force d, driven by a force held over the period."""
    continuous = np.zeros((4, 4))
    continuous[0, 1] = 1.0
    continuous[1, 1] = -drive.viscous_friction / drive.mass
    continuous[1, 2] = continuous[1, 3] = 1.0 / drive.mass
    sampled = expm(continuous * period)
    return np.ascontiguousarray(sampled[:3, :3]), np.ascontiguousarray(sampled[:3, 3])


def design(drive: Drive, weights: Weights, noise: Noise, period: float) -> InnerLoop:
    """Return the gains of the inner loop sampled every period (s), thesis 3.2.1.

    The LQR acts on (w - reference, v) of the linear part of (3.42). The plant integrates twice, so using
    the position gain on the reference too (the static prefilter) gives unity gain and no zero: a PT2. What the linear
    part lacks (cogging, Coulomb friction, errors of the force measurement) is the observer's d, which the
    control law takes off together with weight and measured contact force. The observer is fed with the
    limited current, so nothing in the loop can wind up. Raises ValueError if the loop is not stable.
    """
    a, b = _discrete(drive, period)
    a_w, b_i = a[:2, :2], (b[:2] * drive.force_constant).reshape(2, 1)
    q = np.diag([weights.position_weight, weights.velocity_weight])
    r = np.array([[weights.current_weight]])
    p = solve_discrete_are(a_w, b_i, q, r)
    gain = np.linalg.solve(r + b_i.T @ p @ b_i, b_i.T @ p @ a_w)[0]

    c = np.array([[1.0, 0.0, 0.0]])
    process = np.diag([0.0, 0.0, noise.disturbance_noise**2 * period])
    measured = np.array([[noise.position_noise**2]])
    covariance = solve_discrete_are(a.T, c.T, process, measured)
    correction = (covariance @ c.T @ np.linalg.inv(c @ covariance @ c.T + measured))[:, 0]
    loop = InnerLoop(
        position_gain=float(gain[0]),
        velocity_gain=float(gain[1]),
        force_constant=drive.force_constant,
        weight_force=drive.mass * drive.gravity,
        current_limit=drive.current_limit,
        transition=a,
        input=b,
        correction=np.ascontiguousarray(correction),
    )
    radius = max(np.abs(loop_poles(loop)).max(), np.abs(observer_poles(loop)).max())
    if not radius < 1.0:
        raise ValueError(f"inner loop is not stable, spectral radius {radius:.6f}")
    return loop


def loop_poles(loop: InnerLoop) -> npt.NDArray[np.complex128]:
    """Return the two poles of the closed position loop in the z plane (nominal plant)."""
    feedback = np.array([loop.position_gain, loop.velocity_gain]) * loop.force_constant
    return np.linalg.eigvals(loop.transition[:2, :2] - np.outer(loop.input[:2], feedback)).astype(np.complex128)


def observer_poles(loop: InnerLoop) -> npt.NDArray[np.complex128]:
    """Return the three poles of the observer's error in the z plane."""
    error = (np.eye(3) - np.outer(loop.correction, [1.0, 0.0, 0.0])) @ loop.transition
    return np.linalg.eigvals(error).astype(np.complex128)


def pt2_of_poles(poles: npt.NDArray[np.complex128], period: float) -> tuple[float, float]:
    """Return natural frequency (Hz) and damping ratio of a pole pair in the z plane, sampled every period (s)."""
    s = np.log(poles.astype(np.complex128)) / period
    natural = math.sqrt(abs(s[0] * s[1]))
    return natural / (2.0 * math.pi), float(-(s[0] + s[1]).real / (2.0 * natural))


def weights_for(drive: Drive, natural_frequency_hz: float, damping: float, position_weight: float) -> Weights:
    """Return LQR weights that give a wanted PT2 (continuous-time formula, good to a few percent at 5 kHz).

    For the double integrator with gain b = K_f / m: omega^4 = q_w b^2 / r and
    4 zeta^2 omega^2 = 2 omega^2 + q_v b^2 / r; hence damping must be at least 1/sqrt(2), else ValueError.
    natural_frequency_hz in Hz, position_weight in 1/m^2.
    """
    if damping < math.sqrt(0.5):
        raise ValueError("an LQR without cross terms has a damping ratio of at least 0.707")
    omega = 2.0 * math.pi * natural_frequency_hz
    current_weight = position_weight * (drive.force_constant / drive.mass) ** 2 / omega**4
    velocity_weight = position_weight * (4.0 * damping**2 - 2.0) / omega**2
    return Weights(position_weight, velocity_weight, current_weight)


@njit(cache=True, fastmath=False)
def control_law(loop: InnerLoop, estimate: Array, reference: float, f_tr: float) -> float:
    """Return the limited current demand in A for estimate (w, v, d) (3,), reference in m, f_tr in N."""
    current = (
        loop.position_gain * (reference - estimate[0])
        - loop.velocity_gain * estimate[1]
        + (loop.weight_force - f_tr - estimate[2]) / loop.force_constant
    )
    return min(max(current, -loop.current_limit), loop.current_limit)


@njit(cache=True, fastmath=False)
def observe(loop: InnerLoop, estimate: Array, current: float, f_tr: float, measured: float) -> None:
    """Move the estimate (w, v, d) (3,) on by one inner step, in place.

    current (A) and f_tr (N) acted during the step, measured (m) is the encoder at its end.
    """
    force = loop.force_constant * current - loop.weight_force + f_tr
    a = loop.transition
    w = a[0, 0] * estimate[0] + a[0, 1] * estimate[1] + a[0, 2] * estimate[2] + loop.input[0] * force
    v = a[1, 1] * estimate[1] + a[1, 2] * estimate[2] + loop.input[1] * force
    innovation = measured - w
    estimate[0] = w + loop.correction[0] * innovation
    estimate[1] = v + loop.correction[1] * innovation
    estimate[2] += loop.correction[2] * innovation
