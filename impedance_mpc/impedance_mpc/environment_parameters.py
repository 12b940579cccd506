"""Parameters of the environments that the rig can be made to behave like; part of the node's parameters."""

from __future__ import annotations

from phil_base.parameters import Group, parameter


class ReducedEnvironment(Group):
    """The reduced model on its own: what the rest of the catenary does to it is a weak spring and damper."""

    frequency_hz: float = parameter(
        "Natural frequency that the spring adds to every part of the segment", unit="Hz", low=0.05, high=20.0
    )
    damping_ratio: float = parameter("Damping ratio of the same", unit="1", low=0.0, high=2.0)


class MassSpringDamper(Group):
    """A plain mass on a spring and a damper."""

    mass: float = parameter("Mass", unit="kg", low=0.5, high=1000.0)
    stiffness: float = parameter("Stiffness of the spring", unit="N/m", low=0.0, high=1e5)
    damping: float = parameter("Damping", unit="N s/m", low=0.0, high=1e4)


class EnvironmentParameters(Group):
    """Environments beside the catenary."""

    mean_time: float = parameter(
        "Time over which the contact force is averaged that a new environment bears at rest",
        unit="s",
        low=0.05,
        high=60.0,
    )
    reduced: ReducedEnvironment
    mass_spring_damper: MassSpringDamper
