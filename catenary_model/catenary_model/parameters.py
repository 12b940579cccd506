"""Parameters of the catenary node; defaults are in config/catenary_model.yaml."""

from __future__ import annotations

import os
from dataclasses import fields

from pydantic import PrivateAttr, model_validator

from catenary_model.boundary import BOUNDARIES
from catenary_model.build import check, check_ends
from catenary_model.companions import Companion
from catenary_model.config import CLOSEST, DISCRETISATIONS, FARTHEST, Config
from catenary_model.finite_difference.ends import ENDS
from catenary_model.line import Line
from catenary_model.line_file import LineFileError, load_line, preset_names
from catenary_model.pantograph import Pantograph
from phil_base.lumped import LUMPED
from phil_base.parameters import Group, nearest, parameter
from phil_base.real_time import RealTime

MOST_UPLIFT = 1000.0
"""N."""


def line_of(name_or_path: str) -> Line:
    """Load a preset, or a file whose path may begin with `~`. Raises LineFileError."""
    return load_line(os.path.expanduser(name_or_path))  # noqa: PTH111 - an unknown user's home stays as it is


def companions_of(text: str) -> tuple[Companion, ...]:
    """Read pantographs as "three_mass:200:120, dsa380:-85:110": type, distance back in m, uplift force in N.

    Raises
    ------
    ValueError
        An entry has another form, an unknown type or a number out of range; the text names it and what is allowed.
    """
    found = []
    for i, entry in enumerate(text.split(",") if text.strip() else ()):
        where = f"entry {i + 1} '{entry.strip()}'"
        parts = [part.strip() for part in entry.split(":")]
        if len(parts) != 3:
            raise ValueError(f"{where}: allowed is TYPE:DISTANCE:UPLIFT, as in three_mass:200:120")
        kind, *numbers = parts
        if kind not in LUMPED:
            raise ValueError(
                f"{where}: type '{kind}' is unknown{nearest(kind, LUMPED)}; allowed is {', '.join(LUMPED)}"
            )
        try:
            distance, uplift = map(float, numbers)
        except ValueError:
            raise ValueError(f"{where}: distance (m) and uplift (N) must be numbers") from None
        if not CLOSEST <= abs(distance) <= FARTHEST:
            raise ValueError(f"{where}: distance {distance:g} m: allowed is {CLOSEST:g} to {FARTHEST:g} m, or negative")
        if not 0.0 <= uplift <= MOST_UPLIFT:
            raise ValueError(f"{where}: uplift {uplift:g} N: allowed is 0 to {MOST_UPLIFT:g} N")
        chain = LUMPED[kind]
        found.append(Companion(Pantograph.of(chain.masses, chain.damping, chain.stiffness, uplift), distance))
    return tuple(found)


class Parameters(Group):
    """All parameters of the node; the line's description is read once, when they are checked."""

    mode: str = parameter(
        "Clock of the ride, as in test_rig_sim: what is sent before cycle 0 is stamped with 0 (lockstep) or with the "
        "wall clock (realtime)",
        choices=("lockstep", "realtime"),
    )
    cycle_time: float = parameter("Cycle time Ts", unit="s", low=1e-4, high=0.02)
    discretisation: str = parameter(
        "What the wires are discretised by: " + "; ".join(f"{name}: {what}" for name, what in DISCRETISATIONS.items()),
        choices=tuple(DISCRETISATIONS),
    )
    substeps: int = parameter("fe: integration steps a cycle", low=1, high=20)
    speed_kmh: float = parameter("Speed of the train", unit="km/h", low=0.0, high=400.0)
    start_position: float = parameter("Track position of the pantograph at cycle 0", unit="m", low=-1e6, high=1e6)
    line: str = parameter(
        f"Overhead line: a preset ({', '.join(preset_names())}) or the path of a YAML file that describes one; "
        "a relative path counts from the current directory"
    )
    spans: int = parameter(
        "Spans in the computational domain (of the line's mean length), without the layers", low=1, high=40
    )
    element_length: float = parameter(
        "fe: element length dx; fd: that of the controller's segment, nearest multiple of grid_spacing",
        unit="m",
        low=0.1,
        high=5.0,
    )
    layer_behind: float = parameter("Length of the domain beyond the spans, behind", unit="m", low=0.0, high=1000.0)
    layer_ahead: float = parameter("Length of the domain beyond the spans, ahead", unit="m", low=0.0, high=1000.0)
    fading_length: float = parameter(
        "Distance from either end over which droppers and masts fade", unit="m", low=0.0, high=1000.0
    )
    boundary: str = parameter(
        "fe: what ends the wires; clamped and viscous_sponge reflect: for comparison only, with a long fading_length",
        choices=tuple(BOUNDARIES),
    )
    boundary_nodes: int = parameter(
        "fe: nodes at either end that a controlled or viscous boundary uses", low=0, high=200
    )
    newmark_beta: float = parameter("fe: Newmark's beta of the integration", low=0.05, high=1.0)
    newmark_gamma: float = parameter("fe: Newmark's gamma of the integration", low=0.5, high=1.0)
    local_compliance: bool = parameter(
        "Give contact point, droppers and masts what the mesh lacks in compliance under a point load"
    )
    one_sided_droppers: bool = parameter("Droppers slacken; if not they pull and push, and the model is linear")
    max_slack_iterations: int = parameter("fe: most solves a step for a consistent slack state", low=1, high=50)
    coupling_tolerance: float = parameter(
        "fe: share of its own compliance below which what a site does to another within one step is left out",
        low=1e-14,
        high=0.1,
    )
    segment_half_length: float = parameter("Half length of the controller's segment", unit="m", low=1.0, high=200.0)
    grid_spacing: float = parameter("fd: distance of the nodes dx", unit="m", low=0.05, high=2.0)
    grid_substeps: int = parameter("fd: steps a cycle", low=1, high=50)
    grid_reach: int = parameter("fd: half the nodes to either side that the interior scheme reads", low=2, high=5)
    grid_boundary: str = parameter(
        "fd: what ends the wires; clamped reflects: for comparison only, with a long fading_length",
        choices=tuple(ENDS),
    )
    grid_boundary_levels: int = parameter("fd: time levels that an absorbing end reads", low=1, high=6)
    pantographs: str = parameter(
        "Further pantographs of the train, which ride along on the wire: TYPE:DISTANCE:UPLIFT, by commas; distance in "
        "m from the one on the rig back to it (negative: it runs ahead), uplift force in N; types: "
        f"{', '.join(LUMPED)}; empty: none"
    )
    grid_boundary_nodes: int = parameter("fd: nodes that an absorbing end reads", low=3, high=30)
    wire_shape_rate: float = parameter("Rate of wire_shape", unit="Hz", low=0.1, high=500.0)
    resend_time: float = parameter(
        "Time without a command after which the last state is sent again", unit="s", low=0.02, high=10.0
    )
    max_bridged_cycles: int = parameter(
        "Most missing commands in a row that are bridged with the last force", low=0, high=10000
    )
    real_time: RealTime = parameter("What the process asks of the system")
    _line: Line = PrivateAttr()
    _companions: tuple[Companion, ...] = PrivateAttr()

    @model_validator(mode="after")
    def _together(self) -> Parameters:
        """Read the line and try what depends on several parameters; what it raises names them."""
        try:
            self._line = line_of(self.line)
        except LineFileError as error:
            raise ValueError("\n".join(f"parameter 'line': {text}" for text in str(error).splitlines())) from None
        try:
            self._companions = companions_of(self.pantographs)
        except ValueError as error:
            raise ValueError(f"parameter 'pantographs': {error}") from None
        check(self.config())
        return self

    def config(self) -> Config:
        """Return the configuration of the model. Raises ValueError naming the parameters that do not fit together."""
        same = {field.name for field in fields(Config)} & set(type(self).model_fields) - {"line"}
        given = self.model_dump(include=same)
        return Config(line=self._line, speed=self.speed_kmh / 3.6, companions=self._companions, **given)

    def check_build(self) -> None:
        """Design the ends of the wires. Raises ValueError."""
        check_ends(self.config())

    @property
    def wire_shape_every(self) -> int:
        """Cycles between two wire shapes."""
        return max(1, round(1.0 / (self.wire_shape_rate * self.cycle_time)))
