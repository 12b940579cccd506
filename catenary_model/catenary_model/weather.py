"""A line that was built on another day: temperature and ice.

A line is described as it was built: at its reference temperature, without ice. Its droppers are cut there. Whatever the
weather, the droppers keep these lengths; what changes are the tensions and the masses per length:

    fixed     T = T_0 - EA alpha (theta - theta_0)     both ends are held; what sag takes up is left out
    weights   T = eta T_0 if warmer, T_0/eta if colder  a wire that lengthens pulls the weights' wheels through friction

The rope of a stitch wire is clamped to the carrier and has no weights of its own: its tension goes with the carrier's.
Lengths of spans and droppers do not change (1.7e-5 of 1 m a kelvin), nor does EI. Ice is mass per length on the wires.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from catenary_model import statics
from catenary_model.line import Line, Span, Wire

TENSIONING = ("weights", "fixed")
"""What holds the wires' ends."""


@dataclass(frozen=True)
class Temperature:
    """Temperature of the wires and what they do about it."""

    value: float
    """theta, degC."""
    reference: float = 10.0
    """theta_0 at which the line has the tensions of its description, degC."""
    tensioning: str = "weights"
    """One of TENSIONING."""
    efficiency: float = 1.0
    """eta of the weights' wheels, 0 < eta <= 1."""
    expansion: float = 1.7e-5
    """alpha of the wires, 1/K."""

    def __post_init__(self) -> None:
        if self.tensioning not in TENSIONING:
            raise ValueError(f"tensioning = {self.tensioning!r}: allowed is one of {', '.join(TENSIONING)}")
        if not 0.0 < self.efficiency <= 1.0:
            raise ValueError(f"efficiency = {self.efficiency}: allowed is above 0, at most 1")

    def tension(self, wire: Wire, axial_stiffness: float | None, name: str) -> float:
        """Tension of a wire (N) with this EA (N). Raises ValueError, naming the wire, if nothing is left of it."""
        warmer = self.value - self.reference
        if self.tensioning == "weights":
            return wire.tension * (self.efficiency if warmer > 0.0 else 1.0 / self.efficiency if warmer < 0.0 else 1.0)
        if axial_stiffness is None:
            raise ValueError(f"{name}.axial_stiffness is missing; a wire whose ends are fixed needs it (EA, N)")
        left = wire.tension - axial_stiffness * self.expansion * warmer
        if left <= 0.0:
            hottest = self.reference + wire.tension / (axial_stiffness * self.expansion)
            raise ValueError(
                f"temperature.value = {self.value:g}: allowed is less than {hottest:.1f} degC, where {name} is slack"
            )
        return left


@dataclass(frozen=True)
class Ice:
    """Mass of ice on the wires."""

    carrier: float = 0.0
    """kg/m; stitch wires carry as much."""
    contact: float = 0.0
    """kg/m."""


def under(
    line: Line,
    temperature: Temperature | None,
    ice: Ice,
    axial_stiffness: tuple[float | None, float | None] = (None, None),
) -> Line:
    """Return the line, built as described, under this weather; EA of carrier and contact wire in N.

    Raises ValueError for what cannot be, StaticsError if the line as built cannot hang.
    """
    lengths = iter(statics.solve(line).dropper_lengths.tolist())
    wires = []
    for name, wire, axial, mass in zip(
        ("carrier", "contact"), (line.carrier, line.contact), axial_stiffness, (ice.carrier, ice.contact), strict=True
    ):
        tension = wire.tension if temperature is None else temperature.tension(wire, axial, name)
        wires.append(dataclasses.replace(wire, tension=tension, mass_per_length=wire.mass_per_length + mass))
    share = wires[0].tension / line.carrier.tension

    def hung(span: Span) -> Span:
        droppers = tuple(dataclasses.replace(d, length=next(lengths), sag=None) for d in span.droppers)
        stitch = span.stitch_wire
        if stitch is not None:
            heavier = stitch.mass_per_length + ice.carrier
            stitch = dataclasses.replace(stitch, tension=share * stitch.tension, mass_per_length=heavier)
        return dataclasses.replace(span, droppers=droppers, stitch_wire=stitch)

    return dataclasses.replace(line, carrier=wires[0], contact=wires[1], spans=tuple(map(hung, line.spans)))
