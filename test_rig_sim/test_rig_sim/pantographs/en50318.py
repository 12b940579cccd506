"""Two-mass pantograph of EN 50318:2002."""

from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def en50318(_: Options = STANDARD) -> Pantograph:
    """Return the reference pantograph of EN 50318:2002: frame 15 kg, head 7.2 kg."""
    return chain(masses=[15.0, 7.2], springs=[50.0, 4200.0], dashpots=[90.0, 10.0])
