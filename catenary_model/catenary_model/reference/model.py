"""The catenary-fixed line: the model that everything else is measured against.

Both wires lie still on a mesh in the track's frame; the pantograph runs along it. Integrated is the deviation from the
equilibrium *of the mesh* (`equilibrium`), by Newmark's method with everything, contact included, at the new instant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from catenary_model import statics
from catenary_model.line import Line, refuse_stitched
from catenary_model.pantograph import Pantograph
from catenary_model.reference import equilibrium, ride, step
from catenary_model.reference.links import ENDS, links
from catenary_model.reference.mesh import mesh_spans
from catenary_model.reference.ride import Ride
from catenary_model.reference.sites import repeated
from catenary_model.reference.train import Mounted, Train, mounted, train
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
        refuse_stitched(self.line, "the catenary-fixed reference")
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
        """Go back to rest, with the leading contact point at the start position."""
        fresh = step.state(self.mesh.nodes, self.links, self.state.point.shape[0])
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
        return self.ride_together([Mounted(pantograph)], duration, ramp, snapshot_every, progress)[0]

    def ride_together(
        self,
        pantographs: Iterable[Mounted | tuple[Pantograph, float, float | None]],
        duration: float,
        ramp: float = 1.0,
        snapshot_every: float | None = None,
        progress: Callable[[float], None] | None = None,
    ) -> tuple[Ride, ...]:
        """Let the pantographs of one train ride, as `ride` does with one; return the record of each, in their order.

        Each is a pantograph, its distance behind the leading one (m) and its static force (N; None: its own uplift).
        The start position is the leading one's. Time, slack droppers, uplift of the masts and snapshots are the same in
        all records. Raises ValueError naming the pantograph whose place is not allowed; nor may one leave the mesh.
        """
        entries = mounted(pantographs, self.mesh.h)
        for i, entry in enumerate(entries):
            self._behind_on_track(f"pantographs[{i}].behind", entry.behind)
        order = sorted(range(len(entries)), key=lambda i: entries[i].behind)
        ordered = [entries[i] for i in order]
        self._go_to_rest(len(entries))
        heights = [float(self.height(self.start_position - entry.behind)) for entry in ordered]
        steps = round(duration / self.config.time_step)
        coupled = self._train(ordered, heights)
        nothing = np.zeros((0, len(entries)))
        records = self._run(steps, coupled, nothing, ramp, snapshot_every, progress)
        return tuple(records[order.index(i)] for i in range(len(entries)))

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
        return self.push_together(force[:, np.newaxis], (0.0,), snapshot_every, progress, fresh)[0]

    def push_together(
        self,
        force: Array,
        behind: Sequence[float],
        snapshot_every: float | None = None,
        progress: Callable[[float], None] | None = None,
        fresh: bool = True,
    ) -> tuple[Ride, ...]:
        """Let given forces run one behind the other, as `push` does with one; return the record of each.

        `force` is (steps, contacts) in N; `behind` are the distances (m) from the leading one, which is at 0, rising.
        Raises ValueError for a distance that is not allowed, and if one would leave the mesh.
        """
        nobody = Pantograph.of([1.0], [[0.0]], [[0.0]], 0.0)
        entries = mounted([Mounted(nobody, distance) for distance in behind], self.mesh.h)
        if list(behind) != sorted(behind):
            raise ValueError(f"behind = {list(behind)} m: allowed are distances that rise from 0 m on")
        for i, entry in enumerate(entries):
            self._behind_on_track(f"behind[{i}]", entry.behind)
        if fresh:
            self._go_to_rest(len(entries))
        else:
            self.state = step.of_contacts(self.state, len(entries))
        given = np.ascontiguousarray(force, dtype=np.float64)
        if given.ndim != 2 or given.shape[1] != len(entries):
            raise ValueError(f"force has shape {given.shape}; allowed is (steps, {len(entries)})")
        coupled = self._train(entries, [0.0] * len(entries))
        return self._run(given.shape[0], coupled, given, 0.0, snapshot_every, progress)

    def _go_to_rest(self, contacts: int) -> None:
        self.state = step.of_contacts(self.state, contacts)
        self.reset()

    def _train(self, entries: Sequence[Mounted], heights: Sequence[float]) -> Train:
        config = self.config
        return train(entries, heights, config.time_step, config.newmark_beta, config.newmark_gamma)

    def _run(
        self,
        steps: int,
        coupled: Train,
        given: Array,
        ramp: float,
        snapshot_every: float | None,
        progress: Callable[[float], None] | None,
    ) -> tuple[Ride, ...]:
        config, ts = self.config, self.config.time_step
        if steps < 1:
            raise ValueError("a ride needs at least one step")
        self._end_of_track(self.start_position + self.travel.at(ts * (int(self.state.counter[step.STEP]) + steps))[0])
        track = np.array([self.mesh.start, self.mesh.h, self.start_position, ts, max(ramp, 1e-12)])
        real, whole = np.zeros((coupled.behind.size, 7, steps)), np.zeros((2, steps), dtype=np.int64)
        uplift = np.zeros((steps, self.supports.size))
        chunk = _CHUNK if snapshot_every is None else max(1, round(snapshot_every / ts))
        snapshots, times = [], []
        for first in range(0, steps, chunk):
            part = slice(first, min(first + chunk, steps))
            columns = np.zeros((*real.shape[:2], part.stop - first)), np.zeros((2, part.stop - first), dtype=np.int64)
            ride.run(
                self.wires,
                self.links,
                self.state,
                track,
                self.travel.table,
                self.static,
                coupled,
                given[part],
                self._support_element,
                self._support_psi,
                *columns,
                uplift[part],
                config.max_slack_iterations,
            )
            real[:, :, part], whole[:, part] = columns
            if snapshot_every is not None:
                snapshots.append(self.heights())
                times.append(float(real[0, ride.T, part.stop - 1]))
            if progress is not None:
                progress(part.stop / steps)
        kept = np.array(snapshots) if snapshots else np.zeros((0, 2, self.mesh.nodes))
        return tuple(
            Ride(
                t=row[ride.T],
                zeta=row[ride.ZETA],
                w=row[ride.W],
                v=row[ride.V],
                F=row[ride.F],
                head=row[ride.HEAD],
                slack=whole[ride.SLACK],
                iterations=whole[ride.ITERATIONS],
                supports=self.supports,
                uplift=uplift,
                snapshot_t=np.array(times),
                snapshots=kept,
                speed=row[ride.SPEED],
            )
            for row in real
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

    def _behind_on_track(self, name: str, behind: float) -> None:
        most = self.start_position - self.mesh.start - self._reach
        if behind > most:
            raise ValueError(
                f"{name} = {behind:g} m: allowed is at most {most:g} m, where the meshed track begins behind the start "
                f"at {self.start_position:g} m"
            )
