"""The equations of the moving catenary with dense matrices and scalar code, written independently of the kernel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import elements, lattice
from catenary_model.model import Catenary
from catenary_model.moving_frame import dense
from catenary_model.statics import DROPPER, MAST, POINT_MASS

Array = NDArray[np.float64]

LOCAL_SAMPLES = 32


@dataclass
class Site:
    """A dropper, mast, arm or mass in the domain: force fade (k e + b) / (1 + k L) against its elongation e = g . q."""

    key: tuple[int, int, int]
    g: Array
    fade: float
    stiffness: float
    mass: float
    force: float
    elongation: float
    local: float
    one_sided: bool

    def law(self, taut: bool) -> tuple[float, float]:
        """Slope and offset of the force beyond rest."""
        k, b = self.stiffness, 0.0
        if self.one_sided:
            k, b = (k, k * self.elongation - self.force) if taut else (0.0, -self.force)
        share = self.fade / (1.0 + k * self.local)
        return share * k, share * b

    def energy(self, e: float) -> float:
        """Potential of the force beyond rest, J; without local compliance."""
        k, s = self.stiffness, self.elongation
        if self.one_sided and e < -s:
            return self.fade * (0.5 * k * s**2 - self.force * (e + s))
        return 0.5 * self.fade * k * e**2


def place(catenary: Catenary, x: float) -> tuple[int, Array]:
    """Element at x (m, relative to the pantograph) and the four shape functions there."""
    mesh = catenary.mesh
    at = (x + mesh.behind) / mesh.h
    e = min(int(at), mesh.stations - 2)
    psi = np.zeros(4)
    elements.shape_functions(at - e, mesh.h, psi)
    return e, psi


def sites_at(catenary: Catenary, zeta: float) -> list[Site]:
    """Everything that hangs on the wires when the pantograph is at track position zeta (m)."""
    config, mesh, rest = catenary.config, catenary.mesh, catenary.statics
    line, n = config.line, 4 * mesh.stations
    missing = np.zeros((2, LOCAL_SAMPLES + 1))
    if config.local_compliance:
        missing[0] = lattice.missing_compliance(line.carrier, mesh.h, LOCAL_SAMPLES)
        missing[1] = lattice.missing_compliance(line.contact, mesh.h, LOCAL_SAMPLES)
    found = []
    first, last = ((zeta + x) / line.period for x in (-mesh.behind, mesh.ahead))
    for period in range(int(np.floor(first)), int(np.ceil(last)) + 1):
        for i, position in enumerate(rest.sites.position):
            x = period * line.period + position - zeta
            if not -mesh.behind < x < mesh.ahead:
                continue
            e, psi = place(catenary, x)
            on_wire = np.zeros((2, n))
            for wire in range(2):
                for j, station in ((0, e), (2, e + 1)):
                    on_wire[wire, 4 * station + 2 * wire : 4 * station + 2 * wire + 2] = psi[j : j + 2]
            fade = (
                min(1.0, min(mesh.ahead - x, x + mesh.behind) / config.fading_length) if config.fading_length else 1.0
            )
            xi = (x + mesh.behind) / mesh.h - e
            local = [float(np.interp(xi, np.linspace(0, 1, LOCAL_SAMPLES + 1), row)) for row in missing]
            kind, k, sites = rest.sites.kind[i], rest.sites.stiffness[i], rest.sites
            masses = sites.carrier_mass[i], sites.contact_mass[i]
            if kind == POINT_MASS:
                for wire in np.flatnonzero(masses).tolist():
                    found.append(Site((period, i, wire), on_wire[wire], fade, 0.0, masses[wire], 0.0, 0.0, 0.0, False))
            elif kind == DROPPER:
                g = on_wire[0] - on_wire[1]
                F_s, stretch = rest.sites.force[i], rest.sites.elongation[i]
                found.append(Site((period, i, -1), g, fade, k, 0.0, F_s, stretch, local[0] + local[1], True))
                for wire in np.flatnonzero(masses).tolist():
                    found.append(Site((period, i, wire), on_wire[wire], fade, 0.0, masses[wire], 0.0, 0.0, 0.0, False))
            else:
                wire = 0 if kind == MAST else 1
                soft = 0.0 if masses[wire] else local[wire]
                found.append(Site((period, i, wire), on_wire[wire], fade, k, masses[wire], 0.0, 0.0, soft, False))
    return found


class DenseStep:
    """Steps a copy of a `Catenary`, whose matrices, feedback and statics it takes over and nothing else.

    A mass takes its motion over from the wire at the beginning of a step: dy/dt = q_t - v q_x along the wire.
    """

    def __init__(self, catenary: Catenary) -> None:
        self.c = catenary
        frame = catenary.frame
        self.M, self.D, self.K = dense(frame.mass), dense(frame.damping), dense(frame.stiffness)
        n = self.M.shape[0]
        self.q, self.v, self.a = np.zeros(n), np.zeros(n), np.zeros(n)
        self.steps, self.before, self.slack = 0, 0.0, 0
        self.motion = self._masses(sites_at(catenary, catenary.config.start_position))

    def _masses(self, sites: list[Site]) -> dict[tuple[int, int, int], tuple[float, float, float]]:
        """Displacement, velocity and acceleration of the masses, from the wires' present state."""
        v, mesh, found = self.c.config.speed, self.c.mesh, {}
        zeta = self.c.config.start_position + v * self.c.config.step_time * self.steps
        for site in sites:
            if site.mass:
                period, i, wire = site.key
                x = period * self.c.config.line.period + self.c.statics.sites.position[i] - zeta
                e = min(int((x + mesh.behind) / mesh.h), mesh.stations - 2)
                g = []
                for psi in elements.shape_derivatives(np.array([(x + mesh.behind) / mesh.h - e]), mesh.h):
                    row = np.zeros(self.q.size)
                    row[4 * e + 2 * wire : 4 * e + 2 * wire + 2] = psi[:2, 0]
                    row[4 * e + 4 + 2 * wire : 4 * e + 6 + 2 * wire] = psi[2:, 0]
                    g.append(row)
                rate = g[0] @ self.v - v * (g[1] @ self.q)
                rate_2 = g[0] @ self.a - 2 * v * (g[1] @ self.v) + v * v * (g[2] @ self.q)
                found[site.key] = (float(g[0] @ self.q), float(rate), float(rate_2))
        return found

    def cycle(self, force: float) -> None:
        """One cycle; the contact force runs in a straight line to `force` (N)."""
        n = self.c.config.substeps
        for j in range(1, n + 1):
            self._step(self.before + (force - self.before) * j / n)
        self.before = force

    def _absorb(self) -> Array:
        """Forces of the layers' feedback from the state before the step, node by node from the ends inwards."""
        u = np.zeros(self.q.size)
        if self.c.feedback is None:
            return u
        stations = self.c.mesh.stations
        for wire in range(2):
            for end in range(2):
                gain = self.c.feedback.gain[wire][end]
                order = range(stations) if end == 0 else range(stations - 1, -1, -1)
                rows = np.array([[4 * s + 2 * wire, 4 * s + 2 * wire + 1] for s in order]).ravel()
                states, inputs = gain.shape[1] // 3, gain.shape[0]
                x = np.concatenate([y[rows[:states]] for y in (self.q, self.v, self.a)])
                u[rows[:inputs]] += gain @ x
        return u

    def _step(self, force: float) -> None:
        config = self.c.config
        b, gm, ts = config.newmark_beta, config.newmark_gamma, config.cycle_time / config.substeps
        self.steps += 1
        sites = sites_at(self.c, config.start_position + config.speed * ts * self.steps)
        f = self._absorb() + self.c.external_load.ravel()
        f[4 * self.c.mesh.middle + 2] += force
        qp = self.q + ts * self.v + ts**2 * (0.5 - b) * self.a
        vp = self.v + ts * (1 - gm) * self.a
        for site in sites:
            if site.key in self.motion:
                y, rate, rate_2 = self.motion[site.key]
                place = y + ts * rate + ts**2 * (0.5 - b) * rate_2
                f += site.fade * site.mass / (b * ts**2) * place * site.g
        taut = [True] * len(sites)
        for _ in range(20):
            K, now = self.K.copy(), f.copy()
            for is_taut, site in zip(taut, sites, strict=True):
                k, offset = site.law(is_taut)
                k += site.fade * site.mass / (b * ts**2) if site.key in self.motion else 0.0
                at = np.flatnonzero(site.g)
                K[np.ix_(at, at)] += k * np.outer(site.g[at], site.g[at])
                now -= offset * site.g
            a = np.linalg.solve(self.M + gm * ts * self.D + b * ts**2 * K, now - self.D @ vp - K @ qp)
            q = qp + b * ts**2 * a
            found = [
                not site.one_sided or bool(site.elongation + site.g @ q + site.local * site.force > 0) for site in sites
            ]
            if found == taut:
                break
            taut = found
        self.q, self.v, self.a = q, vp + gm * ts * a, a
        self.motion = self._masses(sites)
        self.slack = len(taut) - sum(taut)
