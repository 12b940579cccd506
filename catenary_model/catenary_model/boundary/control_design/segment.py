"""The wire near one end as a linear system in discrete time (3.30): the plant of the design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.layer import Layer
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.boundary.reflection import end_of
from catenary_model.line import Wire
from catenary_model.moving_frame import Mesh, assemble
from phil_base.newmark import state_space

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Segment:
    """x_(k+1) = A x_k + B u_k (3.30), nodes counted from the end inwards, (w, phi) interleaved.

    x = (q, q', q''): Newmark's method carries q'' on, which (3.24) leaves out.
    """

    A: Array
    """(6 nodes, 6 nodes)."""
    B: Array
    """(6 nodes, 2 nodes): a force or torque on every degree of freedom, held during the step."""

    @property
    def nodes(self) -> int:
        """Nodes of the segment."""
        return int(self.B.shape[1]) // 2


def newmark(M: Array, D: Array, K: Array, step: Layer) -> tuple[Array, Array]:
    """Return A (3 n, 3 n) and B (3 n, n) of Newmark's step for x = (q, q', q'')."""
    return state_space(M, D, K, step.ts, step.beta, step.gamma)


def segment(wire: Wire, h: float, speed: float, end: int, nodes: int, step: Layer) -> Segment:
    """Return the outermost `nodes` nodes of an end that already carries the matched dashpot.

    The dashpot belongs to the plant: it takes the long waves, and control has to do only what dispersion leaves. The
    inner end of the segment is cut off there; whoever predicts with it must stay away from that end.
    """
    frame = assemble(Mesh(h, nodes), wire, wire, speed)
    matched_dashpot(frame, step)
    cut = end_of(frame, None, 0, end, nodes)
    return Segment(*newmark(cut.mass[:, :-2], cut.damping[:, :-2], cut.stiffness[:, :-2], step))
