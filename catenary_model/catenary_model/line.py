"""What a periodic overhead line is made of, in the frame of the track."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Wire:
    """Euler-Bernoulli beam under axial tension (3.1)."""

    mass_per_length: float
    """rhoA, kg/m."""
    damping: float
    """beta, N s/m^2."""
    bending_stiffness: float
    """EI, N m^2."""
    tension: float
    """T, N."""

    def __post_init__(self) -> None:
        for name in ("mass_per_length", "bending_stiffness", "tension"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")
        if not (math.isfinite(self.damping) and self.damping >= 0.0):
            raise ValueError(f"damping = {self.damping} must be finite and at least 0")

    @property
    def wave_speed(self) -> float:
        """Speed c = sqrt(T / rhoA) of long transverse waves, m/s."""
        return math.sqrt(self.tension / self.mass_per_length)

    @property
    def bending_length(self) -> float:
        """Length sqrt(EI / T) over which a point load rounds the wire, m."""
        return math.sqrt(self.bending_stiffness / self.tension)

    def frequency(self, wave_number: float) -> float:
        """Angular frequency of an undamped wave at rest, rad/s, from the dispersion relation (3.26) with v = 0."""
        k2 = wave_number * wave_number
        return math.sqrt((self.tension * k2 + self.bending_stiffness * k2 * k2) / self.mass_per_length)


CARRIER_3_1 = Wire(mass_per_length=1.07, damping=0.6, bending_stiffness=100.0, tension=16e3)
"""Carrier wire of Table 3.1."""
CONTACT_3_1 = Wire(mass_per_length=1.35, damping=0.2, bending_stiffness=150.0, tension=20e3)
"""Contact wire of Table 3.1."""
DROPPERS_3_1 = (5.0, 10.5, 17.0, 23.5, 30.0, 36.5, 43.0, 49.5, 55.0)
"""Dropper positions of Table 3.1 within a span of 60 m."""


@dataclass(frozen=True)
class Line:
    """Endless sequence of equal spans; span s reaches from s L to (s + 1) L, masts stand at its ends.

    Raises ValueError, naming the field as `Config.line` has it, for what cannot be built.
    """

    carrier: Wire = CARRIER_3_1
    contact: Wire = CONTACT_3_1
    span_length: float = 60.0
    """L, m."""
    dropper_positions: tuple[float, ...] = DROPPERS_3_1
    """Positions within a span, rising, strictly between 0 and L, m. Empty: two wires on their own."""
    dropper_stiffness: float = 1e5
    """k_d of a taut dropper, N/m (3.3)."""
    dropper_lengths: tuple[float, ...] | None = None
    """Unstressed lengths l_0, m; None: computed so that the contact wire hangs as `pre_sag` says."""
    mast_stiffness: float = 5e5
    """k_m that holds the carrier at a mast, N/m (3.2)."""
    steady_arm_stiffness: float = 0.0
    """Vertical stiffness of a steady arm on the contact wire at a mast, N/m; unloaded at rest."""
    encumbrance: float = 1.05
    """Height of the carrier above the nominal contact wire at a mast, m."""
    pre_sag: float = 0.0
    """Sag of the clamps in mid-span below the masts' height (a parabola), m."""
    gravity: float = 9.81
    """g, m/s^2."""

    def __post_init__(self) -> None:
        for name in ("span_length", "dropper_stiffness", "mast_stiffness", "encumbrance"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"line.{name} = {value} must be finite and above 0")
        for name in ("steady_arm_stiffness", "gravity"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ValueError(f"line.{name} = {value} must be finite and at least 0")
        if not math.isfinite(self.pre_sag):
            raise ValueError(f"line.pre_sag = {self.pre_sag} must be finite")
        edges = (0.0, *self.dropper_positions, self.span_length)
        if any(not b > a for a, b in itertools.pairwise(edges)):
            raise ValueError(
                f"line.dropper_positions = {list(self.dropper_positions)} must rise strictly between 0 and "
                f"line.span_length = {self.span_length}"
            )
        if self.dropper_lengths is not None:
            if len(self.dropper_lengths) != len(self.dropper_positions):
                raise ValueError(
                    f"line.dropper_lengths has {len(self.dropper_lengths)} values, line.dropper_positions has "
                    f"{len(self.dropper_positions)}"
                )
            if any(not (math.isfinite(length) and length > 0.0) for length in self.dropper_lengths):
                raise ValueError(f"line.dropper_lengths = {list(self.dropper_lengths)} must be finite and above 0")
