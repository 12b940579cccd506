"""Identification of the closed inner loop as a PT2 with dead time at the cycle time, eq. (3.44).

    python -m test_rig_sim.identify [PARAMETER_FILE ...] [--out FILE]

excites the closed loop of the rig without a pantograph, fits, holds the fit against an excitation of another kind, and
writes an ordinary ROS parameter file for the impedance controller. Nothing is taken from the loop's design: the same
would be done with a real rig.

The excitation is periodic (a sum of sines), so the loop's frequency response comes out without any model. What is
minimised is |G / G_model - 1|, the error of the reference that the model says was needed for what the rig did: the
controller inverts the model, and a model that answers less than the rig makes it overdrive. A fit of the motion itself
looks at the slow part alone, takes a lag for a lower natural frequency, and gives just such a model.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import least_squares
from scipy.signal import butter, lfilter, sosfilt

from phil_base.atomic import write_text
from phil_base.parameters import ParameterError, build, defaults, read_file
from test_rig_sim.parameters import Parameters
from test_rig_sim.rig import Rig

Array = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

LOWEST, HIGHEST, LINES = 0.5, 30.0, 60
"""Band in Hz and number of the sines, at equal ratios. The contact wire does little beyond 30 Hz, and a frequency
weighting at 40 or 60 Hz makes the loop anything but a PT2 there."""
PERIOD, PERIODS = 2.0, 3
"""Period of the excitation in s, and periods measured; one more before lets the loop settle."""
SPEED = 0.3
"""Effective speed in m/s, shared equally by the sines: that of a ride. Friction makes the loop depend on it."""
VALIDATION, AMPLITUDE = 4.0, 0.03
"""Length (s) of the validation and twice the standard deviation (m) of its reference."""
SEEDS = 0, 1
"""Seeds of excitation and validation."""


class Pt2(NamedTuple):
    """w''(t) = omega^2 (u(t - delay) - w) - 2 zeta omega w', and how well it explains other data than its own."""

    natural_frequency_hz: float  # Hz
    damping: float  # 1
    gain: float  # 1, factor on the model that explains the validation best: 1 for a loop without static error
    delay: float  # s
    residual: float  # 1, rms of the position error over the rms of the position, validation
    velocity_residual: float  # 1, the same of the velocity
    fit_residual: float  # 1, rms of |G / G_model - 1| over the sines


class Response(NamedTuple):
    """Frequencies (n,) in Hz, measured and fitted complex gain from reference to position (n,)."""

    frequencies_hz: Array
    measured: Complex
    model: Complex


class Record(NamedTuple):
    """A reference (n,) in m and what the rig and the model did with it, (n, 2) in m and m/s."""

    reference: Array
    measured: Array
    model: Array


def pt2_matrices(natural_frequency_hz: float, damping: float, period: float, delay: float = 0.0) -> tuple[Array, Array]:
    """Return A_tr (2, 2) and B_tr (2, n + 2) of the PT2 with dead time, n = ceil(delay / period), (3.44).

    x(k+1) = A_tr x(k) + sum_j B_tr[:, j] u(k + 1 - j) with x = (w, v): column 0 is that of u(k+1), column 1 that of
    u(k). Exact for a reference that goes linearly from u(k) to u(k+1) within the period (s), as the inner loop gets it:
    seen with the delay (s), it has its kink within the step, at the delay's fraction of a period. A reference that is
    held has B_tr = sum of all columns.
    """
    whole = math.floor(delay / period)
    kink = delay - whole * period
    omega = 2.0 * math.pi * natural_frequency_hz

    def sampled(step: float) -> tuple[Array, Array, Array]:
        """Give transition, effect of a constant input, and of an input that rises by 1 from 0 within the step."""
        generator = np.zeros((4, 4))
        generator[0, 1] = step
        generator[1, :3] = np.array([-(omega**2), -2.0 * damping * omega, omega**2]) * step
        generator[2, 3] = 1.0
        found = expm(generator)
        return found[:2, :2], found[:2, 2], found[:2, 3]

    # Up to the kink the input ends its way from u(k-1) to u(k), after it begins the one to u(k+1); from `whole` on.
    a_0, held_0, ramp_0 = sampled(kink)
    a_1, held_1, ramp_1 = sampled(period - kink)
    share = kink / period
    late = a_1 @ (share * held_0 - share * ramp_0)
    middle = a_1 @ ((1.0 - share) * held_0 + share * ramp_0) + held_1 - (1.0 - share) * ramp_1
    early = (1.0 - share) * ramp_1
    columns = [np.zeros(2)] * whole + [early, middle]
    if kink > 0.0:
        columns.append(late)
    return a_1 @ a_0, np.column_stack(columns)


def simulate_pt2(natural_frequency_hz: float, damping: float, period: float, u: Array, delay: float = 0.0) -> Array:
    """Return (w, v) (n, 2) of the PT2 at rest at u[0], for the piecewise linear reference u (n,) in m."""
    a, b = pt2_matrices(natural_frequency_hz, damping, period, delay)
    # Cayley and Hamilton: x(k+1) = tr A x(k) - det A x(k-1) + B u(k) - adj(A) B u(k-1) makes it one filter a state.
    denominator = np.array([1.0, -np.trace(a), np.linalg.det(a)])
    adjugate = np.trace(a) * np.eye(2) - a
    zero = np.zeros((2, 1))
    numerator = np.hstack([b, zero]) - np.hstack([zero, adjugate @ b])
    x = np.zeros((u.size, 2))
    for i in range(2):
        x[:, i] = lfilter(numerator[i], denominator, u - u[0])
    x[:, 0] += u[0]
    return x


def pt2_response(natural_frequency_hz: float, damping: float, period: float, f: Array, delay: float = 0.0) -> Complex:
    """Return the complex gain from reference to position of the sampled PT2 at the frequencies f (n,) in Hz."""
    a, b = pt2_matrices(natural_frequency_hz, damping, period, delay)
    z = np.exp(2j * math.pi * f * period)
    entry = (b[:, :, None] * z ** (1.0 - np.arange(b.shape[1]))[:, None]).sum(axis=1)
    # First row of (z - A)^-1.
    determinant = z**2 - np.trace(a) * z + np.linalg.det(a)
    return np.asarray(((z - a[1, 1]) * entry[0] + a[0, 1] * entry[1]) / determinant, dtype=np.complex128)


def excitation(period: float, seed: int = 0) -> tuple[Array, npt.NDArray[np.int64]]:
    """Return one period of the excitation in m, sampled every period (s), and the sines' numbers of cycles in it."""
    samples = round(PERIOD / period)
    cycles = np.unique(np.rint(np.geomspace(LOWEST, HIGHEST, LINES) * PERIOD)).astype(np.int64)
    phase = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, cycles.size)
    amplitude = SPEED * math.sqrt(2.0 / cycles.size) * PERIOD / (2.0 * np.pi * cycles)
    angle = 2.0 * np.pi * np.outer(cycles, np.arange(samples) / samples)
    return np.asarray(amplitude @ np.sin(angle + phase[:, None]), dtype=np.float64), cycles


def measured_response(rig: Rig, seed: int = 0) -> tuple[Array, Complex]:
    """Return frequencies (n,) in Hz and complex gains (n,) from reference to position of a rig without contact."""
    u, cycles = excitation(rig.cycle_time, seed)
    whole = np.tile(u, PERIODS + 1)
    soft = min(u.size // 4, whole.size)
    whole[:soft] *= np.arange(soft) / soft
    w = ride(rig, whole)[u.size :, 0].reshape(PERIODS, u.size).mean(axis=0)
    return cycles / PERIOD, (np.fft.rfft(w) / np.fft.rfft(u))[cycles]


def coloured_noise(cycles: int, period: float, amplitude: float, seed: int = 1) -> Array:
    """Return a reference (cycles,) in m for validation: noise of 2 Hz, with a tail up to `HIGHEST` Hz, from 0 on.

    amplitude (m) is twice its standard deviation; the motion of a contact wire is of that kind.
    """
    white = np.random.default_rng(seed).standard_normal(cycles)
    rate = 1.0 / period
    shape = np.vstack([butter(2, 2.0, fs=rate, output="sos"), butter(4, HIGHEST, fs=rate, output="sos")])
    noise = sosfilt(shape, white)
    ramp = np.minimum(1.0, np.arange(cycles) * period / 0.1)
    return np.asarray(0.5 * amplitude / noise.std() * ramp * noise, dtype=np.float64)


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


def relative_error(model: Array, measured: Array) -> Array:
    """Return the rms of the error over the rms of the measurement, of position and velocity (2,)."""
    return np.asarray(np.sqrt(((model - measured) ** 2).mean(axis=0) / (measured**2).mean(axis=0)))


def identify(parameters: Parameters) -> tuple[Pt2, Response, Record]:
    """Return the PT2 with dead time that explains the rig without contact best, with response and validation data.

    Least squares of |G / G_model - 1| over the sines. The model has the gain 1, as the impedance controller's; the gain
    that is told is what the validation's motion asks for on top.
    """
    period = parameters.cycle_time
    rig = Rig(parameters, contact=False)
    f, measured = measured_response(rig, SEEDS[0])

    def model(theta: Array) -> Complex:
        return pt2_response(theta[0], theta[1], period, f, max(0.0, theta[2]) * 1e-3)

    def error(theta: Array) -> Array:
        relative = measured / model(theta) - 1.0
        # A dead time below zero does not exist; what it would gain is lost again.
        return np.concatenate([relative.real, relative.imag, [10.0 * min(0.0, theta[2])]])

    # Delay in ms: numbers of one size.
    fit = least_squares(error, x0=[40.0, 0.8, 0.5], x_scale=[40.0, 0.8, 0.5])
    theta = np.asarray(fit.x, dtype=np.float64)
    frequency, damping, delay = float(theta[0]), float(theta[1]), max(0.0, float(theta[2])) * 1e-3
    v = coloured_noise(round(VALIDATION / period), period, AMPLITUDE, SEEDS[1])
    other = Record(v, ride(rig, v), simulate_pt2(frequency, damping, period, v, delay))
    residual = relative_error(other.model, other.measured)
    w, answer = other.model[:, 0], other.measured[:, 0]
    response = Response(f, measured, model(theta))
    found = Pt2(
        natural_frequency_hz=frequency,
        damping=damping,
        gain=float(w @ answer / (w @ w)),
        delay=delay,
        residual=float(residual[0]),
        velocity_residual=float(residual[1]),
        fit_residual=float(np.sqrt((np.abs(measured / response.model - 1.0) ** 2).mean())),
    )
    return found, response, other


def parameter_file(found: Pt2, period: float, source: str) -> str:
    """Return the text of a ROS parameter file for impedance_mpc that holds the identified rig; source names the rig."""
    a, b = pt2_matrices(found.natural_frequency_hz, found.damping, period, found.delay)

    def row(values: Array) -> str:
        return "[" + ", ".join(f"{value:.6g}" for value in values) + "]"

    band = f"from {LOWEST:g} to {HIGHEST:g} Hz: {found.fit_residual:.2%}"
    columns = ", ".join(["u(k+1)", "u(k)", *(f"u(k-{j})" for j in range(1, b.shape[1] - 1))])
    return f"""# Closed position loop of the rig as the impedance controller sees it: identified, eq. (3.44).
# Rig: {source}. Made by: python -m test_rig_sim.identify
# Residual on data of another kind than those of the fit (rms of the error over rms): position {found.residual:.2%},
# velocity {found.velocity_residual:.2%}. Rms of G / G_model - 1 {band}. Gain {found.gain:.5f}.
# At Ts = {period:g} s, x = (w, v):
#   A_tr = [{row(a[0])},
#           {row(a[1])}]
#   B_tr = [{row(b[0])},
#           {row(b[1])}]   for {columns}
impedance_mpc:
  ros__parameters:
    rig_natural_frequency_hz: {found.natural_frequency_hz:.3f}   # Hz
    rig_damping_ratio: {found.damping:.4f}           # 1
    rig_delay: {found.delay:.7f}            # s, dead time
"""


def main(arguments: list[str] | None = None) -> int:
    """Identify the default rig, or that of ROS parameter files; print the result, write it if asked."""
    parser = argparse.ArgumentParser(prog="python -m test_rig_sim.identify", description=__doc__.splitlines()[0])
    parser.add_argument("params", nargs="*", type=Path, metavar="PARAMS", help="ROS parameter files, later ones win")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write a parameter file for impedance_mpc there")
    given = parser.parse_args(arguments)
    values = defaults("test_rig_sim")
    try:
        for name in given.params:
            content = read_file(name)
            values |= content.get("test_rig_sim", {})
        parameters = build(Parameters, values, "test_rig_sim")
    except ParameterError as error:
        parser.error(str(error))
    found, _, _ = identify(parameters)
    source = ", ".join(path.stem for path in given.params) or "default"
    text = parameter_file(found, parameters.cycle_time, source)
    print(text, end="")
    if given.out:
        try:
            write_text(given.out, text)
        except OSError as error:
            parser.error(f"--out {given.out} cannot be written: {error.strerror}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
