"""The pantographs that the rig can carry; a new one is one file and one line in `PANTOGRAPHS`."""

from types import MappingProxyType
from typing import Protocol

from test_rig_sim.pantographs.benchmark import benchmark
from test_rig_sim.pantographs.dsa250 import dsa250
from test_rig_sim.pantographs.dsa380 import dsa380
from test_rig_sim.pantographs.en50318 import en50318
from test_rig_sim.pantographs.motion import Pantograph
from test_rig_sim.pantographs.nonlinear import nonlinear
from test_rig_sim.pantographs.options import STANDARD, Options
from test_rig_sim.pantographs.state_space import state_space
from test_rig_sim.pantographs.three_mass import three_mass


class Maker(Protocol):
    """Makes a pantograph, with what it wants of the rig's parameters. Raises ValueError for what cannot be built."""

    def __call__(self, options: Options = STANDARD, /) -> Pantograph:
        """Return the pantograph, not yet put at its nominal height (`statics.set_up`)."""


PANTOGRAPHS: MappingProxyType[str, Maker] = MappingProxyType(
    {
        "en50318": en50318,
        "three_mass": three_mass,
        "benchmark": benchmark,
        "dsa380": dsa380,
        "dsa250": dsa250,
        "nonlinear": nonlinear,
        "state_space": state_space,
    }
)

__all__ = ["PANTOGRAPHS", "Maker", "Options", "Pantograph"]
