"""The harmonic waves that leave through an end, by either dispersion relation.

Continuous (3.26), w = exp(i (omega_x x + omega_t t)) put into (3.6):

    rhoA (omega_t - v omega_x)^2 - i beta (omega_t - v omega_x) = EI omega_x^4 + T omega_x^2

Discretised (3.27): the waves of the finite elements under Newmark's step, `waves`. Both depend on the direction as
soon as v is not zero. Damping, of the wire or of the integration, makes omega_x complex at a real omega_t.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.control_design.settings import Dispersion
from catenary_model.boundary.layer import BEHIND, Layer
from catenary_model.boundary.waves import newmark_factors, waves
from catenary_model.line import Wire

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Harmonics:
    """Waves that leave through one end, all of unit displacement at the end node at step 0."""

    field: Complex
    """q of the first nodes, inwards, (w, phi) interleaved, (2 nodes, frequencies)."""
    s_v: Complex
    """q' = s_v q, 1/s, (frequencies,)."""
    s_a: Complex
    """q'' = s_a q, 1/s^2, (frequencies,)."""
    shift: Complex
    """exp(i omega_t Ts): the phase that elapses in a step (3.34), (frequencies,)."""

    @property
    def state(self) -> Complex:
        """(q, q', q''), (6 nodes, frequencies)."""
        return np.vstack((self.field, self.field * self.s_v, self.field * self.s_a))


def continuous_wave_number(wire: Wire, speed: float, direction: int, omega: Array) -> Complex:
    """Return omega_x (1/m) of the wave that travels BEHIND or AHEAD at each omega_t (rad/s), (3.25) by (3.26)."""
    found = np.empty(omega.size, dtype=np.complex128)
    rho, beta = wire.mass_per_length, wire.damping
    for i, w in enumerate(omega):
        roots = np.roots(
            [
                wire.bending_stiffness,
                0.0,
                wire.tension - rho * speed**2,
                2.0 * rho * speed * w - 1j * beta * speed,
                -rho * w**2 + 1j * beta * w,
            ]
        )
        # the two with the smaller imaginary part travel, the others are bending
        waves_of = roots[np.argsort(np.abs(roots.imag))[:2]]
        found[i] = waves_of[np.argmax(waves_of.real) if direction == BEHIND else np.argmin(waves_of.real)]
    return found


def travelling(
    dispersion: Dispersion,
    wire: Wire,
    h: float,
    speed: float,
    end: int,
    nodes: int,
    frequency: Array,
    step: Layer,
    *,
    leave: bool = True,
) -> Harmonics:
    """Return the waves that leave through an end at each frequency (Hz, above 0), or those that come in from it."""
    direction = end if leave else 1 - end
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    inward = 1.0 if end == BEHIND else -1.0
    if dispersion == "continuous":
        k = continuous_wave_number(wire, speed, direction, omega)
        factor, slope = np.exp(1j * k * h * inward), 1j * k
        s_v, s_a = (1j * omega).astype(np.complex128), (-(omega**2)).astype(np.complex128)
    else:
        free = waves(wire, h, speed, omega, step)
        factor, slope = free.mu[:, direction, 0] ** inward, free.shape[:, direction, 0, 1]
        s_v, s_a = newmark_factors(omega, step)
    w = factor ** np.arange(nodes)[:, None]
    field = np.empty((2 * nodes, omega.size), dtype=np.complex128)
    field[0::2], field[1::2] = w, slope * w
    return Harmonics(field, np.asarray(s_v), np.asarray(s_a), np.exp(1j * omega * step.ts))
