"""Three-mass model of a DSA380."""

from phil_base.lumped import LUMPED
from test_rig_sim.pantographs.chain import lumped
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def dsa380(_: Options = STANDARD) -> Pantograph:
    """Return a DSA380: lower frame, upper frame and head of 5.80, 6.00, 7.12 kg.

    Second-hand: two public sources have these numbers, neither of them is the maker's. Static force there 70 or 120 N.
    """
    return lumped(LUMPED["dsa380"])
