"""Three-mass pantograph of the AC simple benchmark, with a damped head."""

from phil_base.lumped import LUMPED
from test_rig_sim.pantographs.chain import lumped
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options


def benchmark(_: Options = STANDARD) -> Pantograph:
    """Return the benchmark's pantograph: masses and springs of `three_mass`, 45 N s/m on the head.

    Masses and springs were read in public code; the dampers (100, 0.1, 45 N s/m) are from memory and unverified.
    """
    return lumped(LUMPED["benchmark"])
