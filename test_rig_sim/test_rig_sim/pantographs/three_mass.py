"""Generic three-mass pantograph."""

from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def three_mass(_: Options = STANDARD) -> Pantograph:
    """Return a generic high-speed pantograph: lower frame, upper frame and head of 6.0, 9.0, 7.5 kg."""
    return chain(masses=[6.0, 9.0, 7.5], springs=[160.0, 15500.0, 7000.0], dashpots=[100.0, 0.1, 0.1])
