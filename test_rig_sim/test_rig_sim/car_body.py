"""Motion of the car body under the pantograph: bounce, pitch and a random part, place and rate at each cycle.

    base(t) = fade(t) (a_b sin(2 pi f_b t) + a_p sin(2 pi f_p t) + r(t))

r is white noise through three equal first-order low-passes, sampled without error, so it and its rate are continuous;
it begins in its stationary state. The fade is half a cosine over the first second: a ride begins at rest.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm, solve_continuous_lyapunov

from phil_base.kernels import njit
from test_rig_sim.pantograph_parameters import CarBodyParameters

Array = npt.NDArray[np.float64]

FADE = 1.0
"""s, time in which the motion comes up."""


class Shaper(NamedTuple):
    """The random part, sampled: x(k+1) = transition x(k) + spread n(k), n standard normal, x = (r, r', r'')."""

    transition: Array  # (3, 3)
    spread: Array  # (3, 3)
    stationary: Array  # (3, 3): x(0) = stationary n


def shaper(rms: float, cut_off_hz: float, period: float) -> Shaper:
    """Return the low-pass (1 + s/w)^-3 of white noise with that rms (m) and corner (Hz), sampled every period (s)."""
    w = 2.0 * math.pi * cut_off_hz
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-(w**3), -3.0 * w**2, -3.0 * w]])
    shape = np.diag([1.0, w, w**2])  # of unit size in these coordinates, or the Cholesky factors lose their digits
    inverse = np.diag(1.0 / np.diag(shape))
    noise = np.zeros((3, 3))
    noise[2, 2] = 1.0
    scaled = inverse @ a @ shape
    covariance = solve_continuous_lyapunov(scaled, -noise)
    covariance *= rms**2 / covariance[0, 0]
    transition = expm(scaled * period)
    step = covariance - transition @ covariance @ transition.T
    return Shaper(
        np.ascontiguousarray(shape @ transition @ inverse),
        np.ascontiguousarray(shape @ _root(step)),
        np.ascontiguousarray(shape @ _root(covariance)),
    )


def _root(covariance: Array) -> Array:
    """Return R with R R' = covariance (3, 3), which may be singular but for rounding."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)), dtype=np.float64)


@njit(cache=True, fastmath=False)
def next_random(transition: Array, spread: Array, x: Array, normal: Array, work: Array) -> None:
    """Move x (3,) on by one cycle with the draws normal (3,), in place; work is (3,)."""
    for i in range(3):
        work[i] = 0.0
        for j in range(3):
            work[i] += transition[i, j] * x[j] + spread[i, j] * normal[j]
    for i in range(3):
        x[i] = work[i]


class CarBody:
    """Place and rate of the car body at each cycle, in order from cycle 0. Equal parameters give equal bits."""

    def __init__(self, parameters: CarBodyParameters, cycle_time: float) -> None:
        p = parameters
        self._cycle_time = cycle_time
        self._harmonics = [
            (amplitude, 2.0 * math.pi * frequency)
            for amplitude, frequency in (
                (p.bounce_amplitude, p.bounce_frequency_hz),
                (p.pitch_amplitude, p.pitch_frequency_hz),
            )
            if amplitude > 0.0
        ]
        self._shaper = shaper(p.random_rms, p.random_cut_off_hz, cycle_time) if p.random_rms > 0.0 else None
        self._seed = p.seed
        self._x, self._normal, self._work = np.zeros(3), np.zeros(3), np.zeros(3)
        self.moving = bool(self._harmonics) or self._shaper is not None
        self.reset()

    def reset(self) -> None:
        """Go back to cycle 0, with the random part from the seed anew."""
        self._cycle = 0
        self._random = np.random.default_rng(self._seed)
        if self._shaper is not None:
            self._x[:] = self._shaper.stationary @ self._random.standard_normal(3)

    def next(self) -> tuple[float, float]:
        """Return place (m) and rate (m/s) of the next cycle; the first call gives those of cycle 1."""
        if not self.moving:
            return 0.0, 0.0
        self._cycle += 1
        t = self._cycle * self._cycle_time
        place = rate = 0.0
        for amplitude, omega in self._harmonics:
            place += amplitude * math.sin(omega * t)
            rate += amplitude * omega * math.cos(omega * t)
        if self._shaper is not None:
            self._random.standard_normal(out=self._normal)
            next_random(self._shaper.transition, self._shaper.spread, self._x, self._normal, self._work)
            place += float(self._x[0])
            rate += float(self._x[1])
        if t < FADE:
            share = math.pi * t / FADE
            fade, fade_rate = 0.5 - 0.5 * math.cos(share), 0.5 * math.pi / FADE * math.sin(share)
            place, rate = fade * place, fade * rate + fade_rate * place
        return place, rate
