"""Parameters of the simulated rig; their defaults are in config/test_rig_sim.yaml."""

from pydantic import model_validator

from test_rig_sim import mounting, operation
from test_rig_sim.rig import Rig
from test_rig_sim.rig_parameters import Imperfections, RigParameters

__all__ = ["Imperfections", "Parameters"]


class Parameters(RigParameters):
    """All parameters of the node test_rig_sim, of a rig that can be built."""

    @model_validator(mode="after")
    def _can_be_operated(self) -> "Parameters":
        operation.check(self)
        mounting.mount(self)
        return self

    def check_build(self) -> None:
        """Design the inner loop, stand the pantograph up, read and try the trajectory. Raises ValueError."""
        operation.rules(self, Rig(self).plant.loop)
