"""Two-mass pantograph of EN 50318:2002."""

from phil_base.lumped import LUMPED
from test_rig_sim.pantographs.chain import lumped
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def en50318(_: Options = STANDARD) -> Pantograph:
    """Return the reference pantograph of EN 50318:2002: frame 15 kg, head 7.2 kg."""
    return lumped(LUMPED["en50318"])
