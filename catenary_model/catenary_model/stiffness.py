"""Static deflection of the line under one vertical force on the contact wire, and the stiffness that it feels.

The line is taken as endless: one force on a domain that repeats itself after so many periods of the line that the
force does not feel its images. What is solved for is the deviation from rest, with the Green's functions of
`periodic_beam`; the loads are the force f at x, what the droppers pull beyond rest, and the reactions of the masts
(k_m, on the carrier) and of the steady arms (k_arm, on the contact wire). Droppers are one-sided springs:

    F_i = k_d e_i if e_i > 0, else 0,     e_i = e_i at rest + carrier's deviation - contact wire's deviation.

No mesh, no dynamics. A stiffness is f over the deflection under f; it depends on f as soon as droppers go slack.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.periodic_beam import PeriodicBeam, green
from catenary_model.statics import DROPPER, MAST, STEADY_ARM, Statics, StaticsError, one_sided

Array = NDArray[np.float64]

_LEAST_LENGTH = 400.0
_MOST_UNKNOWNS = 3000


@dataclass(frozen=True)
class Deflection:
    """The line under a static force."""

    force: float
    """f, N, up."""
    uplift: float
    """Deviation of the contact wire from rest under the force, m."""
    dropper_forces: Array
    """Tensions of all droppers of the domain, N, in the order of `PushedLine.dropper_positions`."""
    contact_beam: PeriodicBeam
    """Deviation of the contact wire from rest."""

    def contact(self, zeta: Array) -> Array:
        """Deviation of the contact wire from rest at track positions zeta, m."""
        return self.contact_beam.value(zeta)


class PushedLine:
    """An endless line at rest that can be pushed anywhere.

    Attributes: `rest` (Statics), `length` of the repeated domain (m), `dropper_positions` (m) in it.
    """

    def __init__(self, rest: Statics, tolerance: float = 1e-5) -> None:
        """Double the domain until the uplift under 1 N changes by less than `tolerance` of itself.

        Raises StaticsError if nothing holds the contact wire, or if a push is felt too far away.
        """
        self.rest = rest
        held = (rest.sites.kind == DROPPER) | (rest.sites.kind == STEADY_ARM) & (rest.sites.stiffness > 0.0)
        if not held.any():
            raise StaticsError("the contact wire hangs from nothing: it has no static stiffness")
        period = rest.line.period
        probe = np.array([0.5 * rest.line.spans[0].length])
        copies = int(np.ceil(_LEAST_LENGTH / period))
        self._build(copies)
        before = self.uplift(probe, 1.0)[0]
        while True:
            copies *= 2
            if copies * rest.sites.position.size > _MOST_UNKNOWNS:
                raise StaticsError("the droppers, masts and arms are so soft that a push is felt too far away")
            self._build(copies)
            after = self.uplift(probe, 1.0)[0]
            if abs(after - before) <= tolerance * abs(after):
                return
            before = after

    def _build(self, copies: int) -> None:
        """Assemble the system for a domain of so many periods."""
        line, sites = self.rest.line, self.rest.sites
        used = (sites.kind != STEADY_ARM) | (sites.stiffness > 0.0)
        starts = line.period * np.arange(copies)[:, None]
        position = (starts + sites.position[used]).ravel()
        kind, k, rest_force, rest_stretch = (
            np.tile(column[used], copies) for column in (sites.kind, sites.stiffness, sites.force, sites.elongation)
        )
        self.length = copies * line.period
        drop, mast, arm = kind == DROPPER, kind == MAST, kind == STEADY_ARM
        self.dropper_positions: Array = position[drop]
        self._rest_force: Array = rest_force[drop]
        self._rest_taut: NDArray[np.bool_] = self._rest_force > 0.0
        n, m, a = int(drop.sum()), int(mast.sum()), int(arm.sum())
        self._on_contact: Array = np.concatenate((position[drop], position[arm]))
        on_carrier = np.concatenate((position[drop], position[mast]))
        self._on_contact_rows = np.r_[0:n, n + m : n + m + a]

        # unknowns: F (n), mast reactions (m), arm reactions (a), mean deviation of the carrier, of the contact wire
        size = n + m + a + 2
        carrier = np.zeros((n + m, size))
        matrix = green(on_carrier[:, None] - on_carrier[None, :], self.length, line.carrier)[0]
        carrier[:, :n], carrier[:, n : n + m], carrier[:, -2] = -matrix[:, :n], matrix[:, n:], 1.0
        contact = np.zeros((n + a, size))
        matrix = green(self._on_contact[:, None] - self._on_contact[None, :], self.length, line.contact)[0]
        contact[:, :n], contact[:, n + m : n + m + a], contact[:, -1] = matrix[:, :n], matrix[:, n:], 1.0

        system = np.zeros((size, size))
        system[:n] = contact[:n] - carrier[:n]
        system[n : n + m], system[n + m : n + m + a] = carrier[n:], contact[n:]
        at = np.arange(n + m + a)
        system[at, at] += 1.0 / np.concatenate((k[drop], k[mast], k[arm]))
        system[-2, :n], system[-2, n : n + m] = -1.0, 1.0
        system[-1, :n], system[-1, n + m : n + m + a] = 1.0, 1.0
        self._system = system
        # all rows are written for the total tensions F: what the tensions at rest do goes to the right side
        total = np.zeros(size)
        total[:n] = self._rest_force
        self._rest_side = system @ total
        self._rest_side[:n] += rest_stretch[drop] - self._rest_force / k[drop]
        self._one_sided = np.arange(size) < n

    def push(self, position: float, force: float) -> Deflection:
        """Solve for a force (N, up) at a track position (m). Raises StaticsError without an equilibrium."""
        n, wire = self._rest_force.size, self.rest.line.contact
        rhs = self._rest_side.copy()
        rhs[self._on_contact_rows] -= force * green(self._on_contact - position, self.length, wire)[0]
        rhs[-1] -= force
        taut = np.ones(rhs.size, dtype=np.bool_)
        taut[:n] = self._rest_taut
        x, _ = one_sided(self._system, rhs, self._one_sided, taut)
        load = np.append(x[self._on_contact_rows], force)
        load[:n] -= self._rest_force
        at = np.append(self._on_contact, position % self.length)
        beam = PeriodicBeam(wire, self.length, at, load, float(x[-1]))
        return Deflection(force, float(beam.value(np.array(position))), x[:n], beam)

    def uplift(self, positions: Array, force: float) -> Array:
        """Deflection of the contact wire under a force (N, up) at each of the track positions (m), m."""
        return np.array([self.push(float(at), force).uplift for at in positions])

    def stiffness(self, positions: Array, force: float) -> Array:
        """Force (N, up) over its deflection, at each of the track positions (m), N/m."""
        return force / self.uplift(positions, force)
