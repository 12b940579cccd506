"""What ends the wires of the computational domain: one file a kind, one line a kind in `BOUNDARIES`.

A kind is a function that alters the matrices of a `MovingFrame` with free ends in place, and may hand back a state
feedback for the nodes of its layer. Since the model integrates the deviation from the static equilibrium, no kind has
to carry weight or tension: at rest all of them are exact.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary_model.boundary.clamped import clamped
from catenary_model.boundary.controlled import controlled, controlled_continuous
from catenary_model.boundary.layer import AHEAD, BEHIND, Feedback, Layer
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.boundary.viscous_sponge import viscous_sponge
from catenary_model.moving_frame import MovingFrame

__all__ = ["AHEAD", "BEHIND", "BOUNDARIES", "Boundary", "Feedback", "Layer", "impose"]

Boundary = Callable[[MovingFrame, Layer], Feedback | None]

BOUNDARIES: dict[str, Boundary] = {
    "controlled": controlled,
    "controlled_continuous": controlled_continuous,
    "matched_dashpot": matched_dashpot,
    "viscous_sponge": viscous_sponge,
    "clamped": clamped,
}


def impose(kind: str, frame: MovingFrame, layer: Layer | None = None) -> Feedback | None:
    """Alter the frame's matrices for the boundary of this kind and return its state feedback, if it has one.

    Raises ValueError for an unknown kind, a layer longer than half the domain, or a design that would not be stable.
    """
    try:
        boundary = BOUNDARIES[kind]
    except KeyError:
        raise ValueError(f"boundary = {kind!r} is not one of {', '.join(BOUNDARIES)}") from None
    layer = layer or Layer()
    if 2 * layer.nodes >= frame.mesh.stations:
        raise ValueError(f"two layers of {layer.nodes} nodes do not fit into {frame.mesh.stations} nodes")
    return boundary(frame, layer)
