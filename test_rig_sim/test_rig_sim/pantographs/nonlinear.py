"""Two-mass pantograph with a real frame: dry joints, end stops, bellows, lift by the air flow."""

from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def nonlinear(options: Options = STANDARD) -> Pantograph:
    """Return EN 50318's masses on a frame without a linear spring: what holds it is in options.frame (`frame.py`)."""
    return chain(masses=[15.0, 7.2], springs=[0.0, 4200.0], dashpots=[60.0, 10.0], frame=options.frame)
