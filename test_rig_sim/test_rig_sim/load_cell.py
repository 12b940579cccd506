"""The load cell: noise and bias, then a second-order low-pass; and the drive's position encoder."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[np.float64]


class LoadCell(NamedTuple):
    """Bias and low-pass of the load cell: y = (b0 + b1/z + b2/z^2) / (1 + a1/z + a2/z^2) u."""

    bias: float  # N
    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


def load_cell(bias: float, cut_off_hz: float, damping: float, rate: float) -> LoadCell:
    """Return a load cell with the low-pass w^2/(s^2 + 2 zeta w s + w^2), bilinear, exact at its cut-off.

    bias in N, cut_off_hz in Hz, rate (samples a second) in Hz. The low-pass delays slow signals by
    2 zeta / w: `group_delay`. f_tr drives the catenary, so this delay takes part in the exchange of energy.
    Raises ValueError if the cut-off is not below half the rate.
    """
    if not 0.0 < cut_off_hz < 0.5 * rate:
        raise ValueError(f"load cell cut-off {cut_off_hz} Hz must lie between 0 and {0.5 * rate} Hz")
    c = 1.0 / math.tan(math.pi * cut_off_hz / rate)
    a0 = c * c + 2.0 * damping * c + 1.0
    return LoadCell(
        bias, 1.0 / a0, 2.0 / a0, 1.0 / a0, 2.0 * (1.0 - c * c) / a0, (c * c - 2.0 * damping * c + 1.0) / a0
    )


def group_delay(cut_off_hz: float, damping: float) -> float:
    """Return the delay in s of a slow force signal through the low-pass, 2 zeta / w."""
    return 2.0 * damping / (2.0 * math.pi * cut_off_hz)


@njit(cache=True, fastmath=False)
def filter_step(cell: LoadCell, memory: Array, u: float) -> float:
    """Return the low-pass's answer in N to the next sample u (N); memory (2,) is its state, changed in place."""
    y = cell.b0 * u + memory[0]
    memory[0] = cell.b1 * u - cell.a1 * y + memory[1]
    memory[1] = cell.b2 * u - cell.a2 * y
    return y


@njit(cache=True, fastmath=False)
def settle(cell: LoadCell, memory: Array, u: float) -> None:
    """Set the low-pass's memory (2,) to the steady state of a constant input u (N)."""
    memory[1] = (cell.b2 - cell.a2) * u
    memory[0] = (cell.b1 - cell.a1) * u + memory[1]


@njit(cache=True, fastmath=False)
def encode(position: float, resolution: float) -> float:
    """Return the position (m) as an encoder of that resolution (m) gives it; resolution 0: as it is."""
    if resolution <= 0.0:
        return position
    return math.floor(position / resolution + 0.5) * resolution
