"""Rides over the catenary-fixed line: what moves along it, step by step, compiled; and the record of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import pantograph
from catenary_model.cycle import soft_start_share
from catenary_model.reference import step
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
def settle(
    w: Wires, c: Links, s: step.State, p: pantograph.Constants, head: float, given: float, most: int, speed: float
) -> float:
    """Bring slack droppers and contact force of a step to agreement; return the force (N).

    `head` is the pantograph's y_free (m), or NaN: then the force is `given` (N).
    """
    iterations = 0
    force = given
    while True:
        step.respond(c, s)
        if not np.isnan(head):
            force = pantograph.contact_force(p, head, s.point[step.W_FREE], s.point[step.COMPLIANCE])
        iterations += 1
        first = step.recheck(c, s, force)
        if first < 0:
            break
        step.factor(c, s, first)
        if iterations >= most:
            s.counter[step.UNSETTLED] += 1
            break
    s.counter[step.ITERATIONS] = iterations
    step.take(w, c, s, force, speed)
    return force


@njit(cache=True, fastmath=False)
def run(
    w: Wires,
    c: Links,
    s: step.State,
    track: Array,
    travel: Array,
    static: Array,
    p: pantograph.Constants,
    ps: pantograph.State,
    given: Array,
    support_element: Ints,
    support_psi: Array,
    real: Array,
    whole: Ints,
    uplift: Array,
    most: int,
) -> None:
    """Run as many steps as `real` has columns; `track` is start of the mesh, h, start of the ride, Ts, ramp.

    `travel` is the table of the journey; place and speed of each instant are exact, not integrated along. `given` holds
    a force per step, or nothing: then the pantograph rides. The record goes into `real`, `whole` and `uplift`.
    """
    start, h, origin, ts, ramp = track[0], track[1], track[2], track[3], track[4]
    for i in range(real.shape[1]):
        s.counter[step.STEP] += 1
        t = ts * s.counter[step.STEP]
        step.free_step(w, c, s)
        travelled, speed, _ = motion(travel, t)
        step.place(w, c, s, static, origin + travelled, speed, start, h)
        head, force = np.nan, 0.0
        if given.size > 0:
            force = given[i]
        else:
            head = pantograph.free(p, ps, soft_start_share(t, ramp))
        force = settle(w, c, s, p, head, force, most, speed)
        if given.size == 0:
            pantograph.finish(p, ps, force)
            head = ps.y[0, ps.y.shape[1] - 1]
        real[T, i], real[ZETA, i], real[W, i] = t, s.point[step.ZETA], s.point[step.HEIGHT]
        real[V, i], real[F, i], real[HEAD, i] = s.point[step.VELOCITY], force, head
        real[SPEED, i] = speed
        whole[SLACK, i], whole[ITERATIONS, i] = s.counter[step.SLACK], s.counter[step.ITERATIONS]
        for j in range(support_element.size):
            e = support_element[j]
            lift = 0.0
            for r in range(2):
                lift += support_psi[j, r] * s.q[0, 2 + r, e] + support_psi[j, 2 + r] * s.q[0, 2 + r, e + 1]
            uplift[i, j] = lift
