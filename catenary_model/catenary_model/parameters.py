"""Parameters of the catenary node; defaults are in config/catenary_model.yaml."""

from __future__ import annotations

from pydantic import model_validator

from catenary_model.boundary import BOUNDARIES
from catenary_model.line import Line
from catenary_model.line import Wire as LineWire
from catenary_model.model import Config
from phil_node.parameters import Group, parameter


class Wire(Group):
    """One wire (3.1)."""

    mass_per_length: float = parameter("Mass per length rhoA", unit="kg/m", low=0.05, high=20.0)
    damping: float = parameter("Damping per length beta", unit="N s/m^2", low=0.0, high=20.0)
    bending_stiffness: float = parameter("Bending stiffness EI", unit="N m^2", low=1.0, high=1e5)
    tension: float = parameter("Axial tension T", unit="N", low=1e3, high=2e5)

    def wire(self) -> LineWire:
        """Return the wire of the plain modules."""
        return LineWire(**self.model_dump())


class LineParameters(Group):
    """What hangs between the wires and where."""

    span_length: float = parameter("Distance of the masts", unit="m", low=5.0, high=120.0)
    dropper_positions: list[float] = parameter(
        "Positions of the droppers within a span, rising", unit="m", low=0.0, high=120.0
    )
    dropper_stiffness: float = parameter("Stiffness k_d of a taut dropper", unit="N/m", low=1e3, high=1e7)
    dropper_lengths: list[float] = parameter(
        "Unstressed lengths l_0, one a dropper; [0.0]: computed from pre_sag", unit="m", low=0.0, high=10.0
    )
    mast_stiffness: float = parameter("Stiffness k_m that holds the carrier at a mast", unit="N/m", low=1e3, high=1e8)
    steady_arm_stiffness: float = parameter(
        "Vertical stiffness of a steady arm on the contact wire at a mast", unit="N/m", low=0.0, high=1e7
    )
    encumbrance: float = parameter(
        "Height of the carrier above the nominal contact wire at a mast", unit="m", low=0.1, high=10.0
    )
    pre_sag: float = parameter("Sag of the clamps in mid-span, 0 is level", unit="m", low=-0.5, high=0.5)
    gravity: float = parameter("Acceleration of gravity g", unit="m/s^2", low=0.0, high=20.0)


class Parameters(Group):
    """All parameters of the node."""

    cycle_time: float = parameter("Cycle time Ts", unit="s", low=1e-4, high=0.02)
    speed_kmh: float = parameter("Speed of the train", unit="km/h", low=0.0, high=400.0)
    start_position: float = parameter("Track position of the pantograph at cycle 0", unit="m", low=-1e6, high=1e6)
    carrier_wire: Wire = parameter("Carrier wire")
    contact_wire: Wire = parameter("Contact wire")
    line: LineParameters = parameter("Droppers, masts, geometry")
    spans: int = parameter("Spans in the computational domain", low=2, high=40)
    element_length: float = parameter("Element length dx", unit="m", low=0.1, high=5.0)
    boundary: str = parameter("What ends the wires", choices=tuple(BOUNDARIES))
    fading_length: float = parameter(
        "Distance from either end over which droppers and masts fade", unit="m", low=0.0, high=1000.0
    )
    newmark_beta: float = parameter("Newmark's beta", low=0.1, high=1.0)
    newmark_gamma: float = parameter("Newmark's gamma", low=0.5, high=1.0)
    max_slack_iterations: int = parameter("Most solves a step for a consistent slack state", low=1, high=50)
    segment_half_length: float = parameter("Half length of the controller's segment", unit="m", low=1.0, high=200.0)
    wire_shape_rate: float = parameter("Rate of wire_shape", unit="Hz", low=0.1, high=500.0)
    resend_time: float = parameter(
        "Time without a command after which the last state is sent again", unit="s", low=0.02, high=10.0
    )
    max_bridged_cycles: int = parameter(
        "Most missing commands in a row that are bridged with the last force", low=0, high=10000
    )

    @model_validator(mode="after")
    def _together(self) -> Parameters:
        # Config and Line check what depends on several parameters and name them
        self.config()
        return self

    def config(self) -> Config:
        """Return the configuration of the model. Raises ValueError naming the parameters that do not fit together."""
        given = self.line.dropper_lengths
        line = Line(
            **self.line.model_dump(exclude={"dropper_positions", "dropper_lengths"}),
            carrier=self.carrier_wire.wire(),
            contact=self.contact_wire.wire(),
            dropper_positions=tuple(self.line.dropper_positions),
            dropper_lengths=None if given == [0.0] else tuple(given),
        )
        return Config(
            line=line,
            speed=self.speed_kmh / 3.6,
            start_position=self.start_position,
            cycle_time=self.cycle_time,
            spans=self.spans,
            element_length=self.element_length,
            boundary=self.boundary,
            fading_length=self.fading_length,
            newmark_beta=self.newmark_beta,
            newmark_gamma=self.newmark_gamma,
            max_slack_iterations=self.max_slack_iterations,
            segment_half_length=self.segment_half_length,
        )

    @property
    def wire_shape_every(self) -> int:
        """Cycles between two wire shapes."""
        return max(1, round(1.0 / (self.wire_shape_rate * self.cycle_time)))
