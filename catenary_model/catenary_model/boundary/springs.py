"""Droppers and masts frozen in one position and taut: linear springs on a mesh, for stability and for measurement."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import statics
from catenary_model.elements import shape_functions
from catenary_model.line import Line
from catenary_model.moving_frame import Mesh

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spring:
    """Force -stiffness e on what it holds, e = carrier w_ca + contact w_co at its position."""

    position: float
    """Relative to the pantograph, ahead is positive, m."""
    stiffness: float
    """Fading included, N/m."""
    carrier: float
    contact: float


def fade(mesh: Mesh, position: float, fading_length: float) -> float:
    """Return 0 at either end, rising linearly to 1 over fading_length (m), as in Fig. 3.9."""
    x = mesh.x
    depth = float(min(position - x[0], x[-1] - position))
    return min(1.0, max(0.0, depth / fading_length)) if fading_length > 0.0 else float(depth > 0.0)


def frozen(line: Line, mesh: Mesh, zeta: float, fading_length: float) -> list[Spring]:
    """Return all droppers (taut), masts and steady arms within the domain, the pantograph at track position zeta."""
    springs = []
    line = statics.built(line)
    behind, ahead, period = float(mesh.x[0]), float(mesh.x[-1]), line.period
    for repeat in range(math.floor((zeta + behind) / period), math.ceil((zeta + ahead) / period) + 1):
        for span, start in zip(line.spans, line.span_starts, strict=True):
            x = repeat * period + start - zeta
            parts = [Spring(x, span.mast.stiffness, 1.0, 0.0)]
            parts += [Spring(x + dropper.position, dropper.stiffness, 1.0, -1.0) for dropper in span.droppers]
            if span.steady_arm is not None:
                parts.append(Spring(x, span.steady_arm.stiffness, 0.0, 1.0))
            for part in parts:
                faded = fade(mesh, part.position, fading_length) * part.stiffness
                if behind < part.position < ahead and faded > 0.0:
                    springs.append(Spring(part.position, faded, part.carrier, part.contact))
    return springs


def elongations(mesh: Mesh, springs: Iterable[Spring]) -> list[tuple[int, Array, float]]:
    """Return per spring the first degree of freedom of its element, e per degree of freedom there (8,), N/m."""
    found = []
    shape = np.empty(4)
    x = mesh.x
    for spring in springs:
        element = min(max(int(np.searchsorted(x, spring.position, side="right")) - 1, 0), mesh.stations - 2)
        h = float(x[element + 1] - x[element])
        shape_functions((spring.position - x[element]) / h, h, shape)
        g = np.empty(8)
        g[0:2], g[4:6] = spring.carrier * shape[:2], spring.carrier * shape[2:]
        g[2:4], g[6:8] = spring.contact * shape[:2], spring.contact * shape[2:]
        found.append((4 * element, g, spring.stiffness))
    return found
