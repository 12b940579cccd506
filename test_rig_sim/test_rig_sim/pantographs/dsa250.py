"""Three-mass model of a DSA250."""

from phil_base.lumped import LUMPED
from test_rig_sim.pantographs.chain import lumped
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def dsa250(_: Options = STANDARD) -> Pantograph:
    """Return a DSA250: lower frame, upper frame and head of 4.645, 5.855, 7.51 kg.

    Second-hand: public code, one source. Static force there 120 N.
    """
    return lumped(LUMPED["dsa250"])
