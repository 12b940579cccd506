"""The pantographs that the rig can carry; a new one is one file and one line in `PANTOGRAPHS`."""

from collections.abc import Callable
from types import MappingProxyType

from test_rig_sim.pantographs.chain import Pantograph
from test_rig_sim.pantographs.en50318 import en50318
from test_rig_sim.pantographs.three_mass import three_mass

PANTOGRAPHS: MappingProxyType[str, Callable[[], Pantograph]] = MappingProxyType(
    {
        "en50318": en50318,
        "three_mass": three_mass,
    }
)

__all__ = ["PANTOGRAPHS", "Pantograph"]
