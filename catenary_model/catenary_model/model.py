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

from catenary_model import lattice, reduced, statics, step, wire_view
from catenary_model.boundary import impose
from catenary_model.line import Line
from catenary_model.moving_frame import Mesh, MovingFrame, assemble

Array = NDArray[np.float64]


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
    spans: int = 4
    """Spans in the computational domain."""
    element_length: float = 1.0
    """dx, m."""
    boundary: str = "matched_dashpot"
    """Kind of the ends, see `boundary.BOUNDARIES`."""
    fading_length: float = 40.0
    """Distance from either end over which droppers and masts fade in and out, m (Fig. 3.9)."""
    newmark_beta: float = 0.28
    newmark_gamma: float = 0.55
    """Newmark. beta < gamma/2 (Table 3.1) is conditionally stable: drifts at high speed with many spans."""
    max_slack_iterations: int = 8
    """Most solves a step; the last slack state is kept if they do not suffice (counted)."""
    segment_half_length: float = 20.0
    """Half length of the reduced model, m."""

    def __post_init__(self) -> None:
        for name in ("cycle_time", "element_length", "segment_half_length", "newmark_beta", "newmark_gamma"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")
        for name in ("speed", "start_position", "fading_length"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"{name} = {value} must be finite")
        if self.speed < 0.0:
            raise ValueError(f"speed = {self.speed} must be at least 0")
        if self.newmark_gamma < 0.5:
            raise ValueError(f"newmark_gamma = {self.newmark_gamma} is below 0.5: the integration would be unstable")
        if self.spans < 1 or self.max_slack_iterations < 1:
            raise ValueError(f"spans = {self.spans} and max_slack_iterations = {self.max_slack_iterations} must be > 0")
        if not 0.0 <= self.fading_length <= self.half_length:
            raise ValueError(
                f"fading_length = {self.fading_length} m must lie between 0 and half the domain, {self.half_length} m"
            )
        if self.half_length < 4 * self.element_length:
            raise ValueError(f"element_length = {self.element_length} m leaves fewer than 8 elements")

    @property
    def half_length(self) -> float:
        """Half the length of the domain that is asked for, m; the mesh rounds it to whole elements."""
        return 0.5 * self.spans * self.line.span_length


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
        self.mesh = Mesh(config.element_length, round(config.half_length / config.element_length))
        self.statics = statics.solve(line)
        self.frame: MovingFrame = assemble(self.mesh, line.carrier, line.contact, config.speed)
        impose(config.boundary, self.frame)
        self.reduced = reduced.reduce(self.mesh, line.contact, config.speed, config.segment_half_length)
        self.constants = self._constants()
        self.state = self._state()
        self._view = wire_view.WireView.of(self.mesh, self.statics)
        self.reset()

    def _constants(self) -> step.Constants:
        config, line, frame = self.config, self.config.line, self.frame
        ts, beta, gamma = config.cycle_time, config.newmark_beta, config.newmark_gamma
        real = np.zeros(12)
        real[step.TS], real[step.BETA], real[step.GAMMA] = ts, beta, gamma
        real[step.SPEED], real[step.START] = config.speed, config.start_position
        real[step.HALF], real[step.H], real[step.FADING] = self.mesh.half_length, self.mesh.h, config.fading_length
        real[step.SPAN], real[step.K_DROPPER] = line.span_length, line.dropper_stiffness
        real[step.K_MAST], real[step.K_ARM] = line.mast_stiffness, line.steady_arm_stiffness
        segment_stations = self.reduced.x.size
        whole = np.zeros(4, dtype=np.int64)
        whole[step.STATIONS] = self.mesh.stations
        whole[step.MAX_ITERATIONS] = config.max_slack_iterations
        whole[step.SEGMENT_FIRST] = self.mesh.middle - segment_stations // 2
        whole[step.SEGMENT_STATIONS] = segment_stations
        at_rest = self.statics
        return step.Constants(
            real=real,
            whole=whole,
            damping=frame.damping,
            stiffness=frame.stiffness,
            newmark=frame.mass + gamma * ts * frame.damping + beta * ts**2 * frame.stiffness,
            dropper=np.ascontiguousarray(
                np.column_stack([np.array(line.dropper_positions), at_rest.dropper_elongations, at_rest.dropper_forces])
            ),
            static=lattice.static_table(at_rest, self.mesh.h),
            segment=self.reduced.compact,
        )

    def _state(self) -> step.State:
        n = 4 * self.mesh.stations
        line = self.config.line
        spans = math.ceil(2 * self.mesh.half_length / line.span_length) + 1
        droppers = max(1, spans * len(line.dropper_positions))
        springs = droppers + 2 * spans + 1  # the last row is scratch space
        return step.State(
            q=np.zeros((3, n + 2 * step.PAD)),
            taut=np.zeros(droppers, dtype=np.int64),
            counter=np.zeros(8, dtype=np.int64),
            point=np.zeros(5),
            segment=np.zeros((4, self.reduced.n)),
            external=np.zeros(n),
            predicted=np.zeros((2, n + 2 * step.PAD)),
            lu=np.zeros((n, 16)),
            rhs=np.zeros((2, n)),
            spring=np.zeros((springs, 4)),
            spring_g=np.zeros((springs, 8)),
            spring_at=np.zeros((springs, 3), dtype=np.int64),
        )

    def reset(self) -> None:
        """Go back to rest at the start position, cycle 0."""
        for array in self.state:
            array.fill(0)
        n_d = len(self.config.line.dropper_positions)
        behind = math.floor((self.config.start_position - self.mesh.half_length) / self.config.line.span_length) - 1
        self.state.counter[step.FIRST_DROPPER] = self.state.counter[step.NEXT_DROPPER] = behind * n_d
        step.place_springs(self.constants, self.state)
        step.observe(self.constants, self.state, 0.0)

    def step(self, f_cat: float) -> None:
        """Advance one cycle with the contact force f_cat (N, up positive) as the force of the new instant."""
        step.advance(self.constants, self.state, f_cat)

    @property
    def cycle(self) -> int:
        """Cycle number k of the present state."""
        return int(self.state.counter[step.CYCLE])

    @property
    def w_cat(self) -> float:
        """Displacement of the contact wire at the pantograph from its nominal height, m."""
        return float(self.state.point[step.W_CAT])

    @property
    def v_cat(self) -> float:
        """Its rate of change in the frame of the train, m/s."""
        return float(self.state.point[step.V_CAT])

    @property
    def a_cat(self) -> float:
        """Its second rate of change, m/s^2."""
        return float(self.state.point[step.A_CAT])

    @property
    def f_cat(self) -> float:
        """Contact force that acted in the last step, N."""
        return float(self.state.point[step.F_CAT])

    @property
    def track_position(self) -> float:
        """Position of the pantograph along the line, m."""
        return float(self.state.point[step.ZETA])

    @property
    def droppers(self) -> int:
        """Droppers within the domain."""
        return int(self.state.counter[step.DROPPERS])

    @property
    def slack_droppers(self) -> int:
        """Of these, slack ones."""
        return int(self.state.counter[step.SLACK])

    @property
    def iterations(self) -> int:
        """Solves of the last step."""
        return int(self.state.counter[step.ITERATIONS])

    @property
    def unsettled_steps(self) -> int:
        """Steps since the start whose slack state was not consistent after the most solves allowed."""
        return int(self.state.counter[step.UNSETTLED])

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
        """Nodal forces beside the contact force, N and N m, (4 stations,): write into it; it stays until changed."""
        return self.state.external

    @property
    def deviation(self) -> Array:
        """Deviation q, q', q'' from the static shape, (3, stations, wire, (w, phi)), a view."""
        inner = self.state.q[:, step.PAD : -step.PAD]
        return inner.reshape(3, self.mesh.stations, 2, 2)

    def wire_shape(self) -> wire_view.WireView:
        """Fill and return the shape of both wires for viewing; the arrays are reused."""
        self._view.fill(self.constants, self.state)
        return self._view
