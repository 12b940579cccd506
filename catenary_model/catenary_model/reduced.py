"""Reduced model of the contact wire around the pantograph, for the impedance controller (thesis 3.1.9).

    M q'' + D q' + K q = f_held + b f_cat,    w_cat = c . q

Contact wire only, no droppers, a segment of the moving mesh. Whatever else acts on the segment (droppers, gravity, the
wire beyond its ends) is measured once a cycle as f_held = M q'' + D q' + K q - b f_cat and held over the controller's
horizon. At its ends the segment has the matched dashpots of `boundary.matched_dashpot`: f_held then takes back what
they do to the present motion, and only waves that the prediction itself sends out are absorbed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary import Layer, impose
from catenary_model.line import Wire
from catenary_model.moving_frame import CONTACT, Mesh, assemble, dense
from phil_base import newmark

Matrix = NDArray[np.float64]

NEWMARK_BETA, NEWMARK_GAMMA = 0.28, 0.55
"""Newmark's parameters for steps of the whole cycle time, whatever the full model integrates with: the controller
predicts in steps of Ts, over which parameters that suit the full model's shorter steps can be unstable (0.16 and 0.53
at 2 ms on elements of 0.75 m: spectral radius 1.13). Any stable pair predicts equally well."""


@dataclass(frozen=True)
class ReducedModel:
    """Second-order model of the segment; q = (w, phi) per node, from behind the pantograph to ahead."""

    x: Matrix
    """Nodes relative to the pantograph, m."""
    M: Matrix
    D: Matrix
    K: Matrix
    """Matrices (n, n), free wire in the moving frame."""
    b: Matrix
    """Input and output vector: shape functions at x = 0, (n,)."""
    compact: Matrix
    """M, D, K in rows of three nodes, (3, n, 6), for the kernel."""

    @property
    def n(self) -> int:
        """Degrees of freedom."""
        return int(self.b.size)


def reduce(mesh: Mesh, wire: Wire, speed: float, half_length: float) -> ReducedModel:
    """Build the segment of +-half_length (m, rounded to elements, at least one) around the pantograph.

    Raises ValueError if it does not fit into the mesh.
    """
    half = max(1, round(half_length / mesh.h))
    if half > mesh.half_elements:
        raise ValueError(f"segment_half_length = {half_length} m exceeds half the domain, {mesh.half_length} m")
    segment = Mesh(mesh.h, half)
    frame = assemble(segment, wire, wire, speed)
    impose("matched_dashpot", frame, Layer(nodes=0))
    rows = np.concatenate([4 * np.arange(segment.stations)[:, None] + 2 * CONTACT + np.arange(2)], axis=1).ravel()
    compact = np.stack([matrix[rows] for matrix in (frame.mass, frame.damping, frame.stiffness)])
    M, D, K = (dense(matrix)[np.ix_(rows, rows)] for matrix in (frame.mass, frame.damping, frame.stiffness))
    b = np.zeros(2 * segment.stations)
    b[2 * segment.middle] = 1.0
    return ReducedModel(segment.x, M, D, K, b, np.ascontiguousarray(compact))


def discretise(
    model: ReducedModel, ts: float, beta: float = NEWMARK_BETA, gamma: float = NEWMARK_GAMMA
) -> tuple[Matrix, Matrix, Matrix]:
    """Newmark's step as x(k+1) = A_cat x(k) + B_cat f_cat + B_held f_held, x = (q, q', q'') (3.40).

    Returns A_cat (3n, 3n), B_cat (3n,), B_held (3n, n). ts is in s; forces are those of the new instant.
    """
    A, B_held = newmark.state_space(model.M, model.D, model.K, ts, beta, gamma)
    return A, B_held @ model.b, B_held
