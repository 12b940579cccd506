"""Droppers, masts, steady arms, their masses and the contact: few forces that couple the wires (Schur complement).

Site i is a spring on the elongation g_i . q, g from the shape functions at its place in the moving mesh. With the
wires' own answer a_0 = K_DM^-1 r and the compliance of one step between two sites,

    e_i = g_i . (q_p + beta Ts^2 a_0),      C_ij = beta Ts^2 g_i^T K_DM^-1 g_j,
    p_i = fade_i (k_i (e_i - sum_j C_ij p_j) + b_i),                                                      (3.2, 3.3)

is a small banded system for the forces p, in place of K(t, Q) of (3.17), which is never formed. A slack dropper has
k = 0 and b = -F_s, its lost static force. Its state belongs to the step: after the small solve every dropper is asked,
and where one disagrees only the small system is solved again.
A mass m that sits on the wire takes place, velocity and acceleration over from the wire at the beginning of the step
and is then integrated by the same Newmark scheme, a spring m/(beta Ts^2) towards its predicted place; at v = 0 that is
a mass in M. The pantograph, if it is coupled, is a spring that can only push, and so are its companions.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from catenary_model.companions import AT, SEAT, SPRING
from catenary_model.companions import HEAD as RIDER_HEAD
from catenary_model.companions import TOUCH as RIDER_TOUCH
from catenary_model.layout import (
    CARRIER,
    CONTACT,
    CONTACT_WIRE,
    DROPPERS,
    ELEMENT,
    ELONGATION,
    FADE,
    FIRST_SITE,
    FORCE,
    FREE,
    GIVEN,
    HEAD,
    INERTIA,
    ITERATIONS,
    K_CONTACT,
    KNOWN,
    LAW_B,
    LAW_K,
    LISTED,
    LOCAL,
    LOW,
    NEXT_CHANGE,
    NEXT_SITE,
    ON_CARRIER,
    ON_CONTACT,
    ONE_SIDED,
    PLACE,
    POSITION,
    PRESS,
    ROW,
    SITES,
    SLACK,
    SLOT,
    SOFT,
    STIFFNESS,
    STRETCH,
    TOUCH,
    UNSETTLED,
    Array,
    Constants,
    Ints,
    State,
    X,
)
from catenary_model.wires import PAD
from phil_base.kernels import njit

# Inner functions get the arrays that they need, not the bundles: a call that is not inlined would copy these.


@njit(cache=True, fastmath=False)
def _seat(counter: Ints, here: Array, where: Ints, aside: Array, row: int, i: int) -> None:
    """Make a pantograph site i: row -1 is the one at x = 0, row -2 - r companion r."""
    if row == -1:
        counter[CONTACT] = i
    else:
        aside[-2 - row, SEAT] = i
    where[SLOT, i], where[ROW, i] = -1, row
    here[SOFT, i] = 0.0
    here[CARRIER, i], here[CONTACT_WIRE, i] = 0.0, -1.0


@njit(cache=True, fastmath=False)
def enlist(c: Constants, s: State, zeta: float, riders: Array, aside: Array) -> None:
    """Write the list of sites in the domain around track position zeta (m), by rising position, anew.

    ``riders`` are the pantographs among them, see `Constants.riders`; companions find their sites in ``aside``.
    """
    counter, here, where, site, taut = s.counter, s.here, s.where, c.site, s.taut
    period, n, ring = c.real.period, c.site.shape[0], s.taut.size
    left, right = zeta - c.real.behind, zeta + c.real.ahead
    i, droppers, rider = 0, 0, 0
    counter[LISTED] = 1
    s.contact[NEXT_CHANGE] = np.inf
    if n > 0:
        j = counter[FIRST_SITE]
        while (j // n) * period + site[j % n, POSITION] <= left:
            j += 1
        counter[FIRST_SITE] = j
        s.contact[NEXT_CHANGE] = (j // n) * period + site[j % n, POSITION] + c.real.behind
        while True:
            row = j % n
            at = (j // n) * period + site[row, POSITION]
            while rider < riders.shape[1] and at >= zeta + riders[0, rider]:
                _seat(counter, here, where, aside, int(riders[1, rider]), i)
                s.contact[NEXT_CHANGE] = min(s.contact[NEXT_CHANGE], at - riders[0, rider])
                rider += 1
                i += 1
            if at >= right:
                s.contact[NEXT_CHANGE] = min(s.contact[NEXT_CHANGE], at - c.real.ahead)
                break
            slot = j % ring
            if j >= counter[NEXT_SITE]:
                taut[slot] = 1 if site[row, ELONGATION] >= 0.0 else 0
                s.particle[slot, KNOWN] = 0.0
                counter[NEXT_SITE] = j + 1
            where[SLOT, i], where[ROW, i] = slot, row
            here[CARRIER, i], here[CONTACT_WIRE, i] = site[row, ON_CARRIER], site[row, ON_CONTACT]
            here[PLACE, i] = at
            here[SOFT, i] = 0.0 if site[row, INERTIA] > 0.0 else 1.0
            if site[row, ONE_SIDED] > 0.0:
                droppers += 1
            i += 1
            j += 1
    while rider < riders.shape[1]:
        _seat(counter, here, where, aside, int(riders[1, rider]), i)
        rider += 1
        i += 1
    counter[DROPPERS], counter[SITES] = droppers, i


@njit(cache=True, fastmath=False)
def _place(real: Any, last: int, local: Array, zeta: float, here: Array, element: Ints, psi: Array) -> None:
    """Put all sites where they are now, x = zeta_i - zeta (3.5): element, shape functions, fade, missing compliance."""
    h, per_h, behind, ahead = real.h, 1.0 / real.h, real.behind, real.ahead
    per_fading = 1.0 / max(real.fading, 1e-9)
    samples = local.shape[1] - 1
    x, fade, missing = here[X], here[FADE], here[LOCAL]
    place, on_carrier, on_contact, soft = here[PLACE], here[CARRIER], here[CONTACT_WIRE], here[SOFT]
    for i in range(element.size):
        x[i] = place[i] - zeta
        at = (x[i] + behind) * per_h
        e = min(max(int(at), 0), last)
        element[i] = e
        xi = at - e
        xi2 = xi * xi
        xi3 = xi2 * xi
        psi[0, i] = 1.0 - 3.0 * xi2 + 2.0 * xi3
        psi[1, i] = h * (xi - 2.0 * xi2 + xi3)
        psi[2, i] = 3.0 * xi2 - 2.0 * xi3
        psi[3, i] = h * (xi3 - xi2)
        fade[i] = min(1.0, min(ahead - x[i], x[i] + behind) * per_fading)
        r = xi * samples
        m = min(max(int(r), 0), samples - 1)
        r -= m
        carrier = local[0, m] + r * (local[0, m + 1] - local[0, m])
        contact = local[1, m] + r * (local[1, m + 1] - local[1, m])
        missing[i] = soft[i] * (abs(on_carrier[i]) * carrier + abs(on_contact[i]) * contact)


@njit(cache=True, fastmath=False)
def collect(c: Constants, s: State, zeta: float) -> None:
    """List the sites of the domain around track position zeta (m), the contact point among them."""
    if s.counter[LISTED] == 0 or zeta >= s.contact[NEXT_CHANGE]:
        enlist(c, s, zeta, c.riders, s.aside)
    contact, n = s.counter[CONTACT], s.counter[SITES]
    s.here[PLACE, contact] = zeta
    for r in range(c.beside.shape[0]):
        s.here[PLACE, int(s.aside[r, SEAT])] = zeta + c.beside[r, AT]
    _place(c.real, c.whole.stations - 2, c.local, zeta, s.here[:, :n], s.where[ELEMENT, :n], s.psi)
    s.here[FADE, contact] = 1.0
    for r in range(c.beside.shape[0]):
        s.here[FADE, int(s.aside[r, SEAT])] = 1.0


@njit(cache=True, fastmath=False)
def elongation(i: int, here: Array, where: Ints, psi: Array, q: Array) -> float:
    """Elongation g . q of site i, m; q (wire, w or phi, station with padding)."""
    e = where[ELEMENT, i] + PAD
    p0, p1, p2, p3 = psi[0, i], psi[1, i], psi[2, i], psi[3, i]
    carrier = p0 * q[0, 0, e] + p1 * q[0, 1, e] + p2 * q[0, 0, e + 1] + p3 * q[0, 1, e + 1]
    contact = p0 * q[1, 0, e] + p1 * q[1, 1, e] + p2 * q[1, 0, e + 1] + p3 * q[1, 1, e + 1]
    return here[CARRIER, i] * carrier + here[CONTACT_WIRE, i] * contact


@njit(cache=True, fastmath=False)
def _row(station: int, first: int, last: int) -> int:
    """Row of `Constants.green` for a station."""
    return station if station < first else first if station < last else station - last + first + 1


@njit(cache=True, fastmath=False)
def _between(g: Array, near: int, far: int, d: int, psi: Array, i: int, j: int, wire: int) -> float:
    """Acceleration of one wire at site i for a unit force at site j, d - reach elements behind it, 1/kg."""
    p0, p1, p2, p3 = psi[0, i], psi[1, i], psi[2, i], psi[3, i]
    total = 0.0
    for kind in range(2):
        a = p0 * g[near, wire, kind, 0, d] + p1 * g[near, wire, kind, 1, d]
        a += p2 * g[near, wire, kind, 0, d + 1] + p3 * g[near, wire, kind, 1, d + 1]
        b = p0 * g[far, wire, kind, 0, d - 1] + p1 * g[far, wire, kind, 1, d - 1]
        b += p2 * g[far, wire, kind, 0, d] + p3 * g[far, wire, kind, 1, d]
        total += psi[kind, j] * a + psi[2 + kind, j] * b
    return total


@njit(cache=True, fastmath=False)
def compliances(c: Constants, s: State) -> None:
    """Fill C_ij for all sites that feel each other within one step."""
    g, psi, here, where, C = c.green, s.psi, s.here, s.where, s.compliance
    reach, first, last, own = c.whole.reach, c.whole.green_first, c.whole.green_last, C.shape[1] // 2
    scale = c.real.beta * c.real.ts * c.real.ts
    for i in range(s.counter[SITES]):
        e = where[ELEMENT, i]
        near, far = _row(e, first, last), _row(e + 1, first, last)
        low = i
        for j in range(i, -1, -1):
            d = e - where[ELEMENT, j]
            if d >= reach:
                break
            low = j
            near_j, far_j = _row(e - d, first, last), _row(e - d + 1, first, last)
            up, down = 0.0, 0.0
            for wire in range(2):
                sign = here[CONTACT_WIRE, i] * here[CONTACT_WIRE, j] if wire else here[CARRIER, i] * here[CARRIER, j]
                if sign != 0.0:
                    up += sign * _between(g, near_j, far_j, reach + d, psi, i, j, wire)
                    if j < i:
                        down += sign * _between(g, near, far, reach - d, psi, j, i, wire)
            C[i, own + j - i] = scale * up
            if j < i:
                C[j, own + i - j] = scale * down
        where[LOW, i] = low


@njit(cache=True, fastmath=False)
def _laws(c: Constants, s: State) -> None:
    """Force law k e + b of every site for the present slack state (3.2, 3.3)."""
    beta, ts = c.real.beta, c.real.ts
    for i in range(s.counter[SITES]):
        row = s.where[ROW, i]
        if row < -1:
            k = c.beside[-2 - row, SPRING] * s.aside[-2 - row, RIDER_TOUCH]
            b = k * s.aside[-2 - row, RIDER_HEAD]
        elif row < 0:
            k, b = s.contact[K_CONTACT], s.contact[K_CONTACT] * s.contact[HEAD]
            if k == 0.0:
                b = s.contact[GIVEN]
            elif s.contact[TOUCH] == 0.0:
                k, b = 0.0, 0.0
        elif c.site[row, ONE_SIDED] > 0.0:
            k, b = 0.0, -c.site[row, FORCE]
            if s.taut[s.where[SLOT, i]] == 1:
                k = c.site[row, STIFFNESS]
                b += k * c.site[row, ELONGATION]
        else:
            k, b = c.site[row, STIFFNESS], 0.0
            if c.site[row, INERTIA] > 0.0:
                slot = s.where[SLOT, i]
                per_place = s.particle[slot, KNOWN] * c.site[row, INERTIA] / (beta * ts * ts)
                y = s.particle[slot]
                b = -per_place * (y[0] + ts * y[1] + ts * ts * (0.5 - beta) * y[2])
                k += per_place
        share = s.here[FADE, i] / (1.0 + k * s.here[LOCAL, i])
        s.here[LAW_K, i], s.here[LAW_B, i] = share * k, share * b


@njit(cache=True, fastmath=False)
def _forces(n: int, here: Array, low: Ints, C: Array, A: Array) -> None:
    """Solve the small system for the forces p and the elongations that they leave; C, A: (sites, band)."""
    p, own = here[PRESS], C.shape[1] // 2
    for i in range(n):
        k = here[LAW_K, i]
        y = k * here[FREE, i] + here[LAW_B, i]
        end = i + 1
        while end < n and low[end] <= i:
            end += 1
        for j in range(low[i] - i, end - i):
            A[i, own + j] = k * C[i, own + j]
        A[i, own] += 1.0
        if k != 0.0:
            for j in range(low[i], i):
                f = A[i, own + j - i] * A[j, own]  # the diagonal holds inverse pivots
                m = j + 1
                while m < n and low[m] <= j:
                    A[i, own + m - i] -= f * A[j, own + m - j]
                    m += 1
                y -= f * p[j]
        A[i, own] = 1.0 / A[i, own]
        p[i] = y
    for i in range(n - 1, -1, -1):
        y = p[i]
        j = i + 1
        while j < n and low[j] <= i:
            y -= A[i, own + j - i] * p[j]
            j += 1
        p[i] = y * A[i, own]
    for i in range(n):
        stretch = here[FREE, i]
        for j in range(low[i], i + 1):
            stretch -= C[i, own + j - i] * p[j]
        j = i + 1
        while j < n and low[j] <= i:
            stretch -= C[i, own + j - i] * p[j]
            j += 1
        here[STRETCH, i] = stretch


@njit(cache=True, fastmath=False)
def _consistent(c: Constants, s: State) -> bool:
    """Flip every dropper, and the contact, whose state contradicts the solution; tell whether there was none."""
    good = True
    slack = 0
    for i in range(s.counter[SITES]):
        row = s.where[ROW, i]
        if row < -1:
            touch = 1.0 if s.aside[-2 - row, RIDER_HEAD] + s.here[STRETCH, i] > 0.0 else 0.0
            good = good and touch == s.aside[-2 - row, RIDER_TOUCH]
            s.aside[-2 - row, RIDER_TOUCH] = touch
        elif row < 0:
            if s.contact[K_CONTACT] > 0.0:
                touch = 1.0 if s.contact[HEAD] + s.here[STRETCH, i] > 0.0 else 0.0
                good = good and touch == s.contact[TOUCH]
                s.contact[TOUCH] = touch
        elif c.site[row, ONE_SIDED] == 1.0:
            stretch = c.site[row, ELONGATION] + s.here[STRETCH, i] + s.here[LOCAL, i] * c.site[row, FORCE]
            taut = 1 if stretch > 0.0 else 0
            slot = s.where[SLOT, i]
            good = good and taut == s.taut[slot]
            s.taut[slot] = taut
            slack += 1 - taut
    s.counter[SLACK] = slack
    return good


@njit(cache=True, fastmath=False)
def settle(c: Constants, s: State) -> None:
    """Find the forces of all sites, slack states consistent (3.17), for predicted q and the wires' own q''."""
    scale = c.real.beta * c.real.ts * c.real.ts
    q, a = s.q[0], s.q[2]
    for i in range(s.counter[SITES]):
        s.here[FREE, i] = elongation(i, s.here, s.where, s.psi, q) + scale * elongation(i, s.here, s.where, s.psi, a)
    iterations = 0
    while True:
        _laws(c, s)
        _forces(s.counter[SITES], s.here, s.where[LOW], s.compliance, s.system)
        iterations += 1
        if _consistent(c, s):
            break
        if iterations >= c.whole.max_iterations:
            s.counter[UNSETTLED] += 1
            break
    s.counter[ITERATIONS] = max(s.counter[ITERATIONS], iterations)


@njit(cache=True, fastmath=False)
def press(pivot: Array, s: State) -> None:
    """Put the forces of all sites on the wires' right side, -G g p."""
    r, here, psi = s.rhs, s.here, s.psi
    for i in range(s.counter[SITES]):
        e = s.where[ELEMENT, i]
        for wire in range(2):
            p = -here[PRESS, i] * (here[CONTACT_WIRE, i] if wire else here[CARRIER, i])
            force, torque = p * psi[0, i], p * psi[1, i]
            r[wire, 0, e] += pivot[wire, 0, e] * force + pivot[wire, 1, e] * torque
            r[wire, 1, e] += pivot[wire, 2, e] * force + pivot[wire, 3, e] * torque
            force, torque = p * psi[2, i], p * psi[3, i]
            r[wire, 0, e + 1] += pivot[wire, 0, e + 1] * force + pivot[wire, 1, e + 1] * torque
            r[wire, 1, e + 1] += pivot[wire, 2, e + 1] * force + pivot[wire, 3, e + 1] * torque


@njit(cache=True, fastmath=False)
def move_masses(c: Constants, s: State) -> None:
    """Note place, velocity and acceleration of the masses, which move through the mesh with -v and along the wire."""
    h, v = c.real.h, c.real.speed
    for i in range(s.counter[SITES]):
        row = s.where[ROW, i]
        if row < 0 or c.site[row, INERTIA] == 0.0:
            continue
        e = s.where[ELEMENT, i]
        xi = (s.here[X, i] + c.real.behind) / h - e
        wire = 1 if c.site[row, ON_CONTACT] != 0.0 else 0
        slope = (6.0 * (xi * xi - xi) / h, 1.0 - 4.0 * xi + 3.0 * xi * xi)
        slope_2 = (-slope[0], 3.0 * xi * xi - 2.0 * xi)
        bend = ((12.0 * xi - 6.0) / (h * h), (6.0 * xi - 4.0) / h)
        bend_2 = (-bend[0], (6.0 * xi - 2.0) / h)
        y, rate, rate_2 = 0.0, 0.0, 0.0
        for kind in range(2):
            a, b = s.q[:, wire, kind, e + PAD], s.q[:, wire, kind, e + 1 + PAD]
            y += s.psi[kind, i] * a[0] + s.psi[2 + kind, i] * b[0]
            rate += s.psi[kind, i] * a[1] + s.psi[2 + kind, i] * b[1] - v * (slope[kind] * a[0] + slope_2[kind] * b[0])
            rate_2 += s.psi[kind, i] * a[2] + s.psi[2 + kind, i] * b[2]
            rate_2 -= 2.0 * v * (slope[kind] * a[1] + slope_2[kind] * b[1])
            rate_2 += v * v * (bend[kind] * a[0] + bend_2[kind] * b[0])
        particle = s.particle[s.where[SLOT, i]]
        particle[0], particle[1], particle[2], particle[KNOWN] = y, rate, rate_2, 1.0


def most_at_once(position: Array, period: float, length: float) -> int:
    """Most sites, at these positions (m) in every period, within any stretch of this length (m)."""
    if position.size == 0:
        return 0
    copies = int(np.ceil(length / period)) + 2
    every = (position[None, :] + period * np.arange(copies)[:, None]).ravel()
    return int(max(np.searchsorted(every, every[: position.size] + length, side="right") - np.arange(position.size)))
