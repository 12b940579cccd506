"""Settings of the moving model, whatever it is discretised by."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field, fields

from catenary_model.boundary import Layer
from catenary_model.companions import Companion
from catenary_model.line import Line, refuse_stiffness_damping, refuse_stitched
from catenary_model.moving_frame import Mesh

DISCRETISATIONS = {
    "fe": "Hermite elements, Newmark's method",
    "fd": "finite differences, explicit",
}
"""Names of the discretisations and what they are."""
FE_ONLY = (
    "substeps",
    "boundary",
    "boundary_nodes",
    "newmark_beta",
    "newmark_gamma",
    "max_slack_iterations",
    "coupling_tolerance",
)
"""Settings that only the finite elements have."""
FD_ONLY = (
    "grid_spacing",
    "grid_substeps",
    "grid_reach",
    "grid_boundary",
    "grid_boundary_levels",
    "grid_boundary_nodes",
)
"""Settings that only the finite differences have."""
FORMER: dict[str, tuple[object, ...]] = {"grid_reach": (3,)}
"""Earlier defaults: parameter files that rides of then have written down hold them, whatever the discretisation."""
CLOSEST, FARTHEST = 5.0, 1000.0
"""Distance between two pantographs of a train, m."""
_LEAST = (
    ("spans", 1),
    ("max_slack_iterations", 1),
    ("substeps", 1),
    ("boundary_nodes", 0),
    ("grid_substeps", 1),
    ("grid_reach", 2),
    ("grid_boundary_levels", 1),
    ("grid_boundary_nodes", 3),
)


@dataclass(frozen=True)
class Config:
    """Line, speed and numerical settings of the moving model. Raises ValueError naming the field.

    What belongs to one discretisation only has to stay at its default with the other: `FE_ONLY`, `FD_ONLY`.
    """

    line: Line = field(default_factory=Line)
    speed: float = 250.0 / 3.6
    """v, m/s."""
    start_position: float = 0.0
    """zeta_0, track position of the pantograph at cycle 0, m."""
    cycle_time: float = 0.002
    """Ts, s."""
    discretisation: str = "fe"
    """`fe`: Hermite elements and Newmark's method; `fd`: explicit finite differences (see `DISCRETISATIONS`)."""
    substeps: int = 2
    """fe: integration steps a cycle."""
    spans: int = 2
    """Spans in the computational domain (of the line's mean length), without the layers."""
    element_length: float = 0.75
    """fe: dx, m. fd: the controller's segment has elements of the multiple of grid_spacing that is nearest to it."""
    layer_behind: float = 75.0
    """Length of the domain beyond the spans, behind, m; droppers and masts act there too and fade at its end."""
    layer_ahead: float = 165.0
    """Length of the domain beyond the spans, ahead, m: what comes back from there matters more."""
    fading_length: float = 15.0
    """Distance from either end over which droppers and masts fade in and out, m (Fig. 3.9)."""
    boundary: str = "matched_dashpot"
    """fe: kind of the ends, see `boundary.BOUNDARIES`."""
    boundary_nodes: int = 20
    """fe: nodes at either end that a controlled or viscous boundary uses."""
    newmark_beta: float = 0.16
    newmark_gamma: float = 0.53
    """fe: Newmark. Below beta = (gamma + 1/2)^2 / 4 the step is conditionally stable, but its waves run truer."""
    local_compliance: bool = True
    """Give the contact point, droppers and masts what the mesh lacks in compliance under a point load (`lattice`)."""
    one_sided_droppers: bool = True
    """Droppers slacken (3.3); if not they are springs both ways, and the model is linear (time-varying)."""
    max_slack_iterations: int = 8
    """fe: most small solves a step; the last slack state is kept if they do not suffice (counted)."""
    coupling_tolerance: float = 1e-3
    """fe: what one dropper, mast or contact does to another within one step is left out below this share of what it
    does to itself."""
    segment_half_length: float = 15.0
    """Half length of the reduced model, m."""
    grid_spacing: float = 0.25
    """fd: dx, m."""
    grid_substeps: int = 2
    """fd: steps a cycle."""
    grid_reach: int = 4
    """fd: R, half the nodes to either side that the interior scheme reads; its order is 2 R."""
    grid_boundary: str = "absorbing"
    """fd: kind of the ends, see `finite_difference.ends.ENDS`."""
    grid_boundary_levels: int = 3
    """fd: time levels N_t that an absorbing end reads."""
    grid_boundary_nodes: int = 12
    """fd: nodes N_x that an absorbing end reads."""
    companions: tuple[Companion, ...] = ()
    """Further pantographs of the train; the domain is longer by the farthest on either side."""

    def __post_init__(self) -> None:
        refuse_stitched(self.line, "the model in the moving frame")
        refuse_stiffness_damping(self.line, "the model in the moving frame")
        positive = ("cycle_time", "element_length", "segment_half_length", "newmark_beta", "newmark_gamma")
        for name in (*positive, "grid_spacing"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")
        for name in ("speed", "start_position", "fading_length", "layer_behind", "layer_ahead"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"{name} = {value} must be finite")
        if self.speed < 0.0:
            raise ValueError(f"speed = {self.speed} must be at least 0")
        if self.newmark_gamma < 0.5:
            raise ValueError(f"newmark_gamma = {self.newmark_gamma} is below 0.5: the integration would be unstable")
        for name, least in _LEAST:
            if getattr(self, name) < least:
                raise ValueError(f"{name} = {getattr(self, name)} must be at least {least}")
        self._check_discretisation()
        self._check_companions()
        if min(self.layer_behind, self.layer_ahead) < 0.0:
            raise ValueError(
                f"layer_behind = {self.layer_behind} and layer_ahead = {self.layer_ahead} must be at least 0"
            )
        mesh = self.mesh
        if not 0.0 <= self.fading_length <= mesh.half_length:
            raise ValueError(
                f"fading_length = {self.fading_length} m must lie between 0 and the distance to the nearer end, "
                f"{mesh.half_length} m"
            )
        if mesh.half_elements < 4:
            name = "grid_spacing" if self.discretisation == "fd" else "element_length"
            raise ValueError(f"{name} = {getattr(self, name)} m leaves fewer than 8 elements")

    def _check_discretisation(self) -> None:
        """Refuse an unknown discretisation, and settings that belong to another one."""
        if self.discretisation not in DISCRETISATIONS:
            raise ValueError(f"discretisation = '{self.discretisation}' must be one of {', '.join(DISCRETISATIONS)}")
        default = {entry.name: entry.default for entry in fields(self)}
        for owner, names in (("fe", FE_ONLY), ("fd", FD_ONLY)):
            for name in names:
                if owner != self.discretisation and getattr(self, name) not in (default[name], *FORMER.get(name, ())):
                    raise ValueError(
                        f"{name} = {getattr(self, name)} belongs to discretisation '{owner}' and says nothing to "
                        f"'{self.discretisation}': leave it at {default[name]}"
                    )
        if self.discretisation == "fd" and self.element_length < self.grid_spacing:
            raise ValueError(
                f"element_length = {self.element_length} m, the controller's, is below grid_spacing = "
                f"{self.grid_spacing} m"
            )

    def _check_companions(self) -> None:
        """Refuse pantographs that are too close to another one, or farther away than any train is long."""
        places = sorted([0.0, *(-one.distance for one in self.companions)])
        for i, one in enumerate(self.companions):
            if not abs(one.distance) <= FARTHEST:
                raise ValueError(f"companions[{i}].distance = {one.distance:g} m: allowed is at most {FARTHEST:g} m")
        closest = min((after - before for before, after in itertools.pairwise(places)), default=math.inf)
        if closest < CLOSEST:
            raise ValueError(
                f"companions: two pantographs are {closest:g} m apart: allowed is at least {CLOSEST:g} m between two"
            )

    @property
    def step_time(self) -> float:
        """Time of one integration step, s."""
        return self.cycle_time / self.steps_per_cycle

    @property
    def steps_per_cycle(self) -> int:
        """Integration steps a cycle."""
        return self.grid_substeps if self.discretisation == "fd" else self.substeps

    @property
    def spacing(self) -> float:
        """Distance of the nodes, m."""
        return self.grid_spacing if self.discretisation == "fd" else self.element_length

    @property
    def layer(self) -> Layer:
        """What a boundary kind is told."""
        return Layer(self.boundary_nodes, self.step_time, self.newmark_beta, self.newmark_gamma)

    @property
    def mesh(self) -> Mesh:
        """Mesh of the domain: the spans and the layers, rounded to whole elements, an even number of them."""
        half = 0.5 * self.spans * self.line.period / len(self.line.spans)
        places = [-one.distance for one in self.companions]
        back, front = max(0.0, -min(places, default=0.0)), max(0.0, max(places, default=0.0))
        behind = round((half + self.layer_behind + back) / self.spacing)
        further_ahead = 2 * round(0.5 * (self.layer_ahead + front - self.layer_behind - back) / self.spacing)
        return Mesh(self.spacing, behind, further_ahead)
