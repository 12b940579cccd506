"""Identification of the closed inner loop as a PT2 at the cycle time, eq. (3.44).

Run `python -m test_rig_sim.identify [PARAMETER_FILE]` to get the figures that the impedance controller needs.
"""

import math
import sys
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import least_squares

from phil_node.parameters import build, defaults, read_file
from test_rig_sim.parameters import Parameters
from test_rig_sim.rig import Rig

Array = npt.NDArray[np.float64]


class Pt2(NamedTuple):
    """w'' = omega^2 (gain u - w) - 2 zeta omega w', and how well it explains the data it was fitted to."""

    natural_frequency_hz: float  # Hz
    damping: float  # 1
    gain: float  # 1
    residual: float  # 1, rms of the position error over the rms of the position
    velocity_residual: float  # 1, the same of the velocity


def pt2_matrices(natural_frequency_hz: float, damping: float, period: float) -> tuple[Array, Array, Array]:
    """Return A_tr (2, 2), B_0 (2,), B_1 (2,) of x(k+1) = A_tr x(k) + B_0 u(k) + B_1 u(k+1), x = (w, v), (3.44).

    Exact for a reference that goes linearly from u(k) to u(k+1) within the period (s), as the inner loop gets it.
    A reference that is held has B_tr = B_0 + B_1.
    """
    omega = 2.0 * math.pi * natural_frequency_hz
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * damping * omega]])
    big = np.zeros((4, 4))
    big[:2, :2] = a * period
    big[1, 2] = omega**2 * period
    big[2, 3] = 1.0
    sampled = expm(big)
    held, ramp = sampled[:2, 2], sampled[:2, 3]
    return sampled[:2, :2], held - ramp, ramp


def simulate_pt2(natural_frequency_hz: float, damping: float, period: float, u: Array) -> Array:
    """Return (w, v) (n, 2) of the PT2 at rest at u[0], for the piecewise linear reference u (n,) in m."""
    a, b_0, b_1 = pt2_matrices(natural_frequency_hz, damping, period)
    x = np.empty((u.size, 2))
    x[0] = u[0], 0.0
    for k in range(u.size - 1):
        x[k + 1] = a @ x[k] + b_0 * u[k] + b_1 * u[k + 1]
    return x


def excitation(cycles: int, period: float, amplitude: float, seed: int = 0) -> Array:
    """Return a reference (cycles,) in m: a chirp from 0.5 to 60 Hz of about equal speed, and small random steps.

    amplitude (m) is that of the chirp at its slow end. Steps of 3 % of it come every 20 to 60 cycles: larger ones would
    drive the current to its limit (an error e asks for the acceleration omega^2 e).
    """
    random = np.random.default_rng(seed)
    t = np.arange(cycles) * period
    sweep = 59.5 / (cycles * period)
    u = amplitude * np.sin(2.0 * np.pi * (0.5 * t + 0.5 * sweep * t**2)) / (1.0 + 2.0 * sweep * t)
    k = 10
    while k < cycles:
        u[k:] += 0.03 * amplitude * random.uniform(-1.0, 1.0)
        k += int(random.integers(20, 61))
    return u


def ride(rig: Rig, u: Array) -> Array:
    """Return (w_tr, v_tr) (n, 2) of the rig for the piecewise linear reference u (n,) in m, from its reset."""
    rig.reset()
    x = np.empty((u.size, 2))
    for k in range(u.size):
        sample = rig.state
        x[k] = sample.w_tr, sample.v_tr
        if k + 1 < u.size:
            rig.advance(float(u[k]), float(u[k + 1]))
    return x


def identify(parameters: Parameters, duration: float = 4.0, amplitude: float = 0.03) -> Pt2:
    """Return the PT2 that explains the rig without contact best, by least squares on its simulated position.

    duration in s. The amplitude (m) should be that of a ride: friction makes the loop depend on it slightly.
    """
    u = excitation(round(duration / parameters.cycle_time), parameters.cycle_time, amplitude)
    measured = ride(Rig(parameters, contact=False), u)

    def error(theta: Array) -> Array:
        model = simulate_pt2(theta[0], theta[1], parameters.cycle_time, u)
        return np.asarray(theta[2] * model[:, 0] - measured[:, 0])

    fit = least_squares(error, x0=[40.0, 0.8, 1.0], x_scale=[40.0, 0.8, 1.0])
    frequency, damping, gain = (float(value) for value in fit.x)
    model = gain * simulate_pt2(frequency, damping, parameters.cycle_time, u)
    relative = np.sqrt(((model - measured) ** 2).mean(axis=0) / (measured**2).mean(axis=0))
    return Pt2(frequency, damping, gain, float(relative[0]), float(relative[1]))


def main(arguments: list[str] | None = None) -> int:
    """Print the PT2 of the default rig, or of the rig of a ROS parameter file."""
    names = sys.argv[1:] if arguments is None else arguments
    values = defaults("test_rig_sim")
    for name in names:
        content = read_file(name)
        values.update(content.get("/**", {}))
        values.update(content.get("test_rig_sim", {}))
    found = identify(build(Parameters, values))
    print(f"rig_natural_frequency_hz: {found.natural_frequency_hz:.2f}")
    print(f"rig_damping_ratio: {found.damping:.4f}")
    print(f"gain: {found.gain:.5f}")
    print(f"unexplained: {found.residual:.2%} of position, {found.velocity_residual:.2%} of velocity")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
