"""Whether what parameters describe can be built, said before anything is."""

from __future__ import annotations

from collections.abc import Mapping

from catenary_model.build import reduced_of
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import simulated_environments
from phil_base.parameters import Group, ParameterError


def check_builds(groups: Mapping[str, Group]) -> None:
    """Refuse what a node would refuse only when it is configured.

    Raises
    ------
    ParameterError
        One line a problem, with the node.
    """
    problems = []
    for name, group in groups.items():
        try:
            group.check_build()
        except ValueError as error:
            problems += [f"{name}: {line}" for line in str(error).splitlines()]
    catenary, controller = groups.get("catenary_model"), groups.get("impedance_mpc")
    if not problems and isinstance(catenary, CatenaryParameters) and isinstance(controller, ControllerParameters):
        try:
            _check_controller(catenary, controller)
        except ValueError as error:
            problems.append(f"impedance_mpc: {error}")
    if problems:
        raise ParameterError("\n".join(problems))


def _check_controller(catenary: CatenaryParameters, controller: ControllerParameters) -> None:
    """Try what the controller makes of the catenary's reduced model."""
    config = catenary.config()
    reduced, ts = reduced_of(config), config.cycle_time
    model = Impedance(reduced.M, reduced.D, reduced.K, reduced.b, reduced.b, ts, NEWMARK_BETA, NEWMARK_GAMMA)
    simulated_environments(controller, model)
