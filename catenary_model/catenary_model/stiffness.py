"""Static deflection of the line under one vertical force on the contact wire, and the stiffness that it feels.

The line is taken as endless: one force on a domain that repeats itself after so many periods of the line that the
force does not feel its images. What is solved for is the deviation from rest, as in `suspension`; the loads are the
force f at x, what the droppers pull beyond rest, and the reactions of the masts (k_m, on the carrier) and of the steady
arms (k_arm, on the contact wire). Droppers are one-sided springs:

    F_i = k_d e_i if e_i > 0, else 0,     e_i = e_i at rest + carrier's deviation - contact wire's deviation.

No mesh, no dynamics. A stiffness is f over the deflection under f; it depends on f as soon as droppers go slack.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from catenary_model.periodic_beam import PeriodicBeam
from catenary_model.statics import DROPPER, MAST, STEADY_ARM, Flags, Statics, StaticsError, one_sided
from catenary_model.stitched import CARRIER, StitchedCarrier
from catenary_model.suspension import Factor, Hung, LoadedWire, Suspension, incidence

Array = NDArray[np.float64]

_LEAST_LENGTH = 400.0
_LONGEST = 50e3
"""Length (m) to which a shorter domain is repeated at most."""
_KEPT_FACTORS = 4


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
        """Double the domain until half of it away from a push that lifts by u less than `tolerance` u is left.

        Raises StaticsError if nothing holds the contact wire, or if a push is felt too far away.
        """
        self.rest = rest
        held = (rest.sites.kind == DROPPER) | (rest.sites.kind == STEADY_ARM) & (rest.sites.stiffness > 0.0)
        if not held.any():
            raise StaticsError("the contact wire hangs from nothing: it has no static stiffness")
        period = rest.line.period
        probe = 0.5 * rest.line.spans[0].length
        copies = int(np.ceil(_LEAST_LENGTH / period))
        while True:
            self._build(copies)
            push = self.push(probe, 1.0)
            far = float(push.contact(np.array(probe + 0.5 * self.length)))
            if abs(far) <= tolerance * abs(push.uplift):
                return
            copies *= 2
            if copies * period > _LONGEST:
                raise StaticsError("the droppers, masts and arms are so soft that a push is felt too far away")

    def _build(self, copies: int) -> None:
        """Assemble the system for a domain of so many periods."""
        line, sites = self.rest.line, self.rest.sites
        used = sites.stiffness > 0.0  # neither arms without a stiffness nor point masses
        starts = line.period * np.arange(copies)[:, None]
        position = (starts + sites.position[used]).ravel()
        k, rest_force, rest_stretch = (
            np.tile(column[used], copies) for column in (sites.stiffness, sites.force, sites.elongation)
        )
        kind, stitch = (np.tile(column[used], copies) for column in (sites.kind, sites.stitch))
        self.length = copies * line.period
        # forces are numbered as the sites; what counts is what they change from rest
        drop, count = kind == DROPPER, kind.size
        self._drop, self.dropper_positions = np.flatnonzero(drop), position[drop]
        self._rest_force: Array = rest_force[drop]
        self._rest_stretch: Array = rest_stretch[drop]
        self._spring: Array = k[drop]
        every, sign = np.arange(count), np.where(drop, -1.0, 1.0)
        on_carrier, on_contact = np.flatnonzero(kind != STEADY_ARM), np.flatnonzero(kind != MAST)
        up = incidence(count, every, every, count)
        down = sparse.csr_array(sparse.diags_array(sign) @ up)
        none = np.zeros(on_carrier.size)
        carrier: Hung
        if line.stitched:
            further = len(line.spans) * np.repeat(np.arange(copies), int(used.sum()))
            hangs = np.where(stitch == CARRIER, CARRIER, stitch + further)[on_carrier]
            carrier = StitchedCarrier(line, copies, position[on_carrier], hangs, down[on_carrier], none, 0.0)
        else:
            carrier = LoadedWire(line.carrier, self.length, position[on_carrier], down[on_carrier], none, 0.0)
        contact = LoadedWire(
            line.contact, self.length, position[on_contact], up[on_contact], np.zeros(on_contact.size), 0.0
        )
        self._hung = hung = Suspension(carrier, contact)
        # what shortens a spring: contact wire minus carrier for a dropper, the height of its wire for masts and arms
        shorter = incidence(count, on_contact, np.arange(on_contact.size), on_contact.size) @ hung.contact_height
        held = incidence(count, on_carrier, np.arange(on_carrier.size), on_carrier.size) @ hung.carrier_height
        self._shorter = sparse.csr_array(shorter + sparse.diags_array(sign) @ held)
        self._sprung = sparse.csr_array(self._shorter + hung.force_rows(every, 1.0 / k))
        self._alone = hung.force_rows(every, np.ones(count))
        self._factors: dict[bytes, Factor] = {}

    def _factor(self, taut: Flags) -> Factor:
        """Factors for these taut droppers, kept for the next push."""
        key = taut.tobytes()
        if key not in self._factors:
            while len(self._factors) >= _KEPT_FACTORS:
                self._factors.pop(next(iter(self._factors)))
            slack = np.zeros(self._sprung.shape[0])
            slack[self._drop[~taut]] = 1.0
            laws = sparse.diags_array(1.0 - slack) @ self._sprung + sparse.diags_array(slack) @ self._alone
            self._factors[key] = self._hung.factor(sparse.csr_array(laws))
        return self._factors[key]

    def push(self, position: float, force: float) -> Deflection:
        """Solve for a force (N, up) at a track position (m). Raises StaticsError without an equilibrium."""
        wire, hung, rest, k_d = self._hung.contact, self._hung, self._rest_force, self._spring
        n, T, lam = wire.at.size, wire.wire.tension, wire.wire.bending_length
        at = float(np.fmod(position % self.length, self.length))
        after = int(np.searchsorted(wire.at, at, side="right"))
        k, following = (after - 1) % n, after % n
        left = at - wire.at[k] + (self.length if after == 0 else 0.0)
        right = wire.at[following] - at + (self.length if after == n else 0.0)
        share = left / (left + right)
        # between two places the force is to them its shares on the string and what it rounds
        wires = np.zeros(hung.side.size)
        string, behind, ahead = wires[-3 * n :].reshape(3, n)
        string[k] -= force * (1.0 - share)
        string[following] -= force * share
        behind[following] += force / (2.0 * T) * np.exp(-right / lam)
        ahead[k] += force / (2.0 * T) * np.exp(-left / lam)

        def try_out(taut: Flags) -> tuple[Array, Array]:
            """Solve for these taut droppers; return the solution, and tension or slack as an elongation (m)."""
            law = np.zeros(self._sprung.shape[0])
            law[self._drop] = np.where(taut, self._rest_stretch - rest / k_d, -rest)
            x = self._factor(taut).solve(np.concatenate((law, wires)))
            stretch = self._rest_stretch - (self._shorter @ x)[self._drop]
            return x, np.where(taut, (rest + x[self._drop]) / k_d, stretch)

        taut, x = one_sided(try_out, rest > 0.0)
        forces, _, own = hung.split(x)
        height = own[:n]
        here = (1.0 - share) * height[k] + share * height[following] + force * share * right / T
        beam = PeriodicBeam(
            wire.wire,
            self.length,
            np.insert(wire.at, after, at),
            np.insert(wire.by_force @ forces, after, force),
            np.insert(height, after, here),
            0.0,
        )
        tensions = np.where(taut, np.maximum(rest + forces[self._drop], 0.0), 0.0)
        return Deflection(force, float(beam.value(np.array(position))), tensions, beam)

    def uplift(self, positions: Array, force: float) -> Array:
        """Deflection of the contact wire under a force (N, up) at each of the track positions (m), m."""
        return np.array([self.push(float(at), force).uplift for at in positions])

    def stiffness(self, positions: Array, force: float) -> Array:
        """Force (N, up) over its deflection, at each of the track positions (m), N/m."""
        return force / self.uplift(positions, force)
