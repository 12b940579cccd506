"""One step of the moving catenary, compiled (thesis 3.1.3), with the slack state consistent.

What is integrated is the deviation q from the static equilibrium (see `model`), by Newmark's method with everything at
the new instant, droppers and masts included:

    K_DM q'' = F - D [q' + Ts (1 - gamma) q''] - K [q + Ts q' + Ts^2 (1/2 - beta) q'']      (3.21) to (3.23)

`wires` answers for the two wires on their own with constant factors, `sites` for the few forces that couple them; with
these on the right side the wires are solved once more. A cycle is one or several such steps. No allocation, no LAPACK.
"""

from __future__ import annotations

import numpy as np

from catenary_model import companions, sites, wires
from catenary_model.cycle import cycles, height_of, track_position
from catenary_model.layout import (
    A_CAT,
    CONTACT,
    F_CAT,
    PRESS,
    PUSHED,
    STEPS,
    V_CAT,
    W_CAT,
    ZETA,
    Array,
    Constants,
    State,
)
from catenary_model.wires import PAD
from phil_base.kernels import njit


@njit(cache=True, fastmath=False)
def static_at(c: Constants, zeta: float, out: Array) -> None:
    """Write w, w', w'', phi, phi', phi'' of the static contact wire at track position zeta (m) into out, (6,)."""
    period = c.real.period
    at = (zeta / period - np.floor(zeta / period)) * (c.static.shape[0] - 1)
    i = min(int(at), c.static.shape[0] - 2)
    r = at - i
    for j in range(6):
        out[j] = c.static[i, j] + r * (c.static[i + 1, j] - c.static[i, j])


@njit(cache=True, fastmath=False)
def hold(model: Array, seg: Array, f_cat: float) -> None:
    """Fill in f_held = M q'' + D q' + K q - b f_cat (3.41); model (3, n, 6) holds M, D, K, seg (4, n) all four."""
    n = model.shape[1]
    for i in range(n):
        total = 0.0
        o = i - (i & 1) - 2
        for j in range(max(0, -o), min(6, n - o)):
            total += model[0, i, j] * seg[2, o + j] + model[1, i, j] * seg[1, o + j] + model[2, i, j] * seg[0, o + j]
        seg[3, i] = total
    seg[3, 2 * (n // 4)] -= f_cat


@njit(cache=True, fastmath=False)
def observe(c: Constants, s: State, f_cat: float) -> None:
    """Fill `point` and `segment` for the present state: static shape plus deviation, and f_held (3.41)."""
    zeta = track_position(c, s)
    v, h = c.real.speed, c.real.h
    first, stations = c.whole.segment_first + PAD, c.whole.segment_stations
    middle = stations // 2
    seg, table, q = s.segment, c.static, s.q
    samples, per = table.shape[0] - 1, (c.static.shape[0] - 1) / c.real.period
    at = (zeta - middle * h) * per
    at -= samples * np.floor(at / samples)
    for j in range(stations):
        i = min(int(at), samples - 1)
        r = at - i
        rate = 1.0
        for d in range(3):
            w = table[i, d] + r * (table[i + 1, d] - table[i, d])
            phi = table[i, 3 + d] + r * (table[i + 1, 3 + d] - table[i, 3 + d])
            seg[d, 2 * j] = rate * w + q[d, 1, 0, first + j]
            seg[d, 2 * j + 1] = rate * phi + q[d, 1, 1, first + j]
            rate *= v
        at += h * per
        if at >= samples:
            at -= samples
    hold(c.segment, seg, f_cat)
    local = c.real.compliance
    s.point[W_CAT] = seg[0, 2 * middle] + local * f_cat
    s.point[V_CAT] = seg[1, 2 * middle] + local * (f_cat - s.point[F_CAT]) / (c.real.ts * c.whole.substeps)
    s.point[A_CAT] = seg[2, 2 * middle]
    s.point[F_CAT] = f_cat
    s.point[ZETA] = zeta


@njit(cache=True, fastmath=False)
def command_layers(gain: Array, q: Array, u: Array) -> None:
    """Forces and torques of the controlled layers, u = K_ABC x with x of the present instant (3.39), (2, 2, inputs)."""
    states, inputs = gain.shape[2], gain.shape[3]
    end_station = q.shape[3] - 1 - PAD
    per = states // 3
    for wire in range(2):
        for end in range(2):
            out = u[wire, end]
            for i in range(inputs):
                out[i] = 0.0
            for j in range(states):
                k = j % per
                x = q[j // per, wire, k % 2, end_station - k // 2 if end else PAD + k // 2]
                row = gain[wire, end, j]
                for i in range(inputs):
                    out[i] += row[i] * x


@njit(cache=True, fastmath=False)
def drive_layers(u: Array, pivot: Array, rhs: Array) -> None:
    """Add the forces and torques of the controlled layers, u of (3.31), to the right side."""
    last = rhs.shape[2] - 1
    for wire in range(2):
        for end in range(2):
            for node in range(u.shape[2] // 2):
                s = last - node if end else node
                force, torque = u[wire, end, 2 * node], u[wire, end, 2 * node + 1]
                rhs[wire, 0, s] += pivot[wire, 0, s] * force + pivot[wire, 1, s] * torque
                rhs[wire, 1, s] += pivot[wire, 2, s] * force + pivot[wire, 3, s] * torque


@njit(cache=True, fastmath=False)
def start(c: Constants, s: State) -> None:
    """List the sites for the present instant and observe it, as a start does."""
    sites.collect(c, s, track_position(c, s))
    sites.move_masses(c, s)
    observe(c, s, 0.0)


@njit(cache=True, fastmath=False)
def substep(c: Constants, s: State) -> None:
    """Integrate (3.18) by one step; `State.contact` says what acts at the contact point."""
    ts, beta, gamma = c.real.ts, c.real.beta, c.real.gamma
    s.counter[STEPS] += 1
    sites.collect(c, s, track_position(c, s))
    if c.beside.shape[0]:
        t = ts * s.counter[STEPS]
        companions.lift(c.beside, s.aside, c.static, c.real.period, t, track_position(c, s))
    command_layers(c.gain, s.q, s.layer)
    wires.predict(s.q, ts, beta, gamma)
    wires.load(c.inner, c.outer, s.q, s.rhs)
    if s.counter[PUSHED]:
        wires.push(c.pivot, s.external, s.rhs)
    drive_layers(s.layer, c.pivot, s.rhs)
    a = s.q[2]
    wires.solve(c.sweep, c.middle, s.rhs, a)
    sites.compliances(c, s)
    sites.settle(c, s)
    sites.press(c.pivot, s)
    wires.solve(c.sweep, c.middle, s.rhs, a)
    wires.correct(s.q, ts, beta, gamma)
    for r in range(c.beside.shape[0]):
        site = int(s.aside[r, companions.SEAT])
        deviation = -sites.elongation(site, s.here, s.where, s.psi, s.q[0])
        force, t = s.here[PRESS, site], ts * s.counter[STEPS]
        companions.press(c.beside[r], s.aside[r], force, deviation, c.real.compliance, t, ts)
    sites.move_masses(c, s)


@njit(cache=True, fastmath=False)
def height(c: Constants, s: State, force: float) -> float:
    """Displacement of the contact point under a contact force (N) at the present instant, m."""
    middle = c.whole.segment_first + PAD + c.whole.segment_stations // 2
    return height_of(c, s, s.q[0, 1, 0, middle], force)


@njit(cache=True, fastmath=False)
def stay(c: Constants, s: State, force: float) -> None:
    """Do nothing: the step is over as soon as its new instant is reached."""


advance, cycle = cycles(Constants, State, substep, height, stay, observe)


@njit(cache=True, fastmath=False)
def contact_force(s: State) -> float:
    """Contact force of the last integration step, N."""
    return s.here[PRESS, s.counter[CONTACT]]
