"""Cycles of the finite differences in compiled code: with a pantograph coupled within the step, or under a given force.

The scheme is explicit: the wire's height at the new instant is known before the contact force of that instant is, so
the force follows from the pantograph's compliance of one step, the contact's and the local one, in closed form.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary_model import layout, pantograph
from catenary_model.coupled import note, push_by
from catenary_model.cycle import book, soft_start_share
from catenary_model.finite_difference import step
from catenary_model.finite_difference.layout import Constants, State
from phil_base.kernels import njit

Array = NDArray[np.float64]


def run_by(arrive: Any, leave: Any) -> Any:
    """Make the compiled `run` of a scheme by how its steps begin and end.

    It rides as many cycles as `out` has rows; the uplift comes up within the first soft_start s as (1 - cos)/2. `held`
    is a contact force (N) on both sides in place of the contact, or NaN.
    """

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
        local = c.real.compliance
        force, w = s.contact[layout.LAST_FORCE], s.point[layout.W_CAT]
        for k in range(out.shape[0]):
            for _ in range(c.whole.substeps):
                arrive(c, s)
                t = c.real.ts * s.counter[layout.STEPS]
                share = soft_start_share(t, soft_start)
                head = pantograph.free(pc, ps, share)
                before, force = force, held
                if np.isnan(held):
                    force = pantograph.contact_force(pc, head, step.height(c, s, 0.0), local)
                pantograph.finish(pc, ps, force)
                w = book(c, s, before, force, w, step.height(c, s, force))
                leave(c, s, force)
            step.observe(c, s, force)
            note(s, force, out[k])
        s.contact[layout.LAST_FORCE] = force

    return run


run, push = run_by(step.arrive, step.leave), push_by(step.advance)
run_together, push_together = run_by(step.arrive_together, step.leave_together), push_by(step.advance_together)
