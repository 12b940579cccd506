"""Reflected amplitude of one end of one wire, from the exact waves of the mesh at every frequency.

A travelling wave of unit displacement runs out at the first node that is not part of the layer. The nodes of the layer
with all that a boundary did to them, feedback with its delay included, and the two waves that come back are the
unknowns of one small linear system per frequency.

Raw is |w| of the travelling wave that comes back over |w| of the one that went out, both at that node. Clamped in the
same place, |w| comes back whole as long as the wave is long, but not for short ones and not where the integration
damps: `reflection` of a clamped end is what to divide by. For an undamped wire that quotient squared is the share of
the energy flux that returns, whatever v.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.layer import BEHIND, Feedback, Layer, element_length
from catenary_model.boundary.waves import Waves, newmark_factors, waves
from catenary_model.moving_frame import MovingFrame

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class End:
    """The outermost nodes of one wire at one end, counted inwards: rows of M, D, K, and the feedback."""

    mass: Array
    """M of the first n nodes, (2 n, 2 n + 2): the last two columns belong to node n."""
    damping: Array
    stiffness: Array
    gain: Array
    """K_ABC, (2 input nodes, 6 state nodes); may be empty."""


def end_of(frame: MovingFrame, feedback: Feedback | None, wire: int, end: int, nodes: int) -> End:
    """Cut the first `nodes` nodes of an end out of a frame on which a boundary was imposed."""
    matrices: list[Array] = []
    stations = frame.mesh.stations
    for compact in (frame.mass, frame.damping, frame.stiffness):
        full = np.zeros((2 * nodes, 2 * nodes + 2))
        for i in range(nodes):
            station = i if end == BEHIND else stations - 1 - i
            for dof in range(2):
                row = compact[4 * station + 2 * wire + dof]
                for offset in (-1, 0, 1):
                    j = i + (offset if end == BEHIND else -offset)
                    if j >= 0:
                        full[2 * i + dof, 2 * j : 2 * j + 2] = row[2 * (offset + 1) : 2 * (offset + 2)]
        matrices.append(full)
    gain = np.zeros((0, 0)) if feedback is None else feedback.gain[wire][end]
    mass, damping, stiffness = matrices
    return End(mass, damping, stiffness, gain)


def dynamic_stiffness(end: End, omega: Array, step: Layer) -> Complex:
    """Return s_a M + s_v D + K minus the feedback's z^-1 K_ABC (1, s_v, s_a), (len(omega), 2 n, 2 n + 2)."""
    s_v, s_a = (s[:, None, None] for s in newmark_factors(omega, step))
    Z = np.asarray(s_a * end.mass + s_v * end.damping + end.stiffness)
    if end.gain.size:
        u, x = end.gain.shape[0], end.gain.shape[1] // 3
        Kq, Kv, Ka = (end.gain[:, i * x : (i + 1) * x] for i in range(3))
        Z[:, :u, :x] -= np.exp(-1j * omega * step.ts)[:, None, None] * (Kq + s_v * Kv + s_a * Ka)
    return Z


def amplitudes(end: End, side: int, free: Waves, step: Layer) -> tuple[Complex, Complex]:
    """Return what comes back of a unit wave, (n, 2: travelling, bending), and the field of the nodes, (n, 2 nodes).

    `end` has the layer's nodes and one more, where the wave's amplitude is told; side is BEHIND or AHEAD.
    """
    Z = dynamic_stiffness(end, free.omega, step)
    size = Z.shape[1]
    out, back = side, 1 - side
    inward = 1.0 if side == BEHIND else -1.0
    mu = free.mu**inward
    # columns of node `nodes - 1` (the one told about) and the one beyond, for a unit of each wave
    near, beyond = slice(size - 2, size), slice(size, size + 2)
    A = Z[:, :, : size - 2]
    returned = np.empty((free.omega.size, size, 2), dtype=np.complex128)
    for which in range(2):
        phi = free.shape[:, back, which, :, None]
        returned[:, :, which] = (Z[:, :, near] @ phi + Z[:, :, beyond] @ phi * mu[:, back, which, None, None])[:, :, 0]
    phi = free.shape[:, out, 0, :, None]
    sent = (Z[:, :, near] @ phi + Z[:, :, beyond] @ phi * mu[:, out, 0, None, None])[:, :, 0]
    solution = np.linalg.solve(np.concatenate((A, returned), axis=2), -sent[:, :, None])[:, :, 0]
    a = solution[:, size - 2 :]
    last = free.shape[:, out, 0] + np.einsum("nw,nwd->nd", a, free.shape[:, back])
    field: Complex = np.concatenate((solution[:, : size - 2], last), axis=1)
    return np.asarray(a), field


def reflection(
    frame: MovingFrame, feedback: Feedback | None, wire: int, end: int, layer: Layer, frequency: Array
) -> Complex:
    """Return the raw reflected amplitude at each frequency (Hz, in the frame of the train), told at the layer's edge.

    `frame` and `feedback` are what `boundary.impose` made; layer.nodes nodes of the end count as layer.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)
    h = element_length(frame.mesh, end, layer.nodes + 1)
    free = waves(frame.wire(wire), h, frame.speed, omega, layer)
    a, _ = amplitudes(end_of(frame, feedback, wire, end, layer.nodes + 1), end, free, layer)
    return a[:, 0]
