"""Offline design of the inner position loop: frequency-weighted LQR and disturbance observer at the inner rate.

The plant of the LQR is the slider's linear part of (3.42), augmented by one filter (3.43) for each resonance of the
structure (Fig. 3.12):

    G(s) = s w / (s^2 + 2 zeta w s + w^2),   z1' = w z2,   z2' = -w z1 - 2 zeta w z2 + w i,   output z2,

which lets the current pass near its w only. Weighting the output makes current dear there, and the feedback of (z1, z2)
gives the current a zero at every w.

The demand is feedback plus feedforward (weight, contact force, disturbance). Both have that zero, so whatever enters is
kept off the resonances, and each has its own filters: those of the LQR are driven by the feedback alone, and the
feedforward goes through notches with the same zeros and with poles of the damping that the LQR gave its own. One set of
filters driven by the sum would do as well at the resonances, but it amplifies the feedforward above them by a quarter:
what the observer takes for a disturbance at rest, the slope of the dry friction, is then overcompensated, and the drive
hunts.

A demand that acts `delay` steps later is no matter for the gains: the law uses the state that the observer predicts for
that instant. The closed loop is the one without delay, later.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag, expm, solve_discrete_are

from phil_base.kernels import njit
from test_rig_sim.drive import Drive

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]


class Weights(NamedTuple):
    """Weights of the LQR's cost: sum of position_weight e^2 + velocity_weight v^2 + current_weight i^2."""

    position_weight: float  # 1/m^2
    velocity_weight: float  # s^2/m^2
    current_weight: float  # 1/A^2


class Resonance(NamedTuple):
    """One frequency that the current shall not contain, eq. (3.43)."""

    frequency_hz: float  # Hz
    damping: float  # 1, of the filter: how narrow it is
    weight: float  # 1, weight of the filter's output over that of the current


class Noise(NamedTuple):
    """What the Kalman filter is told: it trades its speed against the encoder's noise."""

    disturbance_noise: float  # N/sqrt(s), random walk of the unknown force
    position_noise: float  # m, standard deviation of one encoder sample


class Amplifier(NamedTuple):
    """What the motor's amplifier does to the demand."""

    current_limit: float  # A, of either sign
    current_slew: float  # A/s
    delay: int  # 1, inner steps between a demand and its force


class InnerLoop(NamedTuple):
    """The control law and observer as the real-time step needs them; f is the number of filters."""

    position_gain: float  # A/m
    velocity_gain: float  # A s/m
    filter_gain: Array  # (2 f,), 1, of the LQR on (z1, z2) of each filter
    notch_gain: Array  # (2 f,), 1, of the feedforward's notches on theirs
    force_constant: float  # N/A
    weight_force: float  # N, m g
    current_limit: float  # A
    current_step: float  # A, largest change of the demand from one inner step to the next
    transition: Array  # (3, 3), observer's prediction of (w, v, d)
    input: Array  # (3,), effect of the known force (N) within one inner step
    correction: Array  # (3,), Kalman gain on the position's innovation
    filter_transition: Array  # (2 f, 2), rows of each filter's own 2 x 2
    filter_input: Array  # (2 f,), 1


def _sampled(a: Array, b: Array, period: float) -> tuple[Array, Array]:
    """Return x' = a x + b u sampled every period (s) for a held scalar input."""
    n = a.shape[0]
    generator = np.zeros((n + 1, n + 1))
    generator[:n, :n], generator[:n, n] = a * period, b * period
    step = expm(generator)
    return np.ascontiguousarray(step[:n, :n]), np.ascontiguousarray(step[:n, n])


def _slider(drive: Drive, period: float) -> tuple[Array, Array]:
    """Slider (w, v) and constant disturbance force d, driven by a force held over the period."""
    a = np.zeros((3, 3))
    a[0, 1] = 1.0
    a[1, 1] = -drive.viscous_friction / drive.mass
    a[1, 2] = 1.0 / drive.mass
    return _sampled(a, np.array([0.0, 1.0 / drive.mass, 0.0]), period)


def _filter(resonance: Resonance, period: float) -> tuple[Array, Array]:
    """Return the filter (3.43) with the states (z1, z2), sampled exactly for a held current."""
    omega = 2.0 * math.pi * resonance.frequency_hz
    a = omega * np.array([[0.0, 1.0], [-1.0, -2.0 * resonance.damping]])
    return _sampled(a, np.array([0.0, omega]), period)


def _regulator(
    drive: Drive, weights: Weights, resonances: tuple[Resonance, ...], period: float
) -> tuple[Array, Array, Array]:
    """Return gain (2 + 2f,) of the LQR on the augmented plant, and that plant's transition and input (current)."""
    a, b = _slider(drive, period)
    filters = [_filter(resonance, period) for resonance in resonances]
    transition = block_diag(a[:2, :2], *(f[0] for f in filters))
    entry = np.concatenate([b[:2] * drive.force_constant, *(f[1] for f in filters)]).reshape(-1, 1)
    q = [weights.position_weight, weights.velocity_weight]
    for resonance in resonances:
        q += [0.0, resonance.weight * weights.current_weight]
    r = np.array([[weights.current_weight]])
    p = solve_discrete_are(transition, entry, np.diag(q), r)
    gain = np.linalg.solve(r + entry.T @ p @ entry, entry.T @ p @ transition)[0]
    return gain, transition, entry[:, 0]


def design(
    drive: Drive,
    weights: Weights,
    resonances: tuple[Resonance, ...],
    noise: Noise,
    amplifier: Amplifier,
    period: float,
) -> InnerLoop:
    """Return the gains of the inner loop sampled every period (s), thesis 3.2.1.

    The LQR acts on (w - reference, v, z). The plant integrates twice, so using the position gain on the reference too
    (the static prefilter) gives unity gain and no zero beside those of the filters: a PT2. What the linear part lacks
    (cogging, dry friction, errors of the force measurement) is the observer's d, which the control law takes off
    together with weight and measured contact force. Observer and filters are fed with the limited current, so nothing
    in the loop can wind up. Raises ValueError if the loop is not stable.
    """
    gain, transition, entry = _regulator(drive, weights, resonances, period)
    a, b = _slider(drive, period)
    c = np.array([[1.0, 0.0, 0.0]])
    process = np.diag([0.0, 0.0, noise.disturbance_noise**2 * period])
    measured = np.array([[noise.position_noise**2]])
    covariance = solve_discrete_are(a.T, c.T, process, measured)
    correction = (covariance @ c.T @ np.linalg.inv(c @ covariance @ c.T + measured))[:, 0]
    size = 2 * len(resonances)
    rows, notches = np.zeros((size, 2)), np.zeros(size)
    poles = np.linalg.eigvals(transition - np.outer(entry, gain)).astype(np.complex128)
    for j, resonance in zip(range(0, size, 2), resonances, strict=True):
        rows[j : j + 2] = transition[2 + j : 4 + j, 2 + j : 4 + j]
        notches[j : j + 2] = _notch(resonance, rows[j : j + 2], entry[2 + j : 4 + j], poles, period)
    loop = InnerLoop(
        position_gain=float(gain[0]),
        velocity_gain=float(gain[1]),
        filter_gain=np.ascontiguousarray(gain[2:]),
        notch_gain=notches,
        force_constant=drive.force_constant,
        weight_force=drive.mass * drive.gravity,
        current_limit=amplifier.current_limit,
        current_step=amplifier.current_slew * period,
        transition=a,
        input=b,
        correction=np.ascontiguousarray(correction),
        filter_transition=rows,
        filter_input=np.ascontiguousarray(entry[2:]),
    )
    closed = transition - np.outer(entry, gain)
    radius = max(np.abs(np.linalg.eigvals(closed)).max(), np.abs(observer_poles(loop)).max())
    if not radius < 1.0:
        raise ValueError(f"inner loop is not stable, spectral radius {radius:.6f}")
    return loop


def _notch(resonance: Resonance, a: Array, b: Array, poles: Complex, period: float) -> Array:
    """Return the gain (2,) on a filter a, b that makes it a notch of the damping that the LQR gave this filter.

    poles are those of the closed position loop. The pair nearest to the resonance is its filter's.
    """
    omega = 2.0 * math.pi * resonance.frequency_hz
    s = np.log(poles) / period
    nearest = s[np.argmin(np.abs(s - 1j * omega))]
    damping = max(resonance.damping, float(-nearest.real / abs(nearest)))
    wanted = np.exp(omega * (-damping + np.emath.sqrt(damping**2 - 1.0)) * period)
    # Ackermann's formula: the pair may be one real pole twice.
    polynomial = a @ a - 2.0 * wanted.real * a + abs(wanted) ** 2 * np.eye(2)
    gain: Array = np.linalg.solve(np.column_stack([b, a @ b]), polynomial)[1]
    return gain


def loop_poles(loop: InnerLoop) -> Complex:
    """Return the poles of the closed position loop in the z plane (nominal plant): the PT2's two first, then filters'.

    The PT2's are those that are slowest.
    """
    size = loop.filter_input.size
    transition = np.zeros((2 + size, 2 + size))
    transition[:2, :2] = loop.transition[:2, :2]
    for j in range(0, size, 2):
        transition[2 + j : 4 + j, 2 + j : 4 + j] = loop.filter_transition[j : j + 2]
    entry = np.concatenate([loop.input[:2] * loop.force_constant, loop.filter_input])
    gain = np.concatenate([[loop.position_gain, loop.velocity_gain], loop.filter_gain])
    poles = np.linalg.eigvals(transition - np.outer(entry, gain)).astype(np.complex128)
    return poles[np.argsort(np.abs(np.log(poles)), kind="stable")]


def observer_poles(loop: InnerLoop) -> Complex:
    """Return the three poles of the observer's error in the z plane."""
    error = (np.eye(3) - np.outer(loop.correction, [1.0, 0.0, 0.0])) @ loop.transition
    return np.linalg.eigvals(error).astype(np.complex128)


def pt2_of_poles(poles: Complex, period: float) -> tuple[float, float]:
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


@njit(cache=True, fastmath=False, forceinline=True)
def pass_on(loop: InnerLoop, filters: Array, place: int, row: int, current: float) -> None:
    """Move the filter whose states begin at place and whose rows begin at row on by one held current (A)."""
    a, b = loop.filter_transition, loop.filter_input
    first, second = filters[place], filters[place + 1]
    filters[place] = a[row, 0] * first + a[row, 1] * second + b[row] * current
    filters[place + 1] = a[row + 1, 0] * first + a[row + 1, 1] * second + b[row + 1] * current


@njit(cache=True, fastmath=False, forceinline=True)
def control_law(loop: InnerLoop, estimate: Array, filters: Array, queue: Array, reference: float, f_tr: float) -> float:
    """Return the limited current demand in A; moves filters and queue on by it.

    estimate (w, v, d) (3,), filters (4 f,): those of the LQR, then the notches; queue (delay + 1,): the demands from
    the one that acted last to the newest one, reference in m, f_tr in N.
    """
    delay = queue.size - 1
    a = loop.transition
    w = estimate[0]
    v = estimate[1]
    for j in range(1, delay + 1):
        force = loop.force_constant * queue[j] - loop.weight_force + f_tr
        w += a[0, 1] * v + a[0, 2] * estimate[2] + loop.input[0] * force
        v = a[1, 1] * v + a[1, 2] * estimate[2] + loop.input[1] * force
    size = filters.size // 2
    feedforward = (loop.weight_force - f_tr - estimate[2]) / loop.force_constant
    for j in range(0, size, 2):
        first, second = loop.notch_gain[j], loop.notch_gain[j + 1]
        # A constant input i rests a filter at z1 = i, z2 = 0: the notch lets it pass as it is.
        feedforward += first * (feedforward - filters[size + j]) - second * filters[size + j + 1]
        pass_on(loop, filters, size + j, j, feedforward)
    feedback = loop.position_gain * (reference - w) - loop.velocity_gain * v
    for j in range(size):
        feedback -= loop.filter_gain[j] * filters[j]
    last = queue[delay]
    current = min(max(feedback + feedforward, last - loop.current_step), last + loop.current_step)
    current = min(max(current, -loop.current_limit), loop.current_limit)
    for j in range(0, size, 2):
        pass_on(loop, filters, j, j, current - feedforward)
    for j in range(delay):
        queue[j] = queue[j + 1]
    queue[delay] = current
    return current


@njit(cache=True, fastmath=False, forceinline=True)
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
