"""Reflection of a boundary measured in time runs, against a domain too long for its ends to be noticed."""

from __future__ import annotations

from itertools import islice
from typing import NamedTuple

import numpy as np

from catenary_model.absorbing.boundary import BoundaryStencil
from catenary_model.absorbing.dispersion import group_velocity, waves
from catenary_model.absorbing.simulate import steps
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil

TAIL = 4.0
"""Time that a measurement goes on after its source has ended, in periods of the lowest frequency."""


class Traces(NamedTuple):
    """What passes a node near the boundary.

    Attributes:
        t: s, shape (n,).
        incident: displacement in the long domain, where nothing comes back, shape (n,).
        reflected: what the boundary adds to it, shape (n,).
    """

    t: Array
    incident: Array
    reflected: Array


def traces(
    stencil: Stencil, boundary: BoundaryStencil, source: Array, duration: float, fastest: float, distance: int = 40
) -> Traces:
    """Simulate a point load near a boundary, and the same without the boundary.

    Args:
        stencil: of the interior, one space dimension.
        boundary: to be measured.
        source: load over time, in the units of the PDE's right-hand side, shape (m,).
        duration: s.
        fastest: frequency, Hz, up to which waves count when the length of the long domain is chosen.
        distance: of the load from the boundary, nodes.
    """
    scheme = stencil if boundary.side == "left" else stencil.mirrored()
    left = boundary if boundary.side == "left" else boundary.mirrored()
    count = int(np.ceil(duration / stencil.dt))
    speed = _fastest(scheme, fastest)
    # There and back in the whole time, and some room for waves above `fastest`.
    beyond = int(0.65 * speed * count * stencil.dt / stencil.dx[0]) + 4 * distance
    probe = max(left.n_x, left.nodes)
    rows = []
    for ahead, end in ((0, left), (beyond, None)):
        at = ahead + max(distance, 2 * probe)
        nodes = at + beyond
        force = np.zeros(nodes)

        def load(n: int, force: Array = force, at: int = at) -> Array:
            force[at] = source[n] if n < len(source) else 0.0
            return force

        frames = steps(scheme, end, None, np.zeros(nodes), load)
        rows.append(np.array([frame[ahead + probe] for frame in islice(frames, count)]))
    t: Array = stencil.dt * np.arange(1.0, count + 1.0)
    return Traces(t, rows[1], rows[0] - rows[1])


def broadband(stencil: Stencil, boundary: BoundaryStencil, frequencies: Array) -> Array:
    """Measure the reflected amplitude over frequency with one short pulse.

    The load is the derivative of a Gaussian, so that the displacement it sends out is a single Gaussian bump.

    Args:
        stencil: of the interior, one space dimension.
        boundary: to be measured.
        frequencies: Hz, shape (m,): their range sets the pulse's width and the duration.

    Returns:
        Reflected over incident amplitude, shape (m,).
    """
    f = np.asarray(frequencies, float)
    width = np.sqrt(2.0) / (2.0 * np.pi * f.max())
    t = stencil.dt * np.arange(int(12.0 * width / stencil.dt) + 1) - 6.0 * width
    source = -t / width * np.exp(-0.5 * (t / width) ** 2)
    found = traces(stencil, boundary, source, 12.0 * width + TAIL / f.min(), 2.0 * f.max())
    # The last half fades out: a slow tail cut off sharply would look like reflection at every frequency.
    fade = np.clip(2.0 * (1.0 - found.t / found.t[-1]), 0.0, 1.0)
    kernel = np.exp(-2j * np.pi * f[:, None] * found.t) * (0.5 - 0.5 * np.cos(np.pi * fade))
    return np.abs(_spectrum(kernel, found.reflected)) / np.abs(_spectrum(kernel, found.incident))


def packet(stencil: Stencil, boundary: BoundaryStencil, frequency: float, cycles: int = 8) -> tuple[float, Traces]:
    """Measure the reflected amplitude of one wave packet: a tone of some cycles under a raised cosine.

    Args:
        stencil: of the interior, one space dimension.
        boundary: to be measured.
        frequency: Hz.
        cycles: length of the packet; a longer one is purer in frequency.

    Returns:
        Largest reflected over largest incident displacement, and the traces.
    """
    length = cycles / frequency
    t = stencil.dt * np.arange(int(length / stencil.dt) + 1)
    source = np.sin(2.0 * np.pi * frequency * t) * 0.5 * (1.0 - np.cos(2.0 * np.pi * t / length))
    found = traces(stencil, boundary, source, length + TAIL / frequency, 2.0 * frequency)
    return float(np.abs(found.reflected).max() / np.abs(found.incident).max()), found


def _spectrum(kernel: ComplexArray, trace: Array) -> ComplexArray:
    return (kernel @ trace).astype(np.complex128)


def _fastest(scheme: Stencil, frequency: float) -> float:
    """Largest group speed of the scheme's waves up to a frequency, m/s."""
    f = np.linspace(frequency / 20.0, min(frequency, 0.49 / scheme.dt), 40)
    z = np.exp(2j * np.pi * f * scheme.dt)
    modes = waves(scheme, z)
    speeds = []
    for factor in (modes.incident[:, 0], modes.reflected[:, 0]):
        propagating = np.abs(np.abs(factor) - 1.0) < 0.05
        speeds.append(np.abs(group_velocity(scheme, factor[propagating], z[propagating])))
    return float(np.concatenate(speeds).max())
