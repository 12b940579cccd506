"""One way to a moving catenary, whatever it is discretised by."""

from __future__ import annotations

from catenary_model import finite_difference, model
from catenary_model.boundary import impose
from catenary_model.config import Config
from catenary_model.moving_frame import assemble
from catenary_model.observed import MovingCatenary
from catenary_model.reduced import ReducedModel, reduce

__all__ = ["Config", "MovingCatenary", "build", "check", "check_ends", "reduced_of"]


def build(config: Config) -> MovingCatenary:
    """Build the model that `config.discretisation` names, at rest. Raises ValueError for what cannot be built.

    >>> build(Config()).cycle
    0
    """
    if config.discretisation == "fd":
        return finite_difference.Catenary(config)
    return model.Catenary(config)


def check(config: Config) -> None:
    """Refuse what cannot be built, without the costly parts. Raises ValueError naming what to change."""
    line = config.line
    if config.discretisation == "fd":
        finite_difference.check(config)
        return
    model.check_stability(config)
    frame = assemble(config.mesh, line.carrier, line.contact, config.speed)
    impose(config.boundary, frame, config.layer)
    reduce(config.mesh, line.contact, config.speed, config.segment_half_length)


def check_ends(config: Config) -> None:
    """Refuse ends that cannot be designed, the costly part that `check` leaves out. Raises ValueError."""
    if config.discretisation == "fd":
        finite_difference.design_ends(config)


def reduced_of(config: Config) -> ReducedModel:
    """Return the reduced model for the controller, without building the catenary. Raises ValueError."""
    mesh = finite_difference.segment_mesh(config) if config.discretisation == "fd" else config.mesh
    return reduce(mesh, config.line.contact, config.speed, config.segment_half_length)
