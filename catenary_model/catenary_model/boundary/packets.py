"""Wave packets sent from inside against an end, and what of them comes back: reflection in the time domain.

Two runs of one wire, on the same mesh and with the same step: in one the end is there, in the other the wire goes on so
far that nothing returns in time. Whatever the two runs differ by has come back from the end. It is listened to a few
nodes inside of the layer, where the bending that surrounds an end and travels nowhere has died out. Many packets run
side by side, one a column.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.control_design.dispersion import continuous_wave_number
from catenary_model.boundary.layer import AHEAD, BEHIND, Feedback, Layer
from catenary_model.line import Wire
from catenary_model.moving_frame import MovingFrame
from phil_base.kernels import njit

Array = NDArray[np.float64]

CYCLES, SECONDS = 6.0, 0.8
"""A packet lasts so many periods of its frequency and seconds: long enough to hold one frequency."""
SOURCE = 10.0
"""Distance of the force from the layer, m."""
LISTEN = 4
"""Nodes between the layer and where one listens."""
SETTLE = 0.8
"""Time after a packet in which its reflection is still listened to, s."""


@dataclass(frozen=True)
class Echo:
    """What passed where one listens, rms over the run of each packet (frequencies,), m."""

    sent: Array
    returned: Array

    @property
    def raw(self) -> Array:
        """Reflected amplitude, (frequencies,)."""
        return self.returned / self.sent


def packet(time: Array, frequency: float) -> Array:
    """Return a force of 1 N amplitude under a sin^4 window of CYCLES periods and SECONDS, (len(time),)."""
    length = CYCLES / frequency + SECONDS
    inside = (time > 0.0) & (time < length)
    window = np.sin(np.pi * time / length) ** 4 * inside
    return np.asarray(window * np.sin(2.0 * np.pi * frequency * (time - 0.5 * length)))


def duration(lowest: float) -> float:
    """Return the time (s) that packets from the lowest frequency (Hz) on take, and their reflections."""
    return CYCLES / lowest + SECONDS + SETTLE


def far(wire: Wire, speed: float, frequency: Array) -> float:
    """Return a distance (m) from which nothing returns while packets of these frequencies (Hz) run together.

    Bending lets short waves run faster: from c - v = 33 m/s to twice that for what runs ahead at 320 km/h and 40 Hz.
    """
    omega = 2.0 * np.pi * np.array([frequency.min(), 1.3 * frequency.max()])
    group = []
    for direction in (BEHIND, AHEAD):
        slope = continuous_wave_number(wire, speed, direction, 1.01 * omega).real
        slope -= continuous_wave_number(wire, speed, direction, omega).real
        group.append(float(np.max(np.abs(0.01 * omega / slope))))
    return 20.0 + duration(float(frequency.min())) / (1.0 / group[BEHIND] + 1.0 / group[AHEAD])


def echo(
    bounded: MovingFrame,
    feedback: Feedback | None,
    unbounded: MovingFrame,
    wire: int,
    end: int,
    layer: Layer,
    frequency: Array,
) -> Echo:
    """Send packets of each frequency (Hz) against one end of `bounded`, and off into `unbounded`.

    `bounded` and `feedback` are what `boundary.impose` made. Both frames have to be so long that nothing returns from
    any end but the one in question, see `far`.
    """
    with_end = passing(bounded, feedback, wire, end, layer, frequency, layer.nodes)
    without = passing(unbounded, None, wire, end, layer, frequency, unbounded.mesh.half_elements)
    return Echo(rms(without), rms(with_end - without))


def rms(signals: Array) -> Array:
    """Return the root of the mean square over time of signals (steps, packets)."""
    return np.asarray(np.sqrt(np.mean(signals**2, axis=0)))


def passing(
    frame: MovingFrame, feedback: Feedback | None, wire: int, end: int, layer: Layer, frequency: Array, nodes: int
) -> Array:
    """Return w where one listens, the packets sent from SOURCE m further inside, (steps, packets).

    `nodes` nodes lie outside of the edge that is listened to from inside: the layer, or more where there is none.
    """
    frequency = np.asarray(frequency, dtype=np.float64)
    steps = math.ceil(duration(float(frequency.min())) / layer.ts)
    time = layer.ts * np.arange(1, steps + 1, dtype=np.float64)
    force = np.stack([packet(time, float(f)) for f in frequency], axis=1)
    edge, inward = (nodes, 1) if end == BEHIND else (frame.mesh.stations - 1 - nodes, -1)
    ear = edge + inward * LISTEN
    source = ear + inward * max(1, round(SOURCE / frame.mesh.h))
    gain = np.zeros((0, 0)) if feedback is None else feedback.gain[wire][end]
    return _run(frame, gain, wire, end, layer, force, source, ear)


def _run(
    frame: MovingFrame, gain: Array, wire: int, end: int, layer: Layer, force: Array, source: int, ear: int
) -> Array:
    rows = (4 * np.arange(frame.mesh.stations)[:, None] + 2 * wire + np.arange(2)).ravel()
    M, D, K = (np.ascontiguousarray(compact[rows]) for compact in (frame.mass, frame.damping, frame.stiffness))
    seen = gain.shape[1] // 3 if gain.size else 0
    i = np.arange(max(seen, gain.shape[0]))
    dof = i if end == BEHIND else 2 * (frame.mesh.stations - 1 - i // 2) + i % 2
    return np.asarray(_newmark(M, D, K, layer.ts, layer.beta, layer.gamma, gain, dof, force, 2 * source, 2 * ear))


@njit(cache=True)
def _newmark(
    M: Array,
    D: Array,
    K: Array,
    ts: float,
    beta: float,
    gamma: float,
    gain: Array,
    dof: NDArray[np.int64],
    force: Array,
    source: int,
    ear: int,
) -> Array:
    """Newmark's steps of one wire, see `catenary_model.wires`; return w where one listens, (steps, packets)."""
    n = M.shape[0]
    steps, columns = force.shape
    # rows with seven diagonals, LU without pivoting
    lu = np.zeros((n, 7))
    for i in range(n):
        for j in range(6):
            column = i - i % 2 - 2 + j
            if 0 <= column < n:
                lu[i, column - i + 3] = M[i, j] + gamma * ts * D[i, j] + beta * ts * ts * K[i, j]
    for i in range(n):
        for j in range(max(0, i - 3), i):
            factor = lu[i, j - i + 3] / lu[j, 3]
            lu[i, j - i + 3] = factor
            for k in range(j + 1, min(n, j + 4)):
                lu[i, k - i + 3] -= factor * lu[j, k - j + 3]
    q, q_t, q_tt = np.zeros((n, columns)), np.zeros((n, columns)), np.zeros((n, columns))
    right = np.zeros((n, columns))
    inputs = gain.shape[0]
    seen = gain.shape[1] // 3
    u = np.zeros((inputs, columns))
    out = np.zeros((steps, columns))
    for step in range(steps):
        for a in range(inputs):
            for c in range(columns):
                u[a, c] = 0.0
                for b in range(seen):
                    at = dof[b]
                    u[a, c] += gain[a, b] * q[at, c] + gain[a, seen + b] * q_t[at, c]
                    u[a, c] += gain[a, 2 * seen + b] * q_tt[at, c]
        for i in range(n):
            for c in range(columns):
                q[i, c] += ts * q_t[i, c] + ts * ts * (0.5 - beta) * q_tt[i, c]
                q_t[i, c] += ts * (1.0 - gamma) * q_tt[i, c]
        for i in range(n):
            for c in range(columns):
                right[i, c] = 0.0
            for j in range(6):
                column = i - i % 2 - 2 + j
                if 0 <= column < n:
                    d, k = D[i, j], K[i, j]
                    for c in range(columns):
                        right[i, c] -= d * q_t[column, c] + k * q[column, c]
        for c in range(columns):
            right[source, c] += force[step, c]
            for a in range(inputs):
                right[dof[a], c] += u[a, c]
        for i in range(n):
            for j in range(max(0, i - 3), i):
                factor = lu[i, j - i + 3]
                for c in range(columns):
                    right[i, c] -= factor * right[j, c]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, min(n, i + 4)):
                factor = lu[i, j - i + 3]
                for c in range(columns):
                    right[i, c] -= factor * right[j, c]
            for c in range(columns):
                right[i, c] /= lu[i, 3]
        for i in range(n):
            for c in range(columns):
                q_tt[i, c] = right[i, c]
                q[i, c] += beta * ts * ts * right[i, c]
                q_t[i, c] += gamma * ts * right[i, c]
        for c in range(columns):
            out[step, c] = q[ear, c]
    return out
