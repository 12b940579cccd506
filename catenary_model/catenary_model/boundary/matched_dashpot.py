"""Matched dashpot: a free end that feels the impedance of the wire that was cut off.

A damped wave that leaves the domain ahead obeys w_t + (c - v) w_x + beta/(2 rhoA) w = 0 in the moving frame, one that
leaves it behind w_t - (c + v) w_x + beta/(2 rhoA) w = 0. Put into the natural boundary force (T - rhoA v^2) w_x =
rhoA (c - v)(c + v) w_x of `moving_frame` this gives

    ahead:   f = -rhoA (c + v) (w_t + beta/(2 rhoA) w)
    behind:  f = -rhoA (c - v) (w_t + beta/(2 rhoA) w)

so Z(v) = rhoA (c +- v). Bending is left out: it matters only for waves shorter than about sqrt(EI/T) = 9 cm, and
moment and shear are zero at the end. Droppers and masts do not enter: they are faded out before the end.
"""

from __future__ import annotations

from catenary_model.boundary.layer import Layer
from catenary_model.moving_frame import CARRIER, CONTACT, MovingFrame


def matched_dashpot(frame: MovingFrame, layer: Layer) -> None:
    """Add Z(v) and its small companion spring to the end displacements of both wires."""
    ahead = 4 * (frame.mesh.stations - 1)
    for which in (CARRIER, CONTACT):
        wire = frame.wire(which)
        for row, c_v in ((2 * which, -frame.speed), (ahead + 2 * which, frame.speed)):
            Z = wire.mass_per_length * (wire.wave_speed + c_v)
            frame.damping[row, 2] += Z
            frame.stiffness[row, 2] += Z * wire.damping / (2.0 * wire.mass_per_length)
