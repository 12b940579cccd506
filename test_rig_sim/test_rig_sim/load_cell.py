"""The load cell between slider and contact plate, and the drive's position encoder."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from phil_base.kernels import njit

Array = npt.NDArray[np.float64]


class LoadCell(NamedTuple):
    """What the cell makes of the contact force; its dynamics sampled for an input that goes in straight lines.

    x(+) = transition x + before u + after u(+), x = (force shown in N, its rate in N/s).
    """

    plate_mass: float  # kg, share of the mass between cell and contact that is not compensated
    bias: float  # N
    transition: Array  # (2, 2)
    before: Array  # (2,)
    after: Array  # (2,)


def load_cell(plate_mass: float, bias: float, bandwidth_hz: float, damping: float, step: float) -> LoadCell:
    """Return a load cell with the dynamics w^2/(s^2 + 2 zeta w s + w^2), sampled exactly every step (s).

    plate_mass in kg, bias in N, bandwidth_hz in Hz; a bandwidth of 0 is a cell that shows its input at once.
    """
    if bandwidth_hz <= 0.0:
        return LoadCell(plate_mass, bias, np.zeros((2, 2)), np.zeros(2), np.array([1.0, 0.0]))
    omega = 2.0 * math.pi * bandwidth_hz
    # State (y, y'/omega) for numbers of one size, then input and its slope.
    generator = np.zeros((4, 4))
    generator[0, 1] = omega
    generator[1, :3] = -omega, -2.0 * damping * omega, omega
    generator[2, 3] = 1.0 / step
    sampled = expm(generator * step)
    scale = np.array([1.0, omega])
    transition = scale[:, None] * sampled[:2, :2] / scale
    held, ramp = scale * sampled[:2, 2], scale * sampled[:2, 3]
    return LoadCell(plate_mass, bias, np.ascontiguousarray(transition), held - ramp, ramp)


def lag(bandwidth_hz: float, damping: float) -> float:
    """Return by how much the cell shows a slow force too late, 2 zeta / w in s; 0 for a bandwidth of 0."""
    return damping / (math.pi * bandwidth_hz) if bandwidth_hz > 0.0 else 0.0


@njit(cache=True, fastmath=False, forceinline=True)
def sense(cell: LoadCell, memory: Array, before: float, after: float) -> float:
    """Return what the cell shows (N) after a step in which its input went from before to after (N).

    memory (2,) is the cell's state, changed in place.
    """
    a, b, c = cell.transition, cell.before, cell.after
    y = a[0, 0] * memory[0] + a[0, 1] * memory[1] + b[0] * before + c[0] * after
    memory[1] = a[1, 0] * memory[0] + a[1, 1] * memory[1] + b[1] * before + c[1] * after
    memory[0] = y
    return y


@njit(cache=True, fastmath=False, forceinline=True)
def cell_input(cell: LoadCell, contact: float, acceleration: float) -> float:
    """Return the force in the cell in N, weight tared: the contact force less what moves the plate.

    contact in N, acceleration (m/s^2) is the plate's absolute one.
    """
    return contact - cell.plate_mass * acceleration


@njit(cache=True, fastmath=False, forceinline=True)
def encode(position: float, resolution: float) -> float:
    """Return the position (m) as an encoder of that resolution (m) gives it; resolution 0: as it is."""
    if resolution <= 0.0:
        return position
    return math.floor(position / resolution + 0.5) * resolution
