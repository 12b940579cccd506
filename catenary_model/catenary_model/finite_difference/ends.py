"""What ends the wires on the grid: boundary stencils of `absorbing`, one pair for each wire.

`absorbing` designs them for the wire's own interior scheme at this speed (3.1.5): least squares over the waves that
the scheme really has, each side its own, stable between each other. `one_way` follows the outgoing wave of a string
back for one step, the simple competitor; `clamped` is w = w_x = 0 (3.7), for comparison.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from catenary_model import absorbing
from catenary_model.absorbing import BoundaryStencil, Stencil, cache, stability
from catenary_model.config import Config
from catenary_model.line import Wire

Array = NDArray[np.float64]
Pair = tuple[BoundaryStencil, BoundaryStencil]

BAND = (0.1, 30.0)
"""Frequencies, in the frame of the train, for which absorbing ends are designed, Hz."""
OUTSIDE = 1e-3
"""Weight of all others: what they do there decides the stability."""
FIRST = absorbing.Sweep(tikhonov=(1e-6, 1e-5, 1e-4, 1e-3), outside=(1e-3, 1e-2), leak=(1e-7, 1e-6), iterations=0)
FURTHER = absorbing.Sweep(iterations=0)
"""Least-squares problems that are tried: the first ones nearly always suffice."""
CHECKED = (60, 240)
"""Nodes of the closed domains in which a pair's spectral radius is looked at, beside those of the design."""
ROUNDING = 1e-9
"""What a spectral radius may be above 1 by rounding: the two static modes of a free wire are a double root 1."""


def _absorbing(config: Config, wire: Wire, stencil: Stencil) -> Pair:
    weighting = absorbing.band(*BAND, OUTSIDE)
    n_x, n_t = config.grid_boundary_nodes, config.grid_boundary_levels
    try:
        left, right = cache.cached_pair(stencil, n_x, n_t, weighting, sweep=FIRST)
    except ValueError:
        left, right = cache.cached_pair(stencil, n_x, n_t, weighting, sweep=FURTHER)
    return left.boundary, right.boundary


def _one_way(config: Config, wire: Wire, stencil: Stencil) -> Pair:
    """Damped outgoing wave w_t + (c -+ v) (+-w_x) + beta/(2 rhoA) w = 0, followed back by parabolas upstream."""
    decay = math.exp(-0.5 * wire.damping / wire.mass_per_length * stencil.dt)
    pair = []
    for side, speed in (("left", wire.wave_speed + config.speed), ("right", wire.wave_speed - config.speed)):
        nodes = stencil.nodes_at(side)
        s = speed * stencil.dt / stencil.dx[0]
        coefficients = np.zeros((nodes, 2, nodes + 2))
        for p in range(nodes):
            coefficients[p, 1, p : p + 3] = decay * np.array(
                [0.5 * (1.0 - s) * (2.0 - s), s * (2.0 - s), -0.5 * s * (1.0 - s)]
            )
        pair.append(BoundaryStencil(coefficients, side))
    return pair[0], pair[1]


def _clamped(config: Config, wire: Wire, stencil: Stencil) -> Pair:
    return absorbing.clamped(stencil, "left"), absorbing.clamped(stencil, "right")


ENDS: dict[str, Callable[[Config, Wire, Stencil], Pair]] = {
    "absorbing": _absorbing,
    "one_way": _one_way,
    "clamped": _clamped,
}
"""Kinds of ends by name."""


def design(config: Config, wire: Wire, stencil: Stencil) -> Pair:
    """Return what ends a wire behind and ahead.

    Raises
    ------
    ValueError
        There are no such ends, or the free wire between them would grow: the message names the parameters.
    """
    kind = config.grid_boundary
    if kind not in ENDS:
        raise ValueError(f"grid_boundary = '{kind}' must be one of {', '.join(ENDS)}")
    settings = (
        f"grid_boundary = '{kind}' at speed = {config.speed:.4g} m/s, grid_spacing = {config.grid_spacing} m, "
        f"{config.step_time * 1e3:.3g} ms a step, grid_boundary_levels = {config.grid_boundary_levels}, "
        f"grid_boundary_nodes = {config.grid_boundary_nodes}"
    )
    try:
        pair = ENDS[kind](config, wire, stencil)
    except ValueError as error:
        raise ValueError(f"{settings}: {error}") from None
    worst = max(absorbing.radius(stencil, *pair, nodes) for nodes in CHECKED)
    if worst > 1.0 + ROUNDING:
        raise ValueError(f"{settings}: the free wire between these ends grows by a factor of {worst:.9f} a step")
    return pair


def rows(stencil: Stencil, pair: Pair, nodes: int, levels: int, width: int) -> Array:
    """Both ends for the kernel, all of old values, (side, nodes, levels, width). Raises ValueError if too large."""
    out = np.zeros((2, nodes, levels, width))
    for side, boundary in enumerate(pair):
        found = stability.edge_rows(stencil, boundary)
        used = np.flatnonzero(np.abs(found).max(axis=(0, 1)))
        n = int(used[-1]) + 1 if used.size else 1
        if found.shape[0] > nodes or found.shape[1] > levels or n > width:
            raise ValueError(f"boundary stencil of shape {found.shape} does not fit {(nodes, levels, width)}")
        out[side, : found.shape[0], : found.shape[1], :n] = found[:, :, :n]
    return out
