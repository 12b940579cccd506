"""The catenary-fixed line: the model that everything else is measured against.

Both wires lie still on a mesh in the track's frame; the pantograph runs along it. Integrated is the deviation from the
equilibrium *of the mesh* (`equilibrium`), by Newmark's method with everything, contact included, at the new instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from catenary_model import pantograph as panto
from catenary_model import statics
from catenary_model.line import Line
from catenary_model.pantograph import Pantograph
from catenary_model.reference import equilibrium, ride, step
from catenary_model.reference.links import ENDS, links
from catenary_model.reference.mesh import mesh_spans
from catenary_model.reference.ride import Ride
from catenary_model.reference.sites import repeated
from catenary_model.reference.wires import wires
from catenary_model.statics import MAST
from catenary_model.travel import Travel, constant

Array = NDArray[np.float64]

_CHUNK = 500
"""Steps between two calls of the progress function."""


@dataclass(frozen=True)
class Config:
    """Line, ride and numerical settings; the defaults are the reference run of Table 3.1. Raises ValueError."""

    line: Line = field(default_factory=Line)
    speed: float = 250.0 / 3.6
    """v, m/s, unless there is a `travel`."""
    travel: Travel | None = None
    """A journey whose speed changes, in the place of `speed`; its place is counted from `start_position` on."""
    spans: int = 28
    """Spans on the mesh, taken from the line's sequence."""
    first_span: int = 0
    """Running number of the first of them; negative ones exist as well."""
    start_position: float | None = None
    """Track position of the contact point at t = 0, m; None: one and a half spans from the start of the mesh."""
    element_length: float = 0.25
    """dx, m; shortened so that whole elements fit."""
    time_step: float = 2e-4
    """Ts, s."""
    newmark_beta: float = 0.25
    newmark_gamma: float = 0.5
    ends: str = "matched_dashpot"
    """What ends the wires: one of `links.ENDS`."""
    max_slack_iterations: int = 20
    """Most solves a step; steps that did not settle are counted."""

    def __post_init__(self) -> None:
        for name in ("element_length", "time_step", "newmark_beta"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")
        if not (math.isfinite(self.speed) and self.speed >= 0.0):
            raise ValueError(f"speed = {self.speed} must be finite and at least 0")
        if not self.newmark_gamma >= 0.5:
            raise ValueError(f"newmark_gamma = {self.newmark_gamma} is below 0.5: the integration would be unstable")
        if self.spans < 1 or self.max_slack_iterations < 1:
            raise ValueError(f"spans = {self.spans} and max_slack_iterations = {self.max_slack_iterations} must be > 0")
        if self.ends not in ENDS:
            raise ValueError(f"ends = {self.ends!r} is not one of {', '.join(ENDS)}")
        if self.travel is not None:
            self.travel.refuse_too_fast(self.line)


class Reference:
    """Catenary-fixed line with all its state; a step allocates nothing.

    >>> reference = Reference(Config(spans=4, element_length=1.0, time_step=2e-3))
    >>> record = reference.push(np.full(500, 120.0))
    >>> bool(0.01 < record.w[-1] < 0.1)
    True
    """

    def __init__(self, config: Config) -> None:
        """Build everything and go to rest. Raises ValueError for what cannot be built."""
        self.config = config
        line, ts = config.line, config.time_step
        self.statics = statics.solve(line)
        self.mesh = mesh_spans(line, config.first_span, config.spans, config.element_length)
        self.sites = repeated(self.statics, self.mesh)
        self.equilibrium = equilibrium.carry(self.statics, self.mesh, self.sites)
        self.wires = wires(line, self.mesh, ts, config.newmark_beta, config.newmark_gamma)
        self.links = links(line, self.mesh, self.sites, self.equilibrium, config.ends, self.wires)
        self.state = step.state(self.mesh.nodes, self.links)
        self.static = np.ascontiguousarray(self.equilibrium.nodal[2:])
        self.supports: Array = self.sites.position[self.sites.kind == MAST]
        located = [self.mesh.locate(float(zeta)) for zeta in self.supports]
        self._support_element = np.array([e for e, _ in located], dtype=np.int64)
        self._support_psi = np.array([psi for _, psi in located])
        start = config.start_position
        if start is None:
            start = self.mesh.start + 1.5 * (self.mesh.end - self.mesh.start) / config.spans
        self.start_position = start
        self.travel = constant(config.speed) if config.travel is None else config.travel
        self._reach = (self.links.influence.shape[2] // 2 + 1) * self.mesh.h
        self._end_of_track(start)
        self.reset()

    def reset(self) -> None:
        """Go back to rest, with the contact point at the start position."""
        fresh = step.state(self.mesh.nodes, self.links)
        for array, new in zip(self.state, fresh, strict=True):
            array[...] = new
        step.factor(self.links, self.state, 0)

    def ride(
        self,
        pantograph: Pantograph,
        duration: float,
        ramp: float = 1.0,
        snapshot_every: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> Ride:
        """Let a pantograph ride for `duration` s, from rest of the line.

        It starts at its first speed with all its masses at the height of the wire, touching without force; its uplift
        comes up within `ramp` s as (1 - cos)/2. `snapshot_every` s the wires' heights are kept. `progress` is called
        with the share done (1). Raises ValueError if the ride would leave the mesh.
        """
        config = self.config
        self.reset()
        constants = panto.constants(pantograph, config.time_step, config.newmark_beta, config.newmark_gamma)
        state = panto.at_rest(pantograph, float(self.height(self.start_position)))
        steps = round(duration / config.time_step)
        return self._run(steps, constants, state, np.zeros(0), ramp, snapshot_every, progress)

    def push(
        self,
        force: Array,
        snapshot_every: float | None = None,
        progress: Callable[[float], None] | None = None,
        fresh: bool = True,
    ) -> Ride:
        """Let given contact forces (N, up positive; entry k acts at the instant t = (k + 1) Ts) run along the line.

        Unless `fresh`, the line goes on from its present state, the force from where the last one left off. Raises
        ValueError if they would leave the mesh.
        """
        if fresh:
            self.reset()
        nothing = Pantograph.of([1.0], [[0.0]], [[0.0]], 0.0)
        config = self.config
        constants = panto.constants(nothing, config.time_step, config.newmark_beta, config.newmark_gamma)
        given = np.ascontiguousarray(force, dtype=np.float64)
        return self._run(given.size, constants, panto.at_rest(nothing, 0.0), given, 0.0, snapshot_every, progress)

    def _run(
        self,
        steps: int,
        constants: panto.Constants,
        state: panto.State,
        given: Array,
        ramp: float,
        snapshot_every: float | None,
        progress: Callable[[float], None] | None,
    ) -> Ride:
        config, ts = self.config, self.config.time_step
        if steps < 1:
            raise ValueError("a ride needs at least one step")
        self._end_of_track(self.start_position + self.travel.at(ts * (int(self.state.counter[step.STEP]) + steps))[0])
        track = np.array([self.mesh.start, self.mesh.h, self.start_position, ts, max(ramp, 1e-12)])
        real, whole = np.zeros((7, steps)), np.zeros((2, steps), dtype=np.int64)
        uplift = np.zeros((steps, self.supports.size))
        chunk = _CHUNK if snapshot_every is None else max(1, round(snapshot_every / ts))
        snapshots, times = [], []
        for first in range(0, steps, chunk):
            part = slice(first, min(first + chunk, steps))
            columns = np.zeros((7, part.stop - first)), np.zeros((2, part.stop - first), dtype=np.int64)
            ride.run(
                self.wires,
                self.links,
                self.state,
                track,
                self.travel.table,
                self.static,
                constants,
                state,
                given[part],
                self._support_element,
                self._support_psi,
                *columns,
                uplift[part],
                config.max_slack_iterations,
            )
            real[:, part], whole[:, part] = columns
            if snapshot_every is not None:
                snapshots.append(self.heights())
                times.append(float(real[ride.T, part.stop - 1]))
            if progress is not None:
                progress(part.stop / steps)
        return Ride(
            t=real[ride.T],
            zeta=real[ride.ZETA],
            w=real[ride.W],
            v=real[ride.V],
            F=real[ride.F],
            head=real[ride.HEAD],
            slack=whole[ride.SLACK],
            iterations=whole[ride.ITERATIONS],
            supports=self.supports,
            uplift=uplift,
            snapshot_t=np.array(times),
            snapshots=np.array(snapshots) if snapshots else np.zeros((0, 2, self.mesh.nodes)),
            speed=real[ride.SPEED],
        )

    def heights(self) -> Array:
        """Present heights of carrier and contact wire at the nodes, m, (2, nodes)."""
        return np.asarray((self.equilibrium.nodal + self.state.q[0])[[0, 2]])

    def height(self, zeta: float) -> float:
        """Present height of the contact wire at track position zeta (m), m."""
        e, psi = self.mesh.locate(zeta)
        return self.height_at_rest(zeta) + float(psi @ self.state.q[0, 2:, e : e + 2].T.ravel())

    def height_at_rest(self, zeta: float) -> float:
        """Height of the contact wire at rest at track position zeta (m), as the mesh sees it, m."""
        e, psi = self.mesh.locate(zeta)
        return float(psi @ self.static[:, e : e + 2].T.ravel())

    @property
    def unsettled_steps(self) -> int:
        """Steps since the start whose slack state was not consistent after the most solves allowed."""
        return int(self.state.counter[step.UNSETTLED])

    def _end_of_track(self, zeta: float) -> None:
        first, last = self.mesh.start + self._reach, self.mesh.end - self._reach
        if not first <= zeta <= last:
            raise ValueError(
                f"the contact point would be at {zeta:.1f} m; it has to stay between {first:.1f} and {last:.1f} m"
            )
