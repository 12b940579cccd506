"""Offline design of the controlled layer (3.1.6): from a wire at a speed to the static gain K_ABC of each end.

- `segment`: the wire near an end in state space, (3.30) and (3.31)
- `dispersion`: the waves that leave, continuous or discretised, (3.26) and (3.27)
- `modal`: least-squares fit of the wave field, (3.32) and (3.33)
- `reference`: phase shift and damping profile, (3.34) to (3.37)
- `horizon`: cost and gain, (3.38) and (3.39)
- `design`: all of these in order, with the check of stability and the cache
"""

from catenary_model.boundary.control_design.design import end_gain, wire_gains
from catenary_model.boundary.control_design.settings import Settings

__all__ = ["Settings", "end_gain", "wire_gains"]
