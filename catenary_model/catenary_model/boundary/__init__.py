"""What ends the wires of the computational domain: one file a kind, one line a kind in `BOUNDARIES`.

A kind is a function that alters the matrices of a `MovingFrame` with free ends in place. Since the model integrates
the deviation from the static equilibrium, no kind has to carry weight or tension: at rest all of them are exact.
"""

from __future__ import annotations

from collections.abc import Callable

from catenary_model.boundary.clamped import clamped
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.moving_frame import MovingFrame

Boundary = Callable[[MovingFrame], None]

BOUNDARIES: dict[str, Boundary] = {
    "matched_dashpot": matched_dashpot,
    "clamped": clamped,
}


def impose(kind: str, frame: MovingFrame) -> None:
    """Alter the frame's matrices for the boundary of this kind; raises ValueError for an unknown one."""
    try:
        boundary = BOUNDARIES[kind]
    except KeyError:
        raise ValueError(f"boundary = {kind!r} is not one of {', '.join(BOUNDARIES)}") from None
    boundary(frame)
