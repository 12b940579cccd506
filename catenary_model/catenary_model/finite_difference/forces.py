"""What droppers, masts, arms, masses, the contact and others do to the wires in one explicit step.

A place on the wire reads the field and gives its force with the weights of `grid.weights`.
"""

from __future__ import annotations

import numpy as np

from catenary_model import sites
from catenary_model.cycle import track_position
from catenary_model.finite_difference.layout import NOW, Constants, State
from catenary_model.layout import (
    CARRIER,
    CONTACT,
    CONTACT_WIRE,
    ELEMENT,
    ELONGATION,
    FADE,
    FORCE,
    INERTIA,
    KNOWN,
    LISTED,
    LOCAL,
    NEXT_CHANGE,
    ON_CONTACT,
    ONE_SIDED,
    PLACE,
    PRESS,
    PUSHED,
    ROW,
    SITES,
    SLACK,
    SLOT,
    SOFT,
    STIFFNESS,
    STRETCH,
    Array,
    Ints,
    X,
)
from phil_base.kernels import njit

ALONE = np.array([[0.0], [-1.0]])
"""Pantographs that are sites: the one at x = 0. Companions press on nodes."""


@njit(cache=True, fastmath=False)
def _place(at: float, i: int, element: Ints, psi: Array) -> float:
    """Node behind and weights (Keys) of a place in spacings from node 0; return the share of the spacing."""
    e = int(at)
    x = at - e
    x2 = x * x
    x3 = x2 * x
    element[i] = e
    psi[0, i] = x2 - 0.5 * (x + x3)
    psi[1, i] = 1.0 - 2.5 * x2 + 1.5 * x3
    psi[2, i] = 0.5 * x + 2.0 * x2 - 1.5 * x3
    psi[3, i] = 0.5 * (x3 - x2)
    return x


@njit(cache=True, fastmath=False)
def _read(w: Array, e: int, psi: Array, i: int) -> float:
    return psi[0, i] * w[e - 1] + psi[1, i] * w[e] + psi[2, i] * w[e + 1] + psi[3, i] * w[e + 2]


@njit(cache=True, fastmath=False)
def _give(w: Array, e: int, psi: Array, i: int, amount: float) -> None:
    w[e - 1] += psi[0, i] * amount
    w[e] += psi[1, i] * amount
    w[e + 1] += psi[2, i] * amount
    w[e + 2] += psi[3, i] * amount


@njit(cache=True, fastmath=False)
def gather(c: Constants, s: State) -> None:
    """Find the forces of masts, arms (3.2) and droppers (3.3) at the present instant: what they do beyond rest, N."""
    zeta = track_position(c, s)
    if s.counter[LISTED] == 0 or zeta >= s.contact[NEXT_CHANGE]:
        sites.enlist(c, s, zeta, ALONE, s.here)
    here, where, psi, site = s.here, s.where, s.psi, c.site
    carrier, contact = s.w[s.counter[NOW], 0], s.w[s.counter[NOW], 1]
    per, per_fading = 1.0 / c.real.dx, 1.0 / max(c.real.fading, 1e-9)
    samples = c.local.shape[1] - 1
    slack = 0
    here[PLACE, s.counter[CONTACT]] = zeta
    for i in range(s.counter[SITES]):
        row = where[ROW, i]
        x = here[PLACE, i] - zeta
        here[X, i] = x
        if row < 0:
            continue
        xi = _place((x + c.real.origin) * per, i, where[ELEMENT], psi)
        here[FADE, i] = max(0.0, min(1.0, min(c.real.ahead - x, x + c.real.behind) * per_fading))
        at = xi * samples
        m = int(at)
        at -= m
        lacking = 0.0
        if here[SOFT, i] > 0.0:
            lacking += abs(here[CARRIER, i]) * (c.local[0, m] + at * (c.local[0, m + 1] - c.local[0, m]))
            lacking += abs(here[CONTACT_WIRE, i]) * (c.local[1, m] + at * (c.local[1, m + 1] - c.local[1, m]))
        here[LOCAL, i] = lacking
        e = where[ELEMENT, i]
        stretch = 0.0
        if here[CARRIER, i] != 0.0:
            stretch += here[CARRIER, i] * _read(carrier, e, psi, i)
        if here[CONTACT_WIRE, i] != 0.0:
            stretch += here[CONTACT_WIRE, i] * _read(contact, e, psi, i)
        here[STRETCH, i] = stretch
        k, b = site[row, STIFFNESS], 0.0
        if site[row, ONE_SIDED] > 0.0:
            rest, weight = site[row, ELONGATION], site[row, FORCE]
            taut = rest >= 0.0 if site[row, ONE_SIDED] > 1.0 else rest + stretch + lacking * weight > 0.0
            if taut:
                b = min(k * rest, 0.0)  # taut at rest: k rest is the weight that it carries there
            else:
                k, b = 0.0, -weight
                slack += 1
            s.taut[where[SLOT, i]] = 1 if taut else 0
        here[PRESS, i] = here[FADE, i] * (k * stretch + b) / (1.0 + k * lacking)
    s.counter[SLACK] = slack


@njit(cache=True, fastmath=False)
def act(c: Constants, s: State, force: float) -> None:
    """Add all forces of the present instant to the new level; `force` is the contact force, N."""
    now = s.counter[NOW]
    slots = s.w.shape[0]
    new, old = s.w[(now + 1) % slots], s.w[now]
    here, where, psi, site = s.here, s.where, s.psi, c.site
    per, back = 1.0 / c.real.dx, c.real.origin - c.real.speed * c.real.ts
    half = c.carry.size // 2
    here[PRESS, s.counter[CONTACT]] = force
    for m in range(c.carry.size):
        new[1, c.whole.middle + half - m] += c.per_mass[1] * c.carry[m] * force
    if s.counter[PUSHED]:
        for wire in range(2):
            load = s.external[wire]
            for j in range(half, c.whole.stations - half):
                total = 0.0
                for m in range(c.carry.size):
                    total += c.carry[m] * load[j + m - half]
                new[wire, j] += c.per_mass[wire] * total
    for i in range(s.counter[SITES]):
        row = where[ROW, i]
        if row < 0:
            continue
        masses = site[row, INERTIA] > 0.0
        wire = 1 if site[row, ON_CONTACT] != 0.0 else 0
        if masses and s.particle[where[SLOT, i], KNOWN] == 0.0:
            known = s.particle[where[SLOT, i]]
            known[0] = known[1] = _read(old[wire], where[ELEMENT, i], psi, i)
            known[KNOWN] = 1.0
        _place((here[X, i] + back) * per, i, where[ELEMENT], psi)
        e = where[ELEMENT, i]
        p = here[PRESS, i]
        if p != 0.0:
            if here[CARRIER, i] != 0.0:
                _give(new[0], e, psi, i, -here[CARRIER, i] * p * c.per_mass[0])
            if here[CONTACT_WIRE, i] != 0.0:
                _give(new[1], e, psi, i, -here[CONTACT_WIRE, i] * p * c.per_mass[1])
    for i in range(s.counter[SITES]):
        row = where[ROW, i]
        if row < 0 or site[row, INERTIA] == 0.0:
            continue
        wire = 1 if site[row, ON_CONTACT] != 0.0 else 0
        e, y = where[ELEMENT, i], s.particle[where[SLOT, i]]
        own = psi[0, i] ** 2 + psi[1, i] ** 2 + psi[2, i] ** 2 + psi[3, i] ** 2
        heavy = here[FADE, i] * site[row, INERTIA] / (c.real.ts * c.real.ts)
        yields = own * c.per_mass[wire]
        free = _read(new[wire], e, psi, i)
        inertia = -heavy * (free - 2.0 * y[0] + y[1]) / (1.0 + heavy * yields)
        _give(new[wire], e, psi, i, inertia * c.per_mass[wire])
        y[1] = y[0]
        y[0] = free + yields * inertia
