"""A pantograph that is given by a file: transfer functions, or matrices of a state-space model."""

from phil_base.parameters import config_file
from test_rig_sim.pantographs.linear_file import read_pantograph
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.options import STANDARD, Options

EXAMPLE = "pantograph_en50318.yaml"
"""In the package's config folder: the pantograph of EN 50318 as transfer functions."""


def state_space(options: Options = STANDARD) -> Pantograph:
    """Return the linear pantograph of options.file, of the shipped example if there is none. Raises ValueError."""
    return read_pantograph(options.file or config_file("test_rig_sim", EXAMPLE))
