"""Generic three-mass pantograph."""

from phil_base.lumped import LUMPED
from test_rig_sim.pantographs.chain import lumped
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def three_mass(_: Options = STANDARD) -> Pantograph:
    """Return a generic high-speed pantograph: lower frame, upper frame and head of 6.0, 9.0, 7.5 kg."""
    return lumped(LUMPED["three_mass"])
