"""What an overhead line is made of, in the frame of the track."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass, field
from typing import Any


def _source() -> Any:
    """Declare where an element's values come from: a text that makes no two elements differ."""
    return field(default="", compare=False, repr=False, kw_only=True)


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
    stiffness_damping: float = 0.0
    """b of Rayleigh's damping D = beta/rhoA M + b K, s; what is proportional to mass is part of `damping`."""
    source: str = _source()

    def __post_init__(self) -> None:
        for name in ("mass_per_length", "bending_stiffness", "tension"):
            _check(name, getattr(self, name), above=0.0)
        for name in ("damping", "stiffness_damping"):
            _check(name, getattr(self, name), least=0.0)

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


HANGS_FROM = ("carrier", "stitch_wire")
"""What a dropper hangs from."""


@dataclass(frozen=True)
class Dropper:
    """One-sided spring between the wires (3.3). Raises ValueError naming the field."""

    position: float
    """From the mast at the beginning of the span, m."""
    stiffness: float = 1e5
    """k_d of a taut dropper, N/m; `axial_stiffness` counts in its place if that is given."""
    mass: float = 0.0
    """Mass of dropper and clamps, kg; half of it moves with either wire."""
    length: float | None = None
    """Unstressed length l_0, m; None: computed so that its clamp hangs where `sag` or `Span.pre_sag` wants it."""
    sag: float | None = None
    """How far its clamp hangs below the nominal height at rest, m; None: what `Span.pre_sag` demands."""
    carrier_clamp: float = 0.0
    """Mass of the upper clamp, kg, beside `mass`: all of it moves with the wire that the dropper hangs from."""
    contact_clamp: float = 0.0
    """Mass of the lower clamp, kg, beside `mass`: all of it moves with the contact wire."""
    mass_per_length: float = 0.0
    """Of the dropper's rope, kg/m, beside `mass`; half of the rope moves with either wire."""
    axial_stiffness: float | None = None
    """EA of the dropper's rope, N: k_d = EA/l_0."""
    hangs_from: str = "carrier"
    """`stitch_wire`: that of the nearer mast."""
    source: str = _source()

    def __post_init__(self) -> None:
        _check("position", self.position, above=0.0)
        _check("stiffness", self.stiffness, above=0.0)
        for name in ("mass", "carrier_clamp", "contact_clamp", "mass_per_length"):
            _check(name, getattr(self, name), least=0.0)
        if self.hangs_from not in HANGS_FROM:
            raise ValueError(f"hangs_from = {self.hangs_from!r}: allowed is one of {', '.join(HANGS_FROM)}")
        for name in ("length", "axial_stiffness"):
            if getattr(self, name) is not None:
                _check(name, getattr(self, name), above=0.0)
        if self.axial_stiffness is not None and self.stiffness != type(self).stiffness:
            raise ValueError(
                f"stiffness = {self.stiffness} and axial_stiffness = {self.axial_stiffness}: one follows from the "
                "other, give one"
            )
        if self.sag is not None:
            _check("sag", self.sag)
            if self.length is not None:
                raise ValueError(f"sag = {self.sag} and length = {self.length}: one follows from the other, give one")

    @property
    def needs_length(self) -> bool:
        """Whether stiffness or masses follow from the unstressed length."""
        return self.axial_stiffness is not None or self.mass_per_length > 0.0

    def cut(self, length: float) -> Dropper:
        """Dropper whose rope of this unstressed length (m) is put into `stiffness` and the masses of its clamps."""
        if not self.needs_length:
            return self
        half = 0.5 * self.mass_per_length * length
        return dataclasses.replace(
            self,
            stiffness=self.stiffness if self.axial_stiffness is None else self.axial_stiffness / length,
            carrier_clamp=self.carrier_clamp + half,
            contact_clamp=self.contact_clamp + half,
            mass_per_length=0.0,
            axial_stiffness=None,
        )

    @property
    def carrier_mass(self) -> float:
        """Mass that moves with the wire that the dropper hangs from, without rope given per length, kg."""
        return 0.5 * self.mass + self.carrier_clamp

    @property
    def contact_mass(self) -> float:
        """Mass that moves with the contact wire, without rope given per length, kg."""
        return 0.5 * self.mass + self.contact_clamp


@dataclass(frozen=True)
class Mast:
    """What carries the carrier (3.2). Raises ValueError naming the field."""

    stiffness: float = 5e5
    """k_m, vertical, N/m."""
    encumbrance: float = 1.05
    """Height of the carrier above the nominal contact wire when the line is at rest, m."""
    source: str = _source()

    def __post_init__(self) -> None:
        _check("stiffness", self.stiffness, above=0.0)
        _check("encumbrance", self.encumbrance, above=0.0)


@dataclass(frozen=True)
class StitchWire:
    """Wire over a mast, clamped to the carrier on either side, from which droppers hang. Raises ValueError."""

    length: float
    """Distance of its clamps, half of it on either side of the mast, m."""
    tension: float
    """S, N; between its clamps the carrier keeps the rest of its tension, T - S."""
    mass_per_length: float
    """kg/m."""
    bending_stiffness: float = 5.0
    """EI, N m^2."""
    clamp: float = 0.0
    """Mass of each of its two clamps on the carrier, kg."""
    source: str = _source()

    def __post_init__(self) -> None:
        for name in ("length", "tension", "mass_per_length", "bending_stiffness"):
            _check(name, getattr(self, name), above=0.0)
        _check("clamp", self.clamp, least=0.0)

    @property
    def wire(self) -> Wire:
        """The rope as a wire without damping."""
        return Wire(self.mass_per_length, 0.0, self.bending_stiffness, self.tension)


@dataclass(frozen=True)
class SteadyArm:
    """Arm that holds the contact wire sideways at a mast; unloaded at rest. Raises ValueError naming the field."""

    stiffness: float = 0.0
    """Vertical stiffness that the wire feels, N/m."""
    mass: float = 0.0
    """Mass that moves with the wire, kg."""
    source: str = _source()

    def __post_init__(self) -> None:
        _check("stiffness", self.stiffness, least=0.0)
        _check("mass", self.mass, least=0.0)


WIRES = ("carrier", "contact")
"""What a point mass may sit on."""


@dataclass(frozen=True)
class PointMass:
    """Something that sits on a wire: a clamp, an insulator, a marker. Raises ValueError naming the field."""

    position: float
    """From the mast at the beginning of the span, m."""
    wire: str
    """`carrier` or `contact`."""
    mass: float
    """kg."""
    source: str = _source()

    def __post_init__(self) -> None:
        _check("position", self.position, above=0.0)
        _check("mass", self.mass, above=0.0)
        if self.wire not in WIRES:
            raise ValueError(f"wire = {self.wire!r}: allowed is one of {', '.join(WIRES)}")


PRE_SAG_FROM = ("mast", "first_dropper")
"""Where the parabola of `Span.pre_sag` begins, and, mirrored, where it ends."""


@dataclass(frozen=True)
class Span:
    """From one mast to the next; its mast and its steady arm stand at its beginning. Raises ValueError."""

    length: float
    """L, m."""
    droppers: tuple[Dropper, ...]
    """By rising position, strictly inside the span."""
    pre_sag: float = 0.0
    """Sag of the clamps at the deepest point below the nominal height, m: a parabola, see `pre_sag_from`."""
    mast: Mast = Mast()
    steady_arm: SteadyArm | None = None
    pre_sag_from: str = "mast"
    """`mast`: the parabola reaches from mast to mast; `first_dropper`: from the first dropper to the last one."""
    stitch_wire: StitchWire | None = None
    """Over the mast at the span's beginning."""
    masses: tuple[PointMass, ...] = ()
    """In any order, strictly inside the span."""
    source: str = _source()

    def __post_init__(self) -> None:
        _check("length", self.length, above=0.0)
        _check("pre_sag", self.pre_sag)
        if self.pre_sag_from not in PRE_SAG_FROM:
            raise ValueError(f"pre_sag_from = {self.pre_sag_from!r}: allowed is one of {', '.join(PRE_SAG_FROM)}")
        edges = (0.0, *(dropper.position for dropper in self.droppers), self.length)
        for i, (before, after) in enumerate(itertools.pairwise(edges)):
            if not after > before:
                where = f"droppers[{min(i, len(self.droppers) - 1)}].position"
                raise ValueError(f"{where}: droppers must rise strictly between 0 and length = {self.length} m")
        for j, mass in enumerate(self.masses):
            if mass.position >= self.length:
                raise ValueError(
                    f"masses[{j}].position = {mass.position:g}: allowed is less than length = {self.length:g} m"
                )
            if mass.wire == "contact" and not self.droppers:
                raise ValueError(f"masses[{j}].wire = contact: allowed in a span with droppers only")
        for j, dropper in enumerate(self.droppers):
            if dropper.sag is not None and abs(dropper.sag) >= self.mast.encumbrance:
                raise ValueError(
                    f"droppers[{j}].sag = {dropper.sag:g}: allowed is less than the mast's encumbrance, "
                    f"{self.mast.encumbrance:g} m, up or down"
                )

    def clamp_height(self, dropper: Dropper) -> float:
        """Height (m) at which the lower clamp of one of the span's droppers is wanted at rest."""
        if dropper.sag is not None:
            return -dropper.sag
        first, length = 0.0, self.length
        if self.pre_sag_from == "first_dropper":
            first = self.droppers[0].position
            length = self.droppers[-1].position - first
            if length == 0.0:
                return -self.pre_sag
        s = (dropper.position - first) / length
        return -4.0 * self.pre_sag * s * (1.0 - s)


class LineError(ValueError):
    """A line contradicts itself; `span` and `dropper` say where."""

    def __init__(self, problem: str, span: int, dropper: int | None = None) -> None:
        """Name the entry in front of the problem."""
        super().__init__(f"spans[{span}]{'' if dropper is None else f'.droppers[{dropper}]'}.{problem}")
        self.problem, self.span, self.dropper = problem, span, dropper


def refuse_stiffness_damping(line: Line, model: str) -> None:
    """Raise ValueError if a wire has damping in proportion to its stiffness, for a model that has none."""
    for name, wire in (("carrier", line.carrier), ("contact", line.contact)):
        if wire.stiffness_damping > 0.0:
            raise ValueError(
                f"line '{line.name}', {name}.stiffness_damping = {wire.stiffness_damping:g}: {model} allows 0 s only, "
                "the catenary-fixed reference has it"
            )


def refuse_stitched(line: Line, model: str) -> None:
    """Raise ValueError if a line has stitch wires, for a model that has none."""
    for i, span in enumerate(line.spans):
        if span.stitch_wire is not None:
            raise ValueError(
                f"line '{line.name}', spans[{i}].stitch_wire: {model} has no stitch wires yet, only the statics have "
                "(lengths, forces, sag, elasticity)"
            )


@dataclass(frozen=True)
class Line:
    """Sequence of spans that repeats itself without end; span 0 begins at track position 0. Raises ValueError."""

    carrier: Wire = CARRIER_3_1
    contact: Wire = CONTACT_3_1
    spans: tuple[Span, ...] = (Span(60.0, tuple(Dropper(position) for position in DROPPERS_3_1)),)
    gravity: float = 9.81
    """g, m/s^2."""
    name: str = "en50318_2002"
    source: str = _source()
    """Documents that the values come from, what was assumed."""

    def __post_init__(self) -> None:
        _check("gravity", self.gravity, least=0.0)
        if not self.spans:
            raise ValueError("spans: a line needs at least one")
        if self.stitched:
            self._refuse_misplaced_stitch_wires()

    @property
    def stitched(self) -> bool:
        """Whether there is a stitch wire, or a dropper that asks for one."""
        return any(
            span.stitch_wire or any(dropper.hangs_from != "carrier" for dropper in span.droppers)
            for span in set(self.spans)
        )

    def _refuse_misplaced_stitch_wires(self) -> None:
        for i, span in enumerate(self.spans):
            here, ahead = span.stitch_wire, self.spans[(i + 1) % len(self.spans)].stitch_wire
            if here and here.tension >= self.carrier.tension:
                raise LineError(
                    f"stitch_wire.tension = {here.tension:g}: allowed is less than the carrier's, "
                    f"{self.carrier.tension:g} N",
                    i,
                )
            halves = [0.0 if wire is None else 0.5 * wire.length for wire in (here, ahead)]
            if sum(halves) >= span.length:
                raise LineError(
                    f"stitch_wire.length: {halves[0]:g} m and {halves[1]:g} m of the stitch wires at both ends of the "
                    f"span meet: allowed is less than its length, {span.length:g} m, in sum",
                    i,
                )
            for j, dropper in enumerate(span.droppers):
                back = span.length - dropper.position
                if dropper.hangs_from != "carrier" and not (dropper.position < halves[0] or back < halves[1]):
                    raise LineError(
                        f"position = {dropper.position:g}: allowed for hangs_from = stitch_wire is less than "
                        f"{halves[0]:g} m from the mast before it or {halves[1]:g} m from the mast after it",
                        i,
                        j,
                    )

    def stitch_of(self, span: int, dropper: int) -> int | None:
        """Return the number of the span whose stitch wire a dropper hangs from; None: it hangs from the carrier."""
        own = self.spans[span]
        if own.droppers[dropper].hangs_from == "carrier":
            return None
        here = own.stitch_wire
        after = here is None or own.droppers[dropper].position >= 0.5 * here.length
        return (span + after) % len(self.spans)

    @property
    def period(self) -> float:
        """Length after which the line repeats itself, m."""
        return math.fsum(span.length for span in self.spans)

    @property
    def span_starts(self) -> tuple[float, ...]:
        """Track position of every span's mast within the period, m."""
        return tuple(itertools.accumulate((span.length for span in self.spans[:-1]), initial=0.0))
