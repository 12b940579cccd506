"""Layer with forces and torques from state feedback, u = K_ABC x (3.1.6), on top of the matched dashpot.

`controlled` lets the reference run with the dispersion relation of mesh and time step (3.27), `controlled_continuous`
with that of the beam (3.26). Every wire and every end has its own gain; see `control_design`.
"""

from __future__ import annotations

from catenary_model.boundary.control_design import Settings, wire_gains
from catenary_model.boundary.layer import AHEAD, BEHIND, Feedback, Layer, element_length
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.moving_frame import CARRIER, CONTACT, MovingFrame

DISCRETISED = Settings(
    dispersion="discretised",
    input_nodes=1,
    state_nodes=8,
    horizon=1,
    moves=1,
    lowest=0.3,
    highest=40.0,
    harmonics=120,
    regularisation=1e-6,
    tilt=1.0,
    above=1.0,
    others=3e-4,
    velocity=0.02,
    decay=0.0,
    growth=2.0,
    effort=1e-8,
)
"""Found by `control_design.tuning` on the real-time model's mesh; of its best, the one whose gain times 1.1 is stable
on five other meshes and steps too. Force and torque at the end node alone and an undamped reference: with the dashpot
beneath, waves need not be worn down on their way, only let out; inputs further inside made no difference.
"""
CONTINUOUS = Settings(
    dispersion="continuous",
    input_nodes=2,
    state_nodes=17,
    horizon=2,
    moves=2,
    lowest=0.3,
    highest=100.0,
    harmonics=80,
    regularisation=1e-9,
    tilt=1.5,
    above=0.03,
    others=0.3,
    velocity=0.005,
    decay=0.01,
    growth=3.0,
    effort=10.0,
)
"""Found in the same way on that mesh alone: on all six together nothing beat the plain dashpot by much."""


def controlled(frame: MovingFrame, layer: Layer) -> Feedback:
    """Matched dashpots and the gains for the waves of mesh and time step. Raises ValueError if not stable."""
    return _controlled(frame, layer, DISCRETISED)


def controlled_continuous(frame: MovingFrame, layer: Layer) -> Feedback:
    """Matched dashpots and the gains for the waves of the beam. Raises ValueError if not stable."""
    return _controlled(frame, layer, CONTINUOUS)


def _controlled(frame: MovingFrame, layer: Layer, settings: Settings) -> Feedback:
    gains = []
    for which in (CARRIER, CONTACT):
        wire = frame.wire(which)
        behind, ahead = (element_length(frame.mesh, end, layer.nodes) for end in (BEHIND, AHEAD))
        gains.append(
            (
                wire_gains(wire, behind, frame.speed, layer, settings)[BEHIND],
                wire_gains(wire, ahead, frame.speed, layer, settings)[AHEAD],
            )
        )
    matched_dashpot(frame, layer)
    return Feedback((gains[CARRIER], gains[CONTACT]))
