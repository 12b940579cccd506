"""What of a ride's parameters is worth a word before it starts, although it may be meant."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from phil_base.parameter_file import read_parameter_file
from phil_loop.builds import check_builds
from phil_loop.resolution import files_of, nodes_of

__all__ = ["LISTENERS", "REST_OF_DELAY", "check_builds", "notices"]

LISTENERS = ("impedance_mpc", "energy_monitor")
"""Nodes of a ride that listen to the rig's state; its recorder is counted by the ride itself."""
REST_OF_DELAY = 0.002
"""s, dead time that a rig's position loop has beyond whole cycles: the identified rigs have up to 1.04 ms."""


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
