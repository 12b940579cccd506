"""One step of the moving catenary by finite differences, compiled and explicit: no solve, no iteration.

Present is the instant n; level n + 1 of the deviation is computed as soon as the contact force of instant n is known:

    w(n+1) = interior scheme of w(n), w(n-1)  +  dt^2/(rhoA dx) (forces of instant n, carried on by v dt)

So velocity and acceleration of instant n are centred differences, of second order, and contain the present force. The
forces of droppers, masts and arms follow from w(n) alone, their slack state with them. What stands on the wire moves
back by v dt in the step, and so does its force: it is read at its place of instant n and given to its place of n + 1.
A mass is the exception: its inertia belongs to w(n+1) and is found in closed form, mass by mass. Last, the boundary
stencils complete the level at either end.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from catenary_model import companions
from catenary_model.cycle import cycles, height_of, track_position
from catenary_model.finite_difference.forces import act, gather
from catenary_model.finite_difference.layout import NOW, Constants, ConstantsTogether, State, StateTogether
from catenary_model.finite_difference.wires import close, propagate
from catenary_model.layout import A_CAT, F_CAT, ITERATIONS, STEPS, V_CAT, W_CAT, ZETA
from catenary_model.step import hold
from phil_base.kernels import njit


@njit(cache=True, fastmath=False)
def arrive(c: Constants, s: State) -> None:
    """Make the level n + 1 the present one; its contact force is not known yet, and nothing is iterated."""
    s.counter[ITERATIONS] = 1
    s.counter[NOW] = (s.counter[NOW] + 1) % s.w.shape[0]
    s.counter[STEPS] += 1


@njit(cache=True, fastmath=False)
def leave(c: Constants, s: State, force: float) -> None:
    """Compute level n + 1 with the contact force (N) of the present instant."""
    now, nodes, half = s.counter[NOW], c.whole.stations, c.carry.size // 2
    gather(c, s)
    for wire in range(2):
        propagate(c.inner, half, c.reach[wire], nodes, s.w, now, wire, s.between)
    act(c, s, force)
    for wire in range(2):
        close(c.edge, c.reach[wire], nodes, s.w, now, wire, s.ends)


@njit(cache=True, fastmath=False)
def arrive_together(c: Any, s: Any) -> None:
    """Do as `arrive`; the companions find their forces."""
    arrive(c, s)
    t, w = c.real.ts * s.counter[STEPS], s.w[s.counter[NOW], 1]
    companions.lift(c.beside, s.aside, c.static, c.real.period, t, track_position(c, s))
    companions.meet(c.beside, s.aside, w, c.real.compliance, t, c.real.ts)


@njit(cache=True, fastmath=False)
def leave_together(c: Any, s: Any, force: float) -> None:
    """Do as `leave`, with the forces of the companions."""
    now, nodes, half = s.counter[NOW], c.whole.stations, c.carry.size // 2
    gather(c, s)
    for wire in range(2):
        propagate(c.inner, half, c.reach[wire], nodes, s.w, now, wire, s.between)
    new = s.w[(now + 1) % s.w.shape[0], 1]
    companions.give(c.beside, s.aside, new, c.carry, c.per_mass[1])
    act(c, s, force)
    for wire in range(2):
        close(c.edge, c.reach[wire], nodes, s.w, now, wire, s.ends)


@njit(cache=True, fastmath=False)
def height(c: Constants, s: State, force: float) -> float:
    """Displacement of the contact point under a contact force (N) at the present instant, m."""
    return height_of(c, s, s.w[s.counter[NOW], 1, c.whole.middle], force)


@njit(cache=True, fastmath=False)
def observe(c: Constants, s: State, f_cat: float) -> None:
    """Fill `point` and `segment` (3.41) for the present instant, whose new level is already there."""
    zeta = track_position(c, s)
    slots, now = s.w.shape[0], s.counter[NOW]
    before, old, new = s.w[(now - 1) % slots, 1], s.w[now, 1], s.w[(now + 1) % slots, 1]
    seg, v, ts, h = s.segment, c.real.speed, c.real.ts, c.real.dx * c.whole.per_element
    stations, taps = seg.shape[1] // 2, c.project.shape[1]
    middle, n = stations // 2, c.whole.middle
    rate, rate_2 = 0.5 / ts, 1.0 / (ts * ts)
    samples, per = c.rest.shape[0] - 1, (c.rest.shape[0] - 1) / c.real.period
    at = (zeta - middle * h) * per
    at -= samples * np.floor(at / samples)
    for j in range(stations):
        first = n + (j - middle) * c.whole.per_element - taps // 2
        i = min(int(at), samples - 1)
        r = at - i
        for kind in range(2):
            a, b, d = 0.0, 0.0, 0.0
            for m in range(taps):
                weight = c.project[kind, m]
                a += weight * before[first + m]
                b += weight * old[first + m]
                d += weight * new[first + m]
            k = 3 * kind
            seg[0, 2 * j + kind] = c.rest[i, k] + r * (c.rest[i + 1, k] - c.rest[i, k]) + b
            slope = c.rest[i, k + 1] + r * (c.rest[i + 1, k + 1] - c.rest[i, k + 1])
            seg[1, 2 * j + kind] = v * slope + rate * (d - a)
            bend = c.rest[i, k + 2] + r * (c.rest[i + 1, k + 2] - c.rest[i, k + 2])
            seg[2, 2 * j + kind] = v * v * bend + rate_2 * (d - 2.0 * b + a)
        at += h * per
        if at >= samples:
            at -= samples
    hold(c.segment, seg, f_cat)
    at = zeta / c.real.period
    at = (at - np.floor(at)) * samples
    i = min(int(at), samples - 1)
    r = at - i
    local = c.real.compliance
    s.point[W_CAT] = c.static[i, 0] + r * (c.static[i + 1, 0] - c.static[i, 0]) + old[n] + local * f_cat
    s.point[V_CAT] = v * (c.static[i, 1] + r * (c.static[i + 1, 1] - c.static[i, 1])) + rate * (new[n] - before[n])
    s.point[V_CAT] += local * (f_cat - s.point[F_CAT]) / (ts * c.whole.substeps)
    s.point[A_CAT] = v * v * (c.static[i, 2] + r * (c.static[i + 1, 2] - c.static[i, 2]))
    s.point[A_CAT] += rate_2 * (new[n] - 2.0 * old[n] + before[n])
    s.point[F_CAT] = f_cat
    s.point[ZETA] = zeta


@njit(cache=True, fastmath=False)
def start(c: Constants, s: State) -> None:
    """List the sites for the present instant and observe it, at rest."""
    leave(c, s, 0.0)
    observe(c, s, 0.0)


advance, cycle = cycles(Constants, State, arrive, height, leave, observe)
advance_together, cycle_together = cycles(
    ConstantsTogether, StateTogether, arrive_together, height, leave_together, observe
)
