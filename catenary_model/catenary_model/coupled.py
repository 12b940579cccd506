"""Cycles of the finite elements in compiled code: with a pantograph coupled within the step, or under a given force."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary_model import layout, pantograph, step
from catenary_model.cycle import soft_start_share
from catenary_model.layout import Constants, State
from phil_base.kernels import njit

Array = NDArray[np.float64]

W, V, F, TRACK, SLACK_DROPPERS = range(5)


@njit(cache=True, fastmath=False)
def note(s: State, force: float, row: Array) -> None:
    """Write one row of a record."""
    row[W] = s.point[layout.W_CAT]
    row[V] = s.point[layout.V_CAT]
    row[F] = force
    row[TRACK] = s.point[layout.ZETA]
    row[SLACK_DROPPERS] = s.counter[layout.SLACK]


@njit(cache=True, fastmath=False)
def run(
    c: Constants,
    s: State,
    pc: pantograph.Constants,
    ps: pantograph.State,
    soft_start: float,
    held: float,
    out: Array,
) -> None:
    """Ride as many cycles as `out` has rows; the uplift comes up within the first soft_start s as (1 - cos)/2.

    `held` is a contact force (N) on both sides in place of the contact, or NaN.
    """
    n = pc.uplift.size
    own = pc.real[pantograph.BETA] * pc.real[pantograph.TS] ** 2 * pc.inverse[n - 1, n - 1]
    local = c.real.compliance
    if np.isnan(held):
        s.contact[layout.K_CONTACT] = 1.0 / (pc.real[pantograph.CONTACT_COMPLIANCE] + own + local)
    else:
        s.contact[layout.GIVEN] = held
    force = 0.0
    for k in range(out.shape[0]):
        s.counter[layout.ITERATIONS] = 0
        for _ in range(c.whole.substeps):
            t = c.real.ts * (s.counter[layout.STEPS] + 1)
            share = soft_start_share(t, soft_start)
            head = pantograph.free(pc, ps, share)
            zeta = c.real.start + c.real.speed * t
            step.static_at(c, zeta, s.scratch)
            s.contact[layout.HEAD] = head - s.scratch[0]
            step.substep(c, s)
            force = step.contact_force(s)
            pantograph.finish(pc, ps, force)
        step.observe(c, s, force)
        note(s, force, out[k])
    s.contact[layout.K_CONTACT] = 0.0
    s.contact[layout.LAST_FORCE] = force


def push_by(advance: Any) -> Any:
    """Make the compiled `push(c, s, force, out)` of a scheme: one cycle a given force (N), of its own `advance`."""

    @njit(cache=True, fastmath=False)
    def push(c: Any, s: Any, force: Array, out: Array) -> None:
        for k in range(force.size):
            advance(c, s, force[k])
            note(s, force[k], out[k])

    return push


push = push_by(step.advance)
