"""Viscous sponge: the wire's own damping beta grows over the layer towards a clamped end, the naive absorber.

beta(x) = beta + beta_max (depth / length)^2 in every element. A long wave decays at beta(x) / (2 rhoA (c +- v)) per
metre on its way out and with the other sign of v on its way back; beta_max follows from the decay in nepers wanted for
the whole way. More decay returns less from the end and more from the growth of beta itself, above all at low frequency.
"""

from __future__ import annotations

import itertools

from catenary_model import elements
from catenary_model.boundary.clamped import clamped
from catenary_model.boundary.layer import AHEAD, BEHIND, Layer, element_length
from catenary_model.moving_frame import CARRIER, CONTACT, MovingFrame

WAY = 2.5
"""Decay of a wave on its way through the layer and back, nepers."""


def viscous_sponge(frame: MovingFrame, layer: Layer) -> None:
    """Let the damping of both wires grow over the layers and clamp their ends."""
    count, v = layer.nodes, frame.speed
    last = 4 * (frame.mesh.stations - 1)
    for end, which in itertools.product((BEHIND, AHEAD), (CARRIER, CONTACT)):
        h = element_length(frame.mesh, end, count)
        m, c = elements.mass(h), elements.convection(h)
        wire = frame.wire(which)
        # the mean of depth^2 over the layer is 1/3; way = beta_max / 3 length (1/(c + v) + 1/(c - v)) / (2 rhoA)
        slowness = 1.0 / (wire.wave_speed + v) + 1.0 / (wire.wave_speed - v)
        beta_max = 6.0 * wire.mass_per_length * WAY / (max(count, 1) * h * slowness)
        for e in range(count):
            beta = beta_max * ((count - e - 0.5) / count) ** 2
            row = (4 * e if end == BEHIND else last - 4 * (e + 1)) + 2 * which
            for target, block in ((frame.damping, beta * m), (frame.stiffness, -beta * v * c)):
                target[row : row + 2, 2:6] += block[:2]
                target[row + 4 : row + 6, 0:4] += block[2:]
    clamped(frame, layer)
