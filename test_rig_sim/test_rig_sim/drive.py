"""The linear drive: equation of motion (3.42) with its friction and cogging forces."""

import math
from typing import NamedTuple

from numba import njit


class Drive(NamedTuple):
    """Constants of the linear drive, eq. (3.42). SI units; w is positive upwards."""

    mass: float  # kg, slider with contact plate
    force_constant: float  # N/A, K_f
    current_limit: float  # A, of either sign
    gravity: float  # m/s^2
    coulomb_friction: float  # N
    friction_speed: float  # m/s, speed over which the Coulomb force builds up
    viscous_friction: float  # N s/m
    cogging_amplitude: float  # N
    cogging_period: float  # m, distance between equal magnet poles


@njit(cache=True, fastmath=False)
def friction_force(drive: Drive, v: float) -> float:
    """F_friction(v) of (3.42) in N: Coulomb friction smoothed by tanh(v / friction_speed), plus viscous.

    The smoothing keeps the equation of motion Lipschitz, so a fixed step integrates it through v = 0.
    """
    return drive.coulomb_friction * math.tanh(v / drive.friction_speed) + drive.viscous_friction * v


@njit(cache=True, fastmath=False)
def cogging_force(drive: Drive, w: float) -> float:
    """F_cogging(w) of (3.42) in N: first harmonic of the pull of the magnets on the slots, zero at w = 0."""
    return drive.cogging_amplitude * math.sin(2.0 * math.pi * w / drive.cogging_period)


@njit(cache=True, fastmath=False)
def drive_acceleration(drive: Drive, w: float, v: float, current: float, contact_force: float) -> float:
    """Acceleration of the slider in m/s^2, eq. (3.42), with F_d = -contact_force (it pushes the drive up)."""
    force = drive.force_constant * current - cogging_force(drive, w) - friction_force(drive, v) + contact_force
    return force / drive.mass - drive.gravity
