"""Rides over the catenary-fixed line: what moves along it, step by step, compiled; and the record of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.cycle import soft_start_share
from catenary_model.reference import step
from catenary_model.reference import train as trains
from catenary_model.reference.links import Links
from catenary_model.reference.wires import Wires
from catenary_model.travel import motion
from phil_base.kernels import njit

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

T, ZETA, W, V, F, HEAD, SPEED = range(7)
"""Rows of the real record."""
SLACK, ITERATIONS = range(2)
"""Rows of the whole record."""


@dataclass(frozen=True)
class Ride:
    """Record of a ride, one entry a step: the state *after* it, at t = Ts, 2 Ts, ..."""

    t: Array
    """Time since the start, s, (steps,)."""
    zeta: Array
    """Track position of the contact point, m."""
    w: Array
    """Height of the contact wire there over its nominal height (static shape included), m."""
    v: Array
    """Rate of change of w along the ride, m/s."""
    F: Array
    """Contact force, N."""
    head: Array
    """Height of the pantograph's head, m; NaN where a force was given instead of a pantograph."""
    slack: Ints
    """Slack droppers of the whole mesh."""
    iterations: Ints
    """Solves of the step."""
    supports: Array
    """Track positions of the masts, m, (masts,)."""
    uplift: Array
    """Lift of the contact wire at the masts over its place at rest, m, (steps, masts)."""
    snapshot_t: Array
    """Times of the snapshots, s, (snapshots,)."""
    snapshots: Array
    """Heights of carrier and contact wire at the nodes, m, (snapshots, 2, nodes)."""
    speed: Array
    """Speed of the train, m/s, (steps,)."""

    def between(self, start: float, end: float) -> Flags:
        """Mark the steps in which the contact point was at or past start and before end (track positions, m)."""
        return (self.zeta >= start) & (self.zeta < end)


@njit(cache=True, fastmath=False)
def settle(w: Wires, c: Links, s: step.State, t: trains.Train, rides: bool, most: int, speed: float) -> None:
    """Bring slack droppers and contact forces of a step to agreement.

    If the train `rides` its heads find the forces; else they are given in `t.force`.
    """
    iterations = 0
    while True:
        step.respond(c, s)
        if rides:
            trains.push(t, s)
        iterations += 1
        first = step.recheck(c, s, t.force)
        if first < 0:
            break
        step.factor(c, s, first)
        if iterations >= most:
            s.counter[step.UNSETTLED] += 1
            break
    s.counter[step.ITERATIONS] = iterations
    step.take(w, c, s, t.force, speed)


@njit(cache=True, fastmath=False)
def run(
    w: Wires,
    c: Links,
    s: step.State,
    track: Array,
    travel: Array,
    static: Array,
    train: trains.Train,
    given: Array,
    support_element: Ints,
    support_psi: Array,
    real: Array,
    whole: Ints,
    uplift: Array,
    most: int,
) -> None:
    """Run as many steps as `whole` has columns; `track` is start of the mesh, h, start of the ride, Ts, ramp.

    `travel` is the table of the journey; place and speed of each instant are exact, not integrated along. `given` holds
    the forces of each step, (steps, contacts), or nothing: then the pantographs ride. The record goes into `real`,
    (contacts, rows, steps), `whole` and `uplift`.
    """
    start, h, origin, ts, ramp = track[0], track[1], track[2], track[3], track[4]
    rides = given.size == 0
    contacts = train.behind.size
    for i in range(whole.shape[1]):
        s.counter[step.STEP] += 1
        t = ts * s.counter[step.STEP]
        step.free_step(w, c, s)
        travelled, speed, _ = motion(travel, t)
        for p in range(contacts):
            step.place(c, s, p, static, origin + travelled - train.behind[p], speed, start, h)
        if rides:
            trains.begin(train, soft_start_share(t, ramp))
        else:
            for p in range(contacts):
                train.force[p] = given[i, p]
        settle(w, c, s, train, rides, most, speed)
        if rides:
            trains.finish(train)
        for p in range(contacts):
            point, row = s.point[p], real[p]
            row[T, i], row[ZETA, i], row[W, i] = t, point[step.ZETA], point[step.HEIGHT]
            row[V, i], row[F, i], row[SPEED, i] = point[step.VELOCITY], train.force[p], speed
            row[HEAD, i] = train.state.y[0, train.head[p]] if rides else np.nan
        whole[SLACK, i], whole[ITERATIONS, i] = s.counter[step.SLACK], s.counter[step.ITERATIONS]
        for j in range(support_element.size):
            e = support_element[j]
            lift = 0.0
            for r in range(2):
                lift += support_psi[j, r] * s.q[0, 2 + r, e] + support_psi[j, 2 + r] * s.q[0, 2 + r, e + 1]
            uplift[i, j] = lift
