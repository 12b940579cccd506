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

import numpy as np
from numpy.typing import NDArray

from catenary_model import (
    arena,
    companions,
    coupled,
    lattice,
    layout,
    reduced,
    sites,
    statics,
    step,
    wire_view,
    wires,
)
from catenary_model.boundary import Feedback, impose
from catenary_model.config import Config
from catenary_model.moving_frame import MovingFrame, assemble, highest_frequency, local_mass
from catenary_model.observed import Observed, Scheme
from catenary_model.site_table import site_table

__all__ = ["Catenary", "Config", "check_stability", "site_table"]

Array = NDArray[np.float64]

_SAMPLES = 32
"""Places within an element at which the missing compliance is tabulated."""


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
    line, h = statics.built(config.line), config.element_length
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


class Catenary(Observed):
    """Moving catenary by finite elements with all its state; a step allocates nothing.

    >>> catenary = Catenary(Config(spans=2))
    >>> for _ in range(500):
    ...     catenary.step(120.0)
    >>> 0.01 < catenary.w_cat < 0.1
    True
    """

    scheme = Scheme(step.start, step.cycle, coupled.run, coupled.push)

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
        self.constants: layout.Constants
        self.state: layout.State
        constants = self._constants()
        *self._packed, self.constants, self.state = arena.pack(constants, self._state(constants))
        lattice.static_table(self.statics, self.mesh.h, self.constants.static)  # where it stays: there is no second one
        self._view = wire_view.WireView.of(self.mesh, self.statics)
        self.reset()

    def _constants(self) -> layout.Constants:
        config, line, frame = self.config, self.config.line, self.frame
        ts, beta, gamma = config.step_time, config.newmark_beta, config.newmark_gamma
        factors = wires.factor(frame, ts, beta, gamma)
        near, first, last = wires.green(factors, config.coupling_tolerance)
        compliance, local = 0.0, np.zeros((2, _SAMPLES + 1))
        if config.local_compliance:
            compliance = lattice.local_compliance(line.contact.seen_from(config.speed), self.mesh.h)
            for row, wire in zip(local, (line.carrier, line.contact), strict=True):
                row[:] = lattice.missing_compliance(wire, self.mesh.h, _SAMPLES)
        real = arena.record(
            layout.REAL,
            ts=ts,
            beta=beta,
            gamma=gamma,
            speed=config.speed,
            start=config.start_position,
            behind=self.mesh.behind,
            ahead=self.mesh.ahead,
            h=self.mesh.h,
            fading=config.fading_length,
            period=line.period,
            compliance=compliance,
        )
        self._beside = beside = companions.bundle(
            config.companions, ts, (beta, gamma), compliance, self.mesh.h, self.mesh.middle
        )
        segment_stations = self.reduced.x.size
        whole = arena.record(
            layout.WHOLE,
            stations=self.mesh.stations,
            substeps=config.substeps,
            max_iterations=config.max_slack_iterations,
            segment_first=self.mesh.middle - segment_stations // 2,
            segment_stations=segment_stations,
            green_first=first,
            green_last=last,
            reach=near.shape[4] // 2,
        )
        return layout.Constants(
            real=real,
            whole=whole,
            sweep=factors.sweep,
            middle=factors.middle,
            inner=factors.inner,
            outer=factors.outer,
            pivot=factors.pivot,
            green=near,
            site=site_table(self.statics, config.one_sided_droppers),
            local=local,
            static=lattice.blank_table(line.period),
            segment=self.reduced.compact,
            gain=gains(self.feedback),
            beside=beside.beside,
            riders=beside.riders,
        )

    def _state(self, c: layout.Constants) -> layout.State:
        stations = self.mesh.stations
        padded = stations + 2 * wires.PAD
        at, period = c.site[:, layout.POSITION], self.config.line.period
        ring = max(1, sites.most_at_once(at, period, self.mesh.h * self.mesh.elements))
        near = sites.most_at_once(at, period, self.mesh.h * (c.whole["reach"] + 1))
        count = c.beside.shape[0]
        most, band = ring + 1 + count, 2 * (near + count) + 1  # with all pantographs
        return layout.State(
            q=np.zeros((3, 2, 2, padded)),
            taut=np.zeros(ring, dtype=np.int64),
            particle=np.zeros((ring, 4)),
            counter=np.zeros(11, dtype=np.int64),
            point=np.zeros(7),
            contact=np.zeros(6),
            segment=np.zeros((4, self.reduced.n)),
            external=np.zeros((2, 2, stations)),
            layer=np.zeros((2, 2, c.gain.shape[3])),
            rhs=np.zeros((2, 2, stations)),
            here=np.zeros((12, most)),
            where=np.zeros((4, most), dtype=np.int64),
            psi=np.zeros((4, most)),
            compliance=np.zeros((most, band)),
            system=np.zeros((most, band)),
            scratch=np.zeros(6),
            aside=self._beside.aside,
        )

    @property
    def local_compliance(self) -> float:
        """What the mesh lacks in compliance under the contact force, dC in m/N: part of `w_cat`."""
        return float(self.constants.real["compliance"])

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
        self._view.fill(self.constants, self.state, self.deviation[0, :, :, 0].T, self.mesh.behind)
        return self._view

    @property
    def rider_newmark(self) -> tuple[float, float]:
        """Newmark's beta and gamma for a pantograph that rides on this wire."""
        return self.config.newmark_beta, self.config.newmark_gamma
