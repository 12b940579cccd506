"""A 2-D scheme for w = W(x, t) e^{i k_y y}: a strip between two boundaries, one tangential wave number at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from catenary_model.absorbing import assembly
from catenary_model.absorbing.boundary import BoundaryStencil, clamped
from catenary_model.absorbing.plane_waves import oriented, time_factor
from catenary_model.absorbing.stencil import Array, ComplexArray, Stencil


def update(
    stencil: Stencil, left: BoundaryStencil | None, right: BoundaryStencil | None, nodes: int, k_y: float
) -> sp.csr_array:
    """One step of the strip for one tangential wave number.

    Args:
        stencil: of the interior, two space dimensions.
        left: boundary at the left of axis 0; clamped if None.
        right: boundary at the right of axis 0; clamped if None.
        nodes: across the strip, boundaries included.
        k_y: tangential wave number, rad/m.

    Returns:
        Shape (nodes, levels * nodes), see `assembly`; real if the scheme is symmetric along y.

    Raises:
        ValueError: the boundaries do not fit the scheme or the strip.
    """
    left = clamped(stencil, "left") if left is None else left
    right = clamped(stencil, "right") if right is None else right
    if (left.side, right.side, left.axis, right.axis) != ("left", "right", 0, 0):
        raise ValueError("a strip takes its left boundary first and its right one second, both of axis 0")
    for boundary in (left, right):
        oriented(stencil, boundary)
    if nodes < max(left.nodes + right.nodes + 1, left.n_x + right.nodes, right.n_x + left.nodes):
        raise ValueError(f"a strip of {nodes} nodes is too narrow for its boundaries")
    eta = np.exp(1j * k_y * stencil.dx[1])
    entries = assembly.Entries(nodes, max(stencil.levels, left.n_t, right.n_t))
    weights = stencil.weights()
    interior = weights @ eta ** (np.arange(weights.shape[2]) - stencil.reach[1][0])
    low = stencil.reach[0][0]
    for j in range(left.nodes, nodes - right.nodes):
        for (level, k), value in np.ndenumerate(_real(interior)):
            entries.add(level + 1, j, j - low + k, value.item())
    for boundary, start, step in ((left, 0, 1), (right, nodes - 1, -1)):
        for (p, level, k), value in np.ndenumerate(_real(folded(boundary, eta))):
            entries.add(level, start + step * p, start + step * k, value.item())
    return entries.solve()


def folded(boundary: BoundaryStencil, eta: complex) -> ComplexArray:
    """Coefficients (nodes, 1 + N_t, N_x) that act on W, the tangential neighbours summed with their phase."""
    c = boundary.coefficients
    c = c[..., None] if c.ndim == 3 else c
    return np.asarray(c @ np.complex128(eta) ** (np.arange(c.shape[3]) - c.shape[3] // 2), complex)


def _real(values: ComplexArray) -> Array | ComplexArray:
    return values.real if np.abs(values.imag).max() < 1e-14 * max(1.0, np.abs(values).max()) else values


class Verdict(NamedTuple):
    """Stability of a strip over all tangential wave numbers."""

    radius: float
    """Largest spectral radius."""
    k_y: float
    """Where it occurs, rad/m."""


def stability(
    stencil: Stencil,
    boundary: BoundaryStencil,
    opposite: BoundaryStencil | None = None,
    nodes: int = 12,
    samples: int = 25,
) -> Verdict:
    """Spectral radius of a strip over tangential wave numbers from 0 to pi / dy, the largest.

    Necessary for stability of any domain that the boundary closes; corners are judged by `square`.

    Args:
        stencil: of the interior, symmetric along y.
        boundary: at the left.
        opposite: at the right; the same one, mirrored, if None (which needs a scheme that is symmetric along x).
        nodes: across the strip.
        samples: of the tangential wave number.
    """
    opposite = boundary.mirrored() if opposite is None else opposite
    numbers = np.linspace(0.0, np.pi / stencil.dx[1], samples)
    radii = [assembly.radius(update(stencil, boundary, opposite, nodes, float(k))) for k in numbers]
    best = int(np.argmax(radii))
    return Verdict(radii[best], float(numbers[best]))


def amplification(stencil: Stencil, boundary: BoundaryStencil, nodes: int = 12, doublings: int = 14) -> float:
    """Largest norm of a strip's transition over 1, 2, 4, ..., 2^(doublings - 1) steps: what a disturbance may grow to.

    A radius below 1 promises decay in the end. Before that, a boundary whose update nearly vanishes for slow waves (a
    product of many factors with little damping) amplifies whatever starts on it.
    """
    largest = 0.0
    for k_y in np.array([0.0, 0.016, 0.064, 0.25, 0.64, 1.0]) * np.pi / stencil.dx[1]:
        matrix = assembly.transition(update(stencil, boundary, boundary.mirrored(), nodes, float(k_y)))
        for _ in range(doublings):
            largest = max(largest, float(np.linalg.norm(matrix, 2)))
            if not largest < 1e12:
                return float("inf")
            matrix = matrix @ matrix
    return largest


class Echo(NamedTuple):
    """Reflection measured in time: amplitude over the angle of incidence of the parts of a wave packet."""

    k: Array
    """Wave numbers |k|, rad/m."""
    angle: Array
    """Angles of incidence, rad."""
    amplitude: Array
    """Reflected over incident amplitude."""


def measure(stencil: Stencil, boundary: BoundaryStencil, k: float, angle: float, nodes: int = 480) -> Echo:
    """Send a wave packet against the left boundary and compare with a strip without it.

    The packet e^{i (k_x x + k_y y)} with a Gaussian envelope contains plane waves of one k_y and a range of k_x. The
    same packet runs on a strip that goes on behind the boundary; the difference is the echo, and its spatial spectrum
    over that of the incident packet the reflection at each k_x.

    Args:
        stencil: of the interior, two space dimensions, lossless.
        boundary: at the left of axis 0.
        k: wave number of the packet's middle, rad/m.
        angle: of incidence of the packet's middle, rad; up to about 70 degrees (a grazing packet never ends).
        nodes: across the strip.

    Returns:
        The parts of the packet with at least a third of its largest amplitude.
    """
    dx = stencil.dx[0]
    k_x, k_y = k * np.cos(angle), k * np.sin(angle)
    x = np.arange(2 * nodes) * dx
    width, middle = nodes * dx / 12.0, nodes * dx * 1.5
    # Every part of the packet starts with its own frequency, so that nothing of it travels to the right.
    numbers = 2.0 * np.pi * np.fft.fftfreq(2 * nodes, dx)
    packet = np.fft.fft(np.exp(-(((x - middle) / width) ** 2) / 2.0 + 1j * k_x * (x - middle)))
    packet[numbers <= 0.0] = 0.0
    z = time_factor(stencil, np.where(numbers > 0.0, numbers, k_x), np.full(2 * nodes, k_y))
    step = np.angle(z)
    speed = float(np.gradient(step, numbers)[np.argmin(np.abs(numbers - k_x))])
    steps = int(nodes * dx / speed)
    past = [np.fft.ifft(packet * z ** (-n)) for n in range(max(stencil.levels, boundary.n_t))]
    with_end = assembly.march(update(stencil, boundary, None, nodes, k_y), [w[nodes:] for w in past])
    without = assembly.march(update(stencil, None, None, 2 * nodes, k_y), past)
    for _ in range(steps):
        met, free = next(with_end), next(without)
    echo = np.fft.fft(np.concatenate([np.zeros(nodes), met - free[nodes:]]))
    chosen = np.abs(packet) > np.abs(packet).max() / 3.0
    # A wave e^{i k_x x} comes back as e^{-i k_x x}: look it up at the negative wave number.
    back = echo[(-np.arange(2 * nodes)) % (2 * nodes)]
    return Echo(np.hypot(numbers[chosen], k_y), np.arctan2(k_y, numbers[chosen]), np.abs(back[chosen] / packet[chosen]))
