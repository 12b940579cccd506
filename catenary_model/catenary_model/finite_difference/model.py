"""The moving catenary by finite differences (3.1.2.1, Publication B): explicit, two wires on one uniform grid.

As in `catenary_model.model` only the deviation from the static equilibrium is computed, with the same statics, sites
and reduced model. The interior is `absorbing.moving_beam`, the ends are boundary stencils of `absorbing`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary_model import arena, companions, lattice, layout, reduced, sites, statics, wire_view
from catenary_model.absorbing import Stencil
from catenary_model.absorbing.moving_beam import moving_beam, shift
from catenary_model.config import Config
from catenary_model.finite_difference import coupled, ends, grid, step, wires
from catenary_model.finite_difference import layout as own
from catenary_model.line import Wire
from catenary_model.moving_frame import CONTACT, Mesh, refuse_fast
from catenary_model.observed import Observed, Scheme
from catenary_model.site_table import site_table

Array = NDArray[np.float64]

RIDER_NEWMARK = 0.25, 0.5
"""Newmark's parameters for a pantograph on this wire: stable for any step and without damping."""
_MARGIN = 0.8
"""Share of the largest stiffness that the explicit scheme bears on one wire."""


def interior(config: Config, wire: Wire) -> Stencil:
    """Interior scheme of one wire. Raises ValueError naming the parameters if a step is too long for the grid."""
    try:
        return moving_beam(
            wire.mass_per_length,
            wire.damping,
            wire.bending_stiffness,
            wire.tension,
            config.speed,
            config.grid_spacing,
            config.step_time,
            config.grid_reach,
        )
    except ValueError as error:
        raise ValueError(
            f"cycle_time / grid_substeps = {config.step_time * 1e3:.3g} ms, grid_spacing = {config.grid_spacing} m: "
            f"{error}"
        ) from None


def grids(config: Config) -> tuple[grid.Grid, grid.Grid]:
    """Carrier and contact wire on the grid."""
    spacing, ts, v, R = config.grid_spacing, config.step_time, config.speed, config.grid_reach
    return grid.Grid(config.line.carrier, spacing, ts, v, R), grid.Grid(config.line.contact, spacing, ts, v, R)


def segment_mesh(config: Config) -> Mesh:
    """Mesh of the controller's elements: multiples of the spacing, as many as fit behind the pantograph."""
    h = config.grid_spacing * max(1, round(config.element_length / config.grid_spacing))
    return Mesh(h, math.floor(config.mesh.half_length / h + 1e-9))


def design_ends(config: Config) -> tuple[tuple[Stencil, ...], tuple[ends.Pair, ...]]:
    """Return the interior scheme of carrier and contact wire, and what ends them. Raises ValueError."""
    wires = config.line.carrier, config.line.contact
    stencils = tuple(interior(config, wire) for wire in wires)
    return stencils, tuple(ends.design(config, wire, stencil) for wire, stencil in zip(wires, stencils, strict=True))


def check(config: Config) -> None:
    """Refuse what cannot be built, but for the design of the ends. Raises ValueError naming what to change."""
    line = config.line
    refuse_fast(line.carrier, line.contact, config.speed)
    for wire in (line.carrier, line.contact):
        interior(config, wire)
    if config.grid_boundary not in ends.ENDS:
        raise ValueError(f"grid_boundary = '{config.grid_boundary}' must be one of {', '.join(ends.ENDS)}")
    mesh = segment_mesh(config)
    beyond = grid.DUAL_REACH * mesh.h
    if config.segment_half_length > mesh.half_length - beyond:
        raise ValueError(
            f"segment_half_length = {config.segment_half_length} m exceeds half the domain, {config.mesh.half_length} "
            f"m, less {beyond:g} m"
        )
    carrier, contact = (_MARGIN * one.stiffest() for one in grids(config))
    for i, span in enumerate(statics.built(line).spans):
        arm = span.steady_arm.stiffness if span.steady_arm else 0.0
        springs = [(f"spans[{i}].mast", span.mast.stiffness, 1.0 / carrier)]
        springs.append((f"spans[{i}].steady_arm", arm, 1.0 / contact))
        for j, dropper in enumerate(span.droppers):
            springs.append((f"spans[{i}].droppers[{j}]", dropper.stiffness, 1.0 / carrier + 1.0 / contact))
        for name, stiffness, yields in springs:
            if stiffness * yields > 1.0:
                raise ValueError(
                    f"cycle_time / grid_substeps = {config.step_time * 1e3:.3g} ms is too long for {name}.stiffness = "
                    f"{stiffness:g} N/m on grid_spacing = {config.grid_spacing} m: at most {1.0 / yields:.3g} N/m is "
                    "stable; choose more grid_substeps"
                )


class Catenary(Observed):
    """Moving catenary by finite differences with all its state; a step allocates nothing.

    >>> catenary = Catenary(Config(discretisation="fd", grid_boundary="one_way"))
    >>> for _ in range(500):
    ...     catenary.step(120.0)
    >>> 0.01 < catenary.w_cat < 0.1
    True
    """

    scheme = Scheme(step.start, step.cycle, coupled.run, coupled.push)

    def __init__(self, config: Config) -> None:
        """Build everything and go to rest at the start position. Raises ValueError for what cannot be built."""
        if config.discretisation != "fd":
            raise ValueError(f"discretisation = '{config.discretisation}' must be 'fd'")
        check(config)
        self.config = config
        line = config.line
        self.mesh = config.mesh
        self.statics = statics.solve(line)
        self.stencils, self.ends = design_ends(config)
        self.segment_mesh = segment_mesh(config)
        self.reduced = reduced.reduce(self.segment_mesh, line.contact, config.speed, config.segment_half_length)
        self.constants: own.Constants
        self.state: own.State
        constants = self._constants()
        if config.companions:
            self.scheme = Scheme(step.start, step.cycle_together, coupled.run_together, coupled.push_together)
        *self._packed, self.constants, self.state = arena.pack(*self._together(constants, self._state(constants)))
        grid.static_table(self.statics, grids(config)[CONTACT], self.constants.static)  # where they stay
        lattice.static_table(self.statics, self.segment_mesh.h, self.constants.rest)
        self._view = wire_view.WireView.of(self.mesh, self.statics)
        self.reset()

    def _constants(self) -> own.Constants:
        config, line, mesh = self.config, self.config.line, self.mesh
        reach = [max(stencil.reach[0]) for stencil in self.stencils]
        most = max(reach)
        both = grids(config)
        per_mass = np.zeros(2)
        for i, stencil in enumerate(self.stencils):
            wire = both[i].wire
            decay = math.exp(-0.5 * wire.damping / wire.mass_per_length * config.step_time)
            per_mass[i] = decay / (stencil.new_coefficient * mesh.h)
        compliance, local = 0.0, np.zeros((2, 2))
        if config.local_compliance:
            compliance = both[CONTACT].contact_compliance()
            local = np.stack([one.missing_compliance() for one in both])
        whole = arena.record(
            own.WHOLE,
            stations=mesh.stations,
            substeps=config.steps_per_cycle,
            segment_stations=self.reduced.x.size,
            middle=mesh.middle,
            per_element=round(self.segment_mesh.h / mesh.h),
        )
        inner = np.stack([wires.factors(one.wire, one.speed, one.dx, one.dt, one.reach) for one in both])
        levels = max(boundary.n_t for pair in self.ends for boundary in pair)
        levels = max(levels, *(stencil.levels for stencil in self.stencils))
        width = max(boundary.n_x for pair in self.ends for boundary in pair) + most
        edge = np.zeros((2, 2, most, levels, width))
        for i, stencil in enumerate(self.stencils):
            edge[i] = ends.rows(stencil, self.ends[i], most, levels, width)
        used = np.flatnonzero(np.abs(edge).max(axis=(0, 1, 2, 3)))
        edge = np.ascontiguousarray(edge[..., : int(used.max(initial=0)) + 1].transpose(0, 1, 3, 4, 2))
        # a boundary stencil takes what it reads for free wire: no force may act there
        free = mesh.h * (edge.shape[3] + 1)
        real = arena.record(
            own.REAL,
            ts=config.step_time,
            speed=config.speed,
            start=config.start_position,
            behind=mesh.behind - free,
            ahead=mesh.ahead - free,
            h=mesh.h,
            fading=config.fading_length,
            period=line.period,
            compliance=compliance,
            origin=mesh.behind,
            dx=mesh.h,
        )
        return own.Constants(
            real=real,
            whole=whole,
            per_mass=per_mass,
            reach=np.array(reach, dtype=np.int64),
            inner=inner,
            edge=edge,
            carry=shift(config.speed * config.step_time / mesh.h, config.grid_reach),
            site=site_table(self.statics, config.one_sided_droppers),
            local=local,
            static=lattice.blank_table(line.period),
            rest=lattice.blank_table(line.period),
            project=grid.projection(mesh.h, int(whole["per_element"])),
            segment=self.reduced.compact,
        )

    def _state(self, c: own.Constants) -> own.State:
        nodes = self.mesh.stations
        ring = max(1, sites.most_at_once(c.site[:, layout.POSITION], self.config.line.period, self.mesh.h * nodes))
        most = ring + 1  # with the contact point
        return own.State(
            w=np.zeros((max(c.edge.shape[2], 2) + 1, 2, nodes + wires.PADDING)),
            taut=np.zeros(ring, dtype=np.int64),
            particle=np.zeros((ring, 4)),
            counter=np.zeros(own.NOW + 1, dtype=np.int64),
            point=np.zeros(7),
            contact=np.zeros(6),
            segment=np.zeros((4, self.reduced.n)),
            external=np.zeros((2, nodes)),
            here=np.zeros((12, most)),
            where=np.zeros((4, most), dtype=np.int64),
            psi=np.zeros((4, most)),
            between=np.zeros(nodes + wires.PADDING),
            ends=np.zeros((2, c.edge.shape[4])),
        )

    def _together(self, c: own.Constants, s: own.State) -> Any:
        """Give the bundles, with the companions if there are any."""
        config, mesh = self.config, self.mesh
        if not config.companions:
            return c, s
        local = float(c.real["compliance"])
        beside = companions.bundle(config.companions, config.step_time, RIDER_NEWMARK, local, mesh.h, mesh.middle)
        return own.ConstantsTogether(*c, beside.beside), own.StateTogether(*s, beside.aside)

    @property
    def local_compliance(self) -> float:
        """What the *reduced* model's elements lack in compliance under the contact force, dC in m/N."""
        if not self.config.local_compliance:
            return 0.0
        return lattice.local_compliance(self.config.line.contact.seen_from(self.config.speed), self.segment_mesh.h)

    @property
    def external_load(self) -> Array:
        """Forces beside the contact force, N, (nodes, wire), of the present instant: write into it; it stays."""
        self.state.counter[layout.PUSHED] = 1
        return self.state.external.T

    @property
    def deviation(self) -> Array:
        """Deviation from the static shape, its first and second rate of change, (3, nodes, wire), m, m/s, m/s^2."""
        w, now, ts = self.state.w, int(self.state.counter[own.NOW]), self.config.step_time
        before, old, new = (w[(now + i) % w.shape[0], :, : self.mesh.stations] for i in (-1, 0, 1))
        return np.stack([old, (new - before) / (2.0 * ts), (new - 2.0 * old + before) / ts**2]).transpose(0, 2, 1)

    def wire_shape(self) -> wire_view.WireView:
        """Fill and return the shape of both wires for viewing; the arrays are reused."""
        present = self.state.w[self.state.counter[own.NOW], :, : self.mesh.stations]
        self._view.fill(self.constants, self.state, present, self.mesh.behind)
        return self._view

    @property
    def rider_newmark(self) -> tuple[float, float]:
        """Newmark's beta and gamma for a pantograph that rides on this wire."""
        return RIDER_NEWMARK
