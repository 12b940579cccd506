"""The observer of the contact force: low-passed, but without lag for slow signals.

A plain low-pass of some hundred hertz shows a slow force about half a millisecond late, and the work that is computed
from it with the drive's speed is off by a percent. This one keeps the force and its rate (an alpha-beta filter), so a
ramp is followed without lag, and looks ahead by the known lag of the load cell:

    F- = F + T F',   e = y - F-,   F = F- + alpha e,   F' = F' + beta e / T,   F_tr = F + lag F'
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phil_base.kernels import njit

Array = npt.NDArray[np.float64]


class ForceObserver(NamedTuple):
    """Gains of the observer; its memory is (F in N, F' in N/s)."""

    alpha: float  # 1
    beta: float  # 1/s, the usual beta over the period
    period: float  # s
    lag: float  # s, what the load cell shows too late


def force_observer(bandwidth_hz: float, damping: float, lag: float, period: float) -> ForceObserver:
    """Return the observer whose two poles have that natural frequency (Hz) and damping ratio, sampled every period (s).

    lag in s. Its transfer function for slow signals is 1 + O(s^2): no lag, a gain below 1 + (f / bandwidth)^2.
    Raises ValueError unless the bandwidth is below a fifth of the sampling rate.
    """
    if not 0.0 < bandwidth_hz * period < 0.2:
        raise ValueError(f"bandwidth {bandwidth_hz} Hz of the force observer has to be below {0.2 / period:g} Hz")
    s = 2.0 * math.pi * bandwidth_hz * (-damping + np.emath.sqrt(damping**2 - 1.0))
    t = 2.0 * math.pi * bandwidth_hz * (-damping - np.emath.sqrt(damping**2 - 1.0))
    z, y = np.exp(s * period), np.exp(t * period)
    # Characteristic polynomial z^2 - (2 - alpha - beta) z + 1 - alpha.
    alpha = 1.0 - float((z * y).real)
    beta = 2.0 - alpha - float((z + y).real)
    return ForceObserver(alpha, beta / period, period, lag)


@njit(cache=True, fastmath=False, forceinline=True)
def observe_force(observer: ForceObserver, memory: Array, measured: float) -> float:
    """Return the contact force (N) after the next sample (N); memory (2,) is changed in place."""
    ahead = memory[0] + observer.period * memory[1]
    error = measured - ahead
    memory[0] = ahead + observer.alpha * error
    memory[1] += observer.beta * error
    return memory[0] + observer.lag * memory[1]
