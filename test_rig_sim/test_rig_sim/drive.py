"""The linear drive: equation of motion (3.42) with its friction and cogging forces."""

import math
from typing import NamedTuple

from phil_base.kernels import njit


class Drive(NamedTuple):
    """Constants of the linear drive, eq. (3.42). SI units; w is positive upwards."""

    mass: float  # kg, slider with contact plate
    force_constant: float  # N/A, K_f
    gravity: float  # m/s^2
    coulomb_friction: float  # N, of the moving slider
    static_friction: float  # N, of the slider at the edge of motion (Stribeck), at least the Coulomb friction
    stribeck_speed: float  # m/s, speed over which the static friction falls to the Coulomb friction
    friction_speed: float  # m/s, speed over which the friction builds up
    viscous_friction: float  # N s/m
    cogging_amplitude: float  # N, first harmonic
    cogging_second: float  # N, second harmonic
    cogging_period: float  # m, distance between equal magnet poles


@njit(cache=True, fastmath=False, forceinline=True)
def friction_force(drive: Drive, v: float) -> float:
    """F_friction(v) of (3.42) in N for the speed v (m/s) against the stator: Stribeck's curve plus viscous friction.

    (F_c + (F_s - F_c) exp(-(v/v_s)^2)) tanh(v/v_0) + d v. tanh in place of the sign keeps the equation of motion
    Lipschitz, so a fixed step integrates it through v = 0; below v_0 the slider creeps where a real one sticks.
    """
    ratio = v / drive.stribeck_speed
    dry = drive.coulomb_friction + (drive.static_friction - drive.coulomb_friction) * math.exp(-ratio * ratio)
    return dry * math.tanh(v / drive.friction_speed) + drive.viscous_friction * v


@njit(cache=True, fastmath=False, forceinline=True)
def cogging_force(drive: Drive, w: float) -> float:
    """F_cogging(w) of (3.42) in N at w (m) on the stator: pull of magnets on slots, two harmonics, zero at w = 0."""
    angle = 2.0 * math.pi * w / drive.cogging_period
    sine = math.sin(angle)
    return drive.cogging_amplitude * sine + drive.cogging_second * 2.0 * sine * math.cos(angle)


@njit(cache=True, fastmath=False, forceinline=True)
def stator_force(drive: Drive, w: float, v: float, current: float) -> float:
    """Force of the stator on the slider in N, positive up: motor force less cogging and friction, eq. (3.42).

    w (m) and v (m/s) are the slider's against the stator. Its reaction is what shakes the structure.
    """
    return drive.force_constant * current - cogging_force(drive, w) - friction_force(drive, v)


@njit(cache=True, fastmath=False, forceinline=True)
def drive_acceleration(drive: Drive, stator: float, contact: float) -> float:
    """Absolute acceleration of the slider in m/s^2, eq. (3.42).

    stator is the force of `stator_force` in N, contact the contact force in N, -F_d: it pushes the drive up.
    """
    return (stator + contact) / drive.mass - drive.gravity
