"""What an overhead line is made of, in the frame of the track."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass


def _check(name: str, value: float, *, above: float | None = None, least: float | None = None) -> None:
    """Raise ValueError, naming the field, unless value is finite and above a limit (or at least at it)."""
    if not math.isfinite(value):
        raise ValueError(f"{name} = {value} must be finite")
    if above is not None and not value > above:
        raise ValueError(f"{name} = {value} must be above {above:g}")
    if least is not None and not value >= least:
        raise ValueError(f"{name} = {value} must be at least {least:g}")


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
            _check(name, getattr(self, name), above=0.0)
        _check("damping", self.damping, least=0.0)

    @property
    def wave_speed(self) -> float:
        """Speed c = sqrt(T / rhoA) of long transverse waves, m/s."""
        return math.sqrt(self.tension / self.mass_per_length)

    @property
    def bending_length(self) -> float:
        """Length sqrt(EI / T) over which a point load rounds the wire, m."""
        return math.sqrt(self.bending_stiffness / self.tension)

    def seen_from(self, speed: float) -> Wire:
        """Wire as a load that moves along it with `speed` (m/s) feels it: tension T - rhoA v^2 (3.6)."""
        return dataclasses.replace(self, tension=self.tension - self.mass_per_length * speed**2)

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
class Dropper:
    """One-sided spring between the wires (3.3). Raises ValueError naming the field."""

    position: float
    """From the mast at the beginning of the span, m."""
    stiffness: float = 1e5
    """k_d of a taut dropper, N/m."""
    mass: float = 0.0
    """Mass of dropper and clamps, kg; half of it moves with either wire."""
    length: float | None = None
    """Unstressed length l_0, m; None: computed so that its clamp hangs where `Span.pre_sag` wants it."""

    def __post_init__(self) -> None:
        _check("position", self.position, above=0.0)
        _check("stiffness", self.stiffness, above=0.0)
        _check("mass", self.mass, least=0.0)
        if self.length is not None:
            _check("length", self.length, above=0.0)


@dataclass(frozen=True)
class Mast:
    """What carries the carrier (3.2). Raises ValueError naming the field."""

    stiffness: float = 5e5
    """k_m, vertical, N/m."""
    encumbrance: float = 1.05
    """Height of the carrier above the nominal contact wire when the line is at rest, m."""

    def __post_init__(self) -> None:
        _check("stiffness", self.stiffness, above=0.0)
        _check("encumbrance", self.encumbrance, above=0.0)


@dataclass(frozen=True)
class SteadyArm:
    """Arm that holds the contact wire sideways at a mast; unloaded at rest. Raises ValueError naming the field."""

    stiffness: float = 0.0
    """Vertical stiffness that the wire feels, N/m."""
    mass: float = 0.0
    """Mass that moves with the wire, kg."""

    def __post_init__(self) -> None:
        _check("stiffness", self.stiffness, least=0.0)
        _check("mass", self.mass, least=0.0)


@dataclass(frozen=True)
class Span:
    """From one mast to the next; its mast and its steady arm stand at its beginning. Raises ValueError."""

    length: float
    """L, m."""
    droppers: tuple[Dropper, ...]
    """By rising position, strictly inside the span."""
    pre_sag: float = 0.0
    """Sag of the clamps in mid-span below the nominal height (a parabola from mast to mast), m."""
    mast: Mast = Mast()
    steady_arm: SteadyArm | None = None

    def __post_init__(self) -> None:
        _check("length", self.length, above=0.0)
        _check("pre_sag", self.pre_sag)
        edges = (0.0, *(dropper.position for dropper in self.droppers), self.length)
        for i, (before, after) in enumerate(itertools.pairwise(edges)):
            if not after > before:
                where = f"droppers[{min(i, len(self.droppers) - 1)}].position"
                raise ValueError(f"{where}: droppers must rise strictly between 0 and length = {self.length} m")


@dataclass(frozen=True)
class Line:
    """Sequence of spans that repeats itself without end; span 0 begins at track position 0. Raises ValueError."""

    carrier: Wire = CARRIER_3_1
    contact: Wire = CONTACT_3_1
    spans: tuple[Span, ...] = (Span(60.0, tuple(Dropper(position) for position in DROPPERS_3_1)),)
    gravity: float = 9.81
    """g, m/s^2."""
    name: str = "en50318_2002"

    def __post_init__(self) -> None:
        _check("gravity", self.gravity, least=0.0)
        if not self.spans:
            raise ValueError("spans: a line needs at least one")

    @property
    def period(self) -> float:
        """Length after which the line repeats itself, m."""
        return math.fsum(span.length for span in self.spans)

    @property
    def span_starts(self) -> tuple[float, ...]:
        """Track position of every span's mast within the period, m."""
        return tuple(itertools.accumulate((span.length for span in self.spans[:-1]), initial=0.0))
