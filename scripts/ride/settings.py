"""What a ride ran with, as files; how parameters are resolved is in `phil_loop.resolution`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from catenary_model.line_file import LineFileError, dump_line, preset_names
from catenary_model.parameters import line_of
from phil_base.atomic import write_text
from phil_base.parameters import ParameterError, nest
from phil_base.yaml_file import dump_yaml
from phil_loop.resolution import (
    CLOCKS,
    FOLLOWS,
    NODES,
    Settings,
    as_ordinary,
    resolve,
    rig_layer,
    rig_names,
)

__all__ = [
    "CLOCKS",
    "FOLLOWS",
    "NODES",
    "Settings",
    "as_ordinary",
    "line_text",
    "pantograph_text",
    "resolve",
    "rig_layer",
    "rig_names",
    "write",
]


def line_text(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """Give the description of the overhead line that the settings name, as the text of a YAML file.

    Raises
    ------
    ParameterError
        There is no such line any more, or it is unusable.
    """
    name = settings["catenary_model"]["line"]
    try:
        line = line_of(name)
    except LineFileError as error:
        raise ParameterError(f"catenary_model: parameter 'line': {error}") from None
    lead = "# The overhead line of this ride. To ride on it again: scripts/run.sh --line THIS_FILE\n"
    return lead + dump_line(line)


def pantograph_text(settings: Mapping[str, Mapping[str, Any]]) -> str:
    """Give the text of the file that describes the pantograph; empty if the settings name none.

    Raises
    ------
    ParameterError
        The file is not there any more.
    """
    rig = settings["test_rig_sim"]
    if rig["pantograph"] != "state_space" or not rig["pantograph_file"]:
        return ""
    try:
        return Path(rig["pantograph_file"]).expanduser().read_text(encoding="utf-8")
    except OSError as error:
        raise ParameterError(f"test_rig_sim: parameter 'pantograph_file': {error}") from None


def write(settings: Mapping[str, Mapping[str, Any]], line: str, folder: Path, pantograph: str = "") -> None:
    """Write `params.yaml`, a ROS parameter file that gives the same ride again, and `line.yaml`, its overhead line.

    A line that was given as a file is taken from the copy: what happens to the file later does not matter. So is a
    pantograph whose text (`pantograph_text`) is given, from `pantograph.yaml`.
    """
    write_text(folder / "line.yaml", line)
    tree = {name: {"ros__parameters": nest(values)} for name, values in settings.items()}
    catenary = tree["catenary_model"]["ros__parameters"]
    if catenary["line"] not in preset_names():
        catenary["line"] = str((folder / "line.yaml").absolute())
    if pantograph:
        write_text(folder / "pantograph.yaml", pantograph)
        tree["test_rig_sim"]["ros__parameters"]["pantograph_file"] = str((folder / "pantograph.yaml").absolute())
    lead = "# Everything that this ride ran with. To ride the same again: scripts/run.sh --params THIS_FILE\n"
    write_text(folder / "params.yaml", lead + dump_yaml(tree))
