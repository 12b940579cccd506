"""Switching between environments during operation: one controller each, one set of books, no bump.

The catenary goes on being stepped with the contact force whatever the rig follows; its energy is in the books only
while the rig follows it.
"""

from __future__ import annotations

import math

import numpy as np

from impedance_mpc.controller import Command, EnvironmentReading, ImpedanceController, RigReading
from impedance_mpc.environment import Environment, LinearEnvironment, mass_spring_damper, standing_alone
from impedance_mpc.parameters import Parameters
from impedance_mpc.parts import PARTS, Parts
from impedance_mpc.plant import Impedance
from phil_base.enumerations import EnvironmentKind

ENVIRONMENTS = tuple(kind.name.lower() for kind in EnvironmentKind)
"""Names as the parameter and the service have them, in the order of their numbers."""


def simulated_environments(config: Parameters, model: Impedance) -> tuple[LinearEnvironment, LinearEnvironment]:
    """Make what is simulated here: the reduced model on its own, and the mass on spring and damper.

    Raises
    ------
    ValueError
        One of them is not stable, or singular.
    """
    own = config.environments
    alone = standing_alone(model, own.reduced)
    return LinearEnvironment(alone), LinearEnvironment(mass_spring_damper(own.mass_spring_damper, config.cycle_time))


class EnvironmentSwitch:
    """Owns a controller for each environment, and the environments that are simulated here.

    ``model`` is the catenary's reduced model; the controllers are put together from ``parts``. Everything is designed
    at construction; a switch costs no design. One call of :meth:`command` is one cycle.

    Raises
    ------
    ValueError
        A model does not fit the controller, or is not stable on its own.
    """

    def __init__(self, config: Parameters, model: Impedance, parts: Parts = PARTS) -> None:
        ts = config.cycle_time
        own = config.environments
        self.books = parts.books(ts)
        self._own: tuple[Environment | None, ...] = (None, *simulated_environments(config, model))
        models = [model if found is None else found.model for found in self._own]
        self.controllers = [ImpedanceController(config, each, self.books, parts) for each in models]
        self._share = -math.expm1(-ts / own.mean_time)
        self._initial = ENVIRONMENTS.index(config.environment)
        self._n = model.n
        self.reset()

    def warm_up(self) -> None:
        """Compile all kernels: a few cycles with every environment, then reset."""
        zeros = np.zeros(self._n)
        rest = EnvironmentReading(zeros, zeros, zeros, zeros, 0.0, 0.0, 0.0)
        for self._wanted in range(len(ENVIRONMENTS)):
            for _ in range(3):
                self.command(RigReading(0.0, 0.0, 0.0, 0.0), rest, True)
                self.command(RigReading(0.0, 0.0, 0.0, 0.0), rest, False)
        self.reset()

    def reset(self) -> None:
        """Go back to before cycle 0, with the environment that was selected last."""
        for controller in self.controllers:
            controller.reset()
        self.active: int = EnvironmentKind.CATENARY
        self._wanted = self._initial
        self._mean: float | None = None
        self.w = self.v = 0.0

    def select(self, name: str) -> None:
        """Let the next cycle begin with this environment; raises ValueError if it is none of ENVIRONMENTS."""
        if name not in ENVIRONMENTS:
            raise ValueError(f"environment '{name}' is none of {', '.join(ENVIRONMENTS)}")
        self._initial = self._wanted = ENVIRONMENTS.index(name)

    @property
    def controller(self) -> ImpedanceController:
        """The controller at work."""
        return self.controllers[self.active]

    @property
    def result(self) -> Command:
        """The last command."""
        return self.controller.result

    def set_control(self, control: str) -> None:
        """Choose the control scheme of all environments."""
        for controller in self.controllers:
            controller.control = control

    def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
        """Compute the command of cycle k from rig and catenary at t_k; ``following``: the rig does as it is told.

        ``f_cat`` of the command is the force on the environment that is followed; the catenary gets it only if it is
        that one, else ``f_predicted`` (see :attr:`force_on_catenary`).
        """
        self._mean = rig.f_tr if self._mean is None else self._mean + self._share * (rig.f_tr - self._mean)
        if self._wanted != self.active:
            self._swap(wire)
        environment = self._own[self.active]
        reading = wire if environment is None else environment.reading()
        self.w, self.v = reading.w, reading.v
        controller = self.controllers[self.active]
        if not following:
            controller.disengage()
        result = controller.command(rig, reading)
        if environment is not None:
            environment.step(result.f_cat)
        return result

    @property
    def force_on_catenary(self) -> float:
        """Force on the catenary at t_(k+1), N: with the correction force only while the rig follows the catenary."""
        result = self.result
        return result.f_cat if self.active == EnvironmentKind.CATENARY else result.f_predicted

    def _swap(self, wire: EnvironmentReading) -> None:
        """Hand over to the environment that is wanted, at t_k."""
        leaving = self._own[self.active]
        old = wire if leaving is None else leaving.reading()
        was, self.active = self.controllers[self.active], self._wanted
        environment = self._own[self.active]
        if environment is not None:
            environment.begin(old, self._mean or 0.0, wire)
        self.controllers[self.active].take_over(was)
