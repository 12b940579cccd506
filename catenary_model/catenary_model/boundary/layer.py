"""What a boundary kind is told (`Layer`) and what it may hand back (`Feedback`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.moving_frame import Mesh

Array = NDArray[np.float64]

BEHIND, AHEAD = 0, 1
"""The two ends of the domain, index of `Feedback.gain[wire]`."""


@dataclass(frozen=True)
class Layer:
    """Nodes and time step that a boundary may count on. Raises ValueError naming the field."""

    nodes: int = 20
    """Nodes of the layer at either end, the end node included; none of them belongs to the spans."""
    ts: float = 0.002
    """Integration step, s."""
    beta: float = 0.28
    """Newmark's beta."""
    gamma: float = 0.55
    """Newmark's gamma."""

    def __post_init__(self) -> None:
        if self.nodes < 0:
            raise ValueError(f"nodes = {self.nodes} must be at least 0")
        for name in ("ts", "beta", "gamma"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} = {value} must be finite and above 0")


def element_length(mesh: Mesh, end: int, elements: int) -> float:
    """Return the length (m) of the outermost elements of an end; raises ValueError unless they are all alike."""
    lengths = np.diff(mesh.x)
    outermost = lengths[: max(elements, 1)] if end == BEHIND else lengths[::-1][: max(elements, 1)]
    if float(np.ptp(outermost)) > 1e-9 * float(outermost[0]):
        raise ValueError(f"the {elements} outermost elements of an end must be of one length, not {outermost} m")
    return float(outermost[0])


@dataclass(frozen=True)
class Feedback:
    """Linear state feedback u_k = K_ABC x_k (3.39) at both ends of both wires.

    Nodes are counted from the very end inwards, also at the end ahead. u holds (F, M) of the first nodes, x holds
    (q, q', q'') of the first nodes, each of the three with (w, phi) interleaved. u_k is computed from x_k and held
    until k + 1: it stands on the right side of the step to k + 1.
    """

    gain: tuple[tuple[Array, Array], tuple[Array, Array]]
    """gain[wire][end], each (2 input nodes, 6 state nodes)."""

    def __post_init__(self) -> None:
        for wire in self.gain:
            for gain in wire:
                if gain.ndim != 2 or gain.shape[0] % 2 or gain.shape[1] % 6:
                    raise ValueError(f"a gain has shape (2 input nodes, 6 state nodes), not {gain.shape}")
