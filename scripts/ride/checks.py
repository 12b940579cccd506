"""What has to fit together before a ride starts, and what is worth a word although it may be meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from catenary_model.build import reduced_of
from catenary_model.parameters import Parameters as CatenaryParameters
from catenary_model.reduced import NEWMARK_BETA, NEWMARK_GAMMA
from impedance_mpc.parameters import Parameters as ControllerParameters
from impedance_mpc.plant import Impedance
from impedance_mpc.switching import simulated_environments
from phil_base.parameter_file import reaches, read_parameter_file
from phil_base.parameters import Group, ParameterError

LISTENERS = ("impedance_mpc", "energy_monitor")
"""Nodes of a ride that listen to the rig's state; its recorder is counted by the ride itself."""
REST_OF_DELAY = 0.002
"""s, dead time that a rig's position loop has beyond whole cycles: the identified rigs have up to 1.04 ms."""


def nodes_of(pattern: str, nodes: tuple[str, ...]) -> tuple[str, ...]:
    """Give the nodes that an entry of a parameter file reaches: by name, or by wildcards."""
    return tuple(name for name in nodes if reaches("/" + pattern.lstrip("/"), f"/{name}"))


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


def files_of(params: Path | Sequence[Path] | None) -> tuple[Path, ...]:
    """Give the parameter files as a tuple: one, several or none."""
    return (params,) if isinstance(params, Path) else tuple(params or ())


def notices(params: Path | Sequence[Path] | None, settings: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Say what of a ride's parameters may be meant otherwise, one line each."""
    found = [*_of_files(files_of(params), tuple(settings))] if params else []
    return [*found, *_of_rclpy(settings), *_of_nodes(settings)]


def _of_files(files: Sequence[Path], nodes: tuple[str, ...]) -> Iterator[str]:
    file, params = read_parameter_file(*files), ", ".join(map(str, files))
    yield from file.readings()
    for pattern in dict.fromkeys(name for name, _ in file.nodes):
        if not nodes_of(pattern, nodes):
            listed = ", /".join(nodes)
            yield f"{params}: '{pattern}' is no node of this ride (they are /{listed}): not taken, as ROS does"


def _of_rclpy(settings: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    if any(values.get("use_sim_time") for values in settings.values()):
        yield "use_sim_time = True: the nodes take their time from /clock, which a ride does not publish"
    for key in sorted({key for values in settings.values() for key in values if key.startswith("qos_overrides")}):
        yield f"{key}: has no effect, the quality of service of the nodes' topics is fixed"


def _of_nodes(settings: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    controller, rig = settings["impedance_mpc"], settings["test_rig_sim"]
    ts, believed = rig["cycle_time"], controller["rig_delay"]
    whole = rig["command_delay"] * ts
    if not whole <= believed <= whole + max(ts, REST_OF_DELAY):
        yield (
            f"impedance_mpc.rig_delay = {believed * 1e3:g} ms does not fit test_rig_sim.command_delay = "
            f"{rig['command_delay']} cycles ({whole * 1e3:g} ms, and up to {max(ts, REST_OF_DELAY) * 1e3:g} ms besides)"
        )
    if rig["wait_for_subscribers"] > len(LISTENERS):
        yield (
            f"test_rig_sim.wait_for_subscribers = {rig['wait_for_subscribers']}: a ride itself has {len(LISTENERS)} "
            f"({', '.join(LISTENERS)}), cycle 0 waits for the others"
        )
    reach = rig["limits.position"]
    for key in ("position_minimum", "position_maximum"):
        if abs(controller[key]) > reach:
            yield f"impedance_mpc.{key} = {controller[key]:g} m is beyond test_rig_sim.limits.position = {reach:g} m"
    if controller["velocity_limit"] * ts > rig["limits.reference_step"]:
        yield (
            f"impedance_mpc.velocity_limit = {controller['velocity_limit']:g} m/s is more than "
            f"test_rig_sim.limits.reference_step = {rig['limits.reference_step']:g} m a cycle: such commands are "
            "refused"
        )
