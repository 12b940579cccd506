"""The catenary as the rest of the project sees it: built from a `Config`, stepped by a contact force.

Deviation from the static equilibrium. The moving wire is written as W(zeta_0 + v t + x) + q(x, t). W, the line at rest
under its own weight, solves (3.6) with the static dropper and mast forces exactly and for all times, whatever moves;
it is known in closed form (`statics`, and as the mesh sees it `lattice`). Only the deviation q is integrated: a
dropper acts on it with fade (F - F_s), a mast with -fade k_m q, gravity and tension not at all. So fading a dropper in
or out never takes the weight off it, the ends need no reaction to the tension, and without a contact force the wire
stays at rest to rounding, at any speed, for hours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from catenary_model import arena, lattice, layout, reduced, sites, statics, step, wire_view, wires
from catenary_model.boundary import Feedback, Layer, impose
from catenary_model.line import Line
from catenary_model.moving_frame import Mesh, MovingFrame, assemble, highest_frequency, local_mass

Array = NDArray[np.float64]

_SAMPLES = 32
"""Places within an element at which the missing compliance is tabulated."""


def site_table(at_rest: statics.Statics) -> Array:
    """Rows of `layout.Constants.site` for one period: droppers, masts and arms, and a dropper's mass on either wire."""
    rows = []
    for i in range(at_rest.sites.position.size):
        x, kind = at_rest.sites.position[i], at_rest.sites.kind[i]
        k, m = at_rest.sites.stiffness[i], at_rest.sites.mass[i]
        if kind == statics.DROPPER:
            rows.append((x, 1.0, -1.0, k, 0.0, at_rest.sites.force[i], at_rest.sites.elongation[i], 1.0))
            if m > 0.0:
                rows.append((x, 1.0, 0.0, 0.0, 0.5 * m, 0.0, 0.0, 0.0))
                rows.append((x, 0.0, 1.0, 0.0, 0.5 * m, 0.0, 0.0, 0.0))
        elif k > 0.0 or m > 0.0:
            on_carrier = 1.0 if kind == statics.MAST else 0.0
            rows.append((x, on_carrier, 1.0 - on_carrier, k, m, 0.0, 0.0, 0.0))
    return np.array(rows, dtype=np.float64).reshape(len(rows), 8)


def gains(feedback: Feedback | None) -> Array:
    """Gains for the kernel, transposed and zero-padded to one size, (wire, end, states, inputs)."""
    if feedback is None:
        return np.zeros((2, 2, 0, 0))
    every = [[feedback.gain[wire][end] for end in range(2)] for wire in range(2)]
    inputs = max(gain.shape[0] for pair in every for gain in pair)
    per = max(gain.shape[1] for pair in every for gain in pair) // 3
    out = np.zeros((2, 2, 3, per, inputs))
    for wire in range(2):
        for end in range(2):
            gain = every[wire][end]
            own = gain.shape[1] // 3
            for d in range(3):
                out[wire, end, d, :own, : gain.shape[0]] = gain[:, d * own : (d + 1) * own].T
    return np.ascontiguousarray(out.reshape(2, 2, 3 * per, inputs))


def check_stability(config: Config) -> None:
    """Refuse a step too long for the mesh. Raises ValueError that names what to change.

    Newmark with gamma >= 1/2 is stable for a frequency omega if omega Ts < (gamma/2 - beta)^-1/2, always if
    beta >= gamma/2.
    """
    room = 0.5 * config.newmark_gamma - config.newmark_beta
    if room <= 0.0:
        return
    line, h = config.line, config.element_length
    both = (line.carrier, line.contact)
    highest = max(highest_frequency(wire, h, config.speed) for wire in both)
    # a spring k on a wire raises no frequency beyond omega^2 + k psi M^-1 psi
    light = [1.0 / local_mass(wire, h) for wire in both]
    lacking = [lattice.missing_compliance(wire, h, 8).min() if config.local_compliance else 0.0 for wire in both]
    steepest = 0.0
    for span in line.spans:
        arm = span.steady_arm.stiffness if span.steady_arm else 0.0
        steepest = max(steepest, light[0] / (1.0 / span.mast.stiffness + lacking[0]))
        steepest = max(steepest, light[1] / (1.0 / arm + lacking[1]) if arm else 0.0)
        for dropper in span.droppers:
            steepest = max(steepest, sum(light) / (1.0 / dropper.stiffness + sum(lacking)))
    highest = math.hypot(highest, math.sqrt(steepest))
    most = 1.0 / (highest * math.sqrt(room))
    if config.step_time > most:
        raise ValueError(
            f"cycle_time / substeps = {config.step_time * 1e3:.3g} ms is too long for element_length = "
            f"{config.element_length} m with newmark_beta = {config.newmark_beta}: at most {most * 1e3:.3g} ms is "
            f"stable; choose more substeps, longer elements, or newmark_beta >= {0.5 * config.newmark_gamma:.4g}"
        )


@dataclass(frozen=True)
class Config:
    """Line, speed and numerical settings of the moving model. Raises ValueError naming the field."""

    line: Line = field(default_factory=Line)
    speed: float = 250.0 / 3.6
    """v, m/s."""
    start_position: float = 0.0
    """zeta_0, track position of the pantograph at cycle 0, m."""
    cycle_time: float = 0.002
    """Ts, s."""
    substeps: int = 2
    """Integration steps a cycle."""
    spans: int = 2
    """Spans in the computational domain (of the line's mean length), without the layers."""
    element_length: float = 0.75
    """dx, m."""
    layer_behind: float = 75.0
    """Length of the domain beyond the spans, behind, m; droppers and masts act there too and fade at its end."""
    layer_ahead: float = 165.0
    """Length of the domain beyond the spans, ahead, m: what comes back from there matters more."""
    fading_length: float = 15.0
    """Distance from either end over which droppers and masts fade in and out, m (Fig. 3.9)."""
    boundary: str = "matched_dashpot"
    """Kind of the ends, see `boundary.BOUNDARIES`."""
    boundary_nodes: int = 20
    """Nodes at either end that a controlled or viscous boundary uses."""
    newmark_beta: float = 0.16
    newmark_gamma: float = 0.53
    """Newmark. Below beta = (gamma + 1/2)^2 / 4 the step is conditionally stable, but its waves run truer."""
    local_compliance: bool = True
    """Give the contact point, droppers and masts what the mesh lacks in compliance under a point load (`lattice`)."""
    max_slack_iterations: int = 8
    """Most small solves a step; the last slack state is kept if they do not suffice (counted)."""
    coupling_tolerance: float = 1e-3
    """What one dropper, mast or contact does to another within one step is left out below this share of what it does
    to itself."""
    segment_half_length: float = 15.0
    """Half length of the reduced model, m."""

    def __post_init__(self) -> None:
        for name in ("cycle_time", "element_length", "segment_half_length", "newmark_beta", "newmark_gamma"):
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
        for name, least in (("spans", 1), ("max_slack_iterations", 1), ("substeps", 1), ("boundary_nodes", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} = {getattr(self, name)} must be at least {least}")
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
            raise ValueError(f"element_length = {self.element_length} m leaves fewer than 8 elements")

    @property
    def step_time(self) -> float:
        """Time of one integration step, s."""
        return self.cycle_time / self.substeps

    @property
    def layer(self) -> Layer:
        """What a boundary kind is told."""
        return Layer(self.boundary_nodes, self.step_time, self.newmark_beta, self.newmark_gamma)

    @property
    def mesh(self) -> Mesh:
        """Mesh of the domain: the spans and the layers, rounded to whole elements, an even number of them."""
        half = 0.5 * self.spans * self.line.period / len(self.line.spans)
        behind = round((half + self.layer_behind) / self.element_length)
        further_ahead = 2 * round(0.5 * (self.layer_ahead - self.layer_behind) / self.element_length)
        return Mesh(self.element_length, behind, further_ahead)


class Catenary:
    """Moving catenary with all its state; a step allocates nothing.

    >>> catenary = Catenary(Config(spans=2))
    >>> for _ in range(500):
    ...     catenary.step(120.0)
    >>> 0.01 < catenary.w_cat < 0.1
    True
    """

    def __init__(self, config: Config) -> None:
        """Build everything and go to rest at the start position. Raises ValueError for what cannot be built."""
        self.config = config
        line = config.line
        check_stability(config)
        self.mesh = config.mesh
        self.statics = statics.solve(line)
        self.frame: MovingFrame = assemble(self.mesh, line.carrier, line.contact, config.speed)
        self.feedback = impose(config.boundary, self.frame, config.layer)
        self.reduced = reduced.reduce(self.mesh, line.contact, config.speed, config.segment_half_length)
        self.constants = self._constants()
        *self._packed, self.constants, self.state = arena.pack(self.constants, self._state())
        self._view = wire_view.WireView.of(self.mesh, self.statics)
        self.reset()

    def _constants(self) -> layout.Constants:
        config, line, frame = self.config, self.config.line, self.frame
        ts, beta, gamma = config.step_time, config.newmark_beta, config.newmark_gamma
        factors = wires.factor(frame, ts, beta, gamma)
        near, first, last = wires.green(factors, config.coupling_tolerance)
        real = np.zeros(11)
        real[layout.TS], real[layout.BETA], real[layout.GAMMA] = ts, beta, gamma
        real[layout.SPEED], real[layout.START] = config.speed, config.start_position
        real[layout.BEHIND], real[layout.AHEAD], real[layout.H] = self.mesh.behind, self.mesh.ahead, self.mesh.h
        real[layout.FADING], real[layout.PERIOD] = config.fading_length, line.period
        local = np.zeros((2, _SAMPLES + 1))
        if config.local_compliance:
            real[layout.COMPLIANCE] = lattice.local_compliance(line.contact.seen_from(config.speed), self.mesh.h)
            for row, wire in zip(local, (line.carrier, line.contact), strict=True):
                row[:] = lattice.missing_compliance(wire, self.mesh.h, _SAMPLES)
        segment_stations = self.reduced.x.size
        whole = np.zeros(8, dtype=np.int64)
        whole[layout.STATIONS], whole[layout.SUBSTEPS] = self.mesh.stations, config.substeps
        whole[layout.MAX_ITERATIONS] = config.max_slack_iterations
        whole[layout.SEGMENT_FIRST] = self.mesh.middle - segment_stations // 2
        whole[layout.SEGMENT_STATIONS] = segment_stations
        whole[layout.GREEN_FIRST], whole[layout.GREEN_LAST] = first, last
        whole[layout.REACH] = near.shape[4] // 2
        return layout.Constants(
            real=real,
            whole=whole,
            sweep=factors.sweep,
            middle=factors.middle,
            inner=factors.inner,
            outer=factors.outer,
            pivot=factors.pivot,
            green=near,
            site=site_table(self.statics),
            local=local,
            static=lattice.static_table(self.statics, self.mesh.h),
            segment=self.reduced.compact,
            gain=gains(self.feedback),
        )

    def _state(self) -> layout.State:
        stations = self.mesh.stations
        padded = stations + 2 * wires.PAD
        at, period = self.constants.site[:, layout.POSITION], self.config.line.period
        ring = max(1, sites.most_at_once(at, period, self.mesh.h * self.mesh.elements))
        near = sites.most_at_once(at, period, self.mesh.h * (self.constants.whole[layout.REACH] + 1))
        most, band = ring + 1, 2 * near + 1  # with the contact point
        return layout.State(
            q=np.zeros((3, 2, 2, padded)),
            taut=np.zeros(ring, dtype=np.int64),
            particle=np.zeros((ring, 4)),
            counter=np.zeros(11, dtype=np.int64),
            point=np.zeros(7),
            contact=np.zeros(6),
            segment=np.zeros((4, self.reduced.n)),
            external=np.zeros((2, 2, stations)),
            layer=np.zeros((2, 2, self.constants.gain.shape[3])),
            rhs=np.zeros((2, 2, stations)),
            here=np.zeros((12, most)),
            where=np.zeros((4, most), dtype=np.int64),
            psi=np.zeros((4, most)),
            compliance=np.zeros((most, band)),
            system=np.zeros((most, band)),
            scratch=np.zeros(6),
        )

    def reset(self) -> None:
        """Go back to rest at the start position, cycle 0; no external load."""
        pushed = self.state.counter[layout.PUSHED]  # whoever has the view may write into it again
        for array in self.state:
            array.fill(0)
        self.state.counter[layout.PUSHED] = pushed
        period, n = self.config.line.period, len(self.constants.site)
        behind = math.floor((self.config.start_position - self.mesh.behind) / period) - 1
        self.state.counter[layout.FIRST_SITE] = self.state.counter[layout.NEXT_SITE] = behind * n
        step.start(self.constants, self.state)

    def step(self, f_cat: float) -> None:
        """Advance one cycle with the contact force f_cat (N, up positive) as the force of the new instant."""
        step.cycle(*self._packed, f_cat)

    @property
    def cycle(self) -> int:
        """Cycle number k of the present state."""
        return int(self.state.counter[layout.STEPS]) // self.config.substeps

    @property
    def w_cat(self) -> float:
        """Displacement of the contact wire at the pantograph from its nominal height, m."""
        return float(self.state.point[layout.W_CAT])

    @property
    def v_cat(self) -> float:
        """Its rate of change in the frame of the train, m/s."""
        return float(self.state.point[layout.V_CAT])

    @property
    def a_cat(self) -> float:
        """Its second rate of change, m/s^2."""
        return float(self.state.point[layout.A_CAT])

    @property
    def f_cat(self) -> float:
        """Contact force that acted in the last step, N."""
        return float(self.state.point[layout.F_CAT])

    @property
    def work(self) -> float:
        """Work that the contact force did on the wire since cycle 0, J: trapezoids of an integration step each."""
        return float(self.state.point[layout.WORK])

    @property
    def impulse(self) -> float:
        """Integral of the contact force since cycle 0, N s."""
        return float(self.state.point[layout.IMPULSE])

    @property
    def local_compliance(self) -> float:
        """What the mesh lacks in compliance under the contact force, dC in m/N: part of `w_cat`."""
        return float(self.constants.real[layout.COMPLIANCE])

    @property
    def track_position(self) -> float:
        """Position of the pantograph along the line, m."""
        return float(self.state.point[layout.ZETA])

    @property
    def droppers(self) -> int:
        """Droppers within the domain."""
        return int(self.state.counter[layout.DROPPERS])

    @property
    def slack_droppers(self) -> int:
        """Of these, slack ones."""
        return int(self.state.counter[layout.SLACK])

    @property
    def iterations(self) -> int:
        """Solves of the last step."""
        return int(self.state.counter[layout.ITERATIONS])

    @property
    def unsettled_steps(self) -> int:
        """Steps since the start whose slack state was not consistent after the most solves allowed."""
        return int(self.state.counter[layout.UNSETTLED])

    @property
    def segment_displacement(self) -> Array:
        """Displacements q of the reduced model, m and rad, (n,); a view that the next step overwrites."""
        return self.state.segment[0]

    @property
    def segment_velocity(self) -> Array:
        """Velocities q' of the reduced model, m/s and rad/s, (n,); a view."""
        return self.state.segment[1]

    @property
    def segment_acceleration(self) -> Array:
        """Accelerations q'' of the reduced model, (n,); a view."""
        return self.state.segment[2]

    @property
    def segment_force(self) -> Array:
        """Held forces f_held of the reduced model, N and N m, (n,); a view."""
        return self.state.segment[3]

    @property
    def external_load(self) -> Array:
        """Nodal forces beside the contact force, N and N m, (stations, wire, (w, phi)): write into it; it stays."""
        self.state.counter[layout.PUSHED] = 1
        return self.state.external.transpose(2, 0, 1)

    @property
    def deviation(self) -> Array:
        """Deviation q, q', q'' from the static shape, (3, stations, wire, (w, phi)), a view."""
        return self.state.q[..., wires.PAD : -wires.PAD].transpose(0, 3, 1, 2)

    def wire_shape(self) -> wire_view.WireView:
        """Fill and return the shape of both wires for viewing; the arrays are reused."""
        self._view.fill(self.constants, self.state)
        return self._view
