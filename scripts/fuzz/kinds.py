"""The kinds of files that are damaged, and good examples of each: those that come with the packages, and a real bag."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fuzz import words
from phil_base.parameters import config_file


@dataclass(frozen=True)
class Example:
    """A good file, or a folder with one: ``name`` is what is damaged, ``beside`` what lies there besides.

    ``form`` (text, bytes, database, words) says which damages make sense.
    """

    name: str
    content: bytes = field(repr=False)
    form: str = "text"
    beside: Mapping[str, bytes] = field(default_factory=dict, repr=False)

    def lay(self, folder: Path, content: bytes | None = None) -> Path:
        """Write the example into a folder, with another content; give what a reader is given: the file, or ``ride``."""
        whole = {self.name: self.content if content is None else content, **self.beside}
        for name, data in whole.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        return folder / self.name.split("/")[0]


@dataclass(frozen=True)
class Kind:
    """A kind of file: which entries read it, the memory in MiB that a case may take, and whether lines may be many."""

    name: str
    entries: tuple[str, ...]
    examples: Callable[[Path | None], list[Example]]
    most_mib: float
    several: bool
    naming: str = ""
    """Pattern of what a line may name in place of file or parameter."""


def _parameter_files(bag: Path | None) -> list[Example]:
    rigs = sorted(config_file("test_rig_sim", "rigs/nominal.yaml").parent.glob("*.yaml"))
    identified = sorted(config_file("impedance_mpc", "identified/nominal.yaml").parent.glob("*.yaml"))
    nodes = ("catenary_model", "impedance_mpc", "test_rig_sim", "energy_monitor")
    files = [*(config_file(node, f"{node}.yaml") for node in nodes), *rigs, *identified]
    mine = (
        b"/**:\n  ros__parameters: {use_sim_time: false}\n"
        b"/test_rig_sim:\n  ros__parameters:\n    limits: {speed: 1.5}\n"
    )
    return [*(Example("rig.yaml", file.read_bytes()) for file in files), Example("rig.yaml", mine)]


def _lines(bag: Path | None) -> list[Example]:
    from catenary_model import line_file

    presets = sorted((Path(line_file.__file__).parent / "lines").glob("*.yaml"))
    shown = str(line_file.__doc__).split("\n\n")[1]
    return [Example("line.yaml", text) for text in (*(file.read_bytes() for file in presets), shown.encode())]


def _pantographs(bag: Path | None) -> list[Example]:
    shipped = config_file("test_rig_sim", "pantograph_en50318.yaml").read_bytes()
    matrices = (
        b"kind: state_space\nA: [[0.0, 1.0], [-400.0, -8.0]]\nB: [[0.0, 0.0], [0.1, -0.1]]\nC: [1.0, 0.0]\n"
        b"inputs: [lift, contact_force]\n"
    )
    return [Example("pantograph.yaml", content) for content in (shipped, matrices)]


def _trajectories(bag: Path | None) -> list[Example]:
    rows = [f"{0.1 * i:.3f}, {0.01 * math.sin(0.2 * math.pi * i):.6f}" for i in range(31)]
    plain = "\n".join(["# s, m", "time, position", *rows, ""]).encode()
    return [Example("trajectory.csv", plain), Example("trajectory.csv", "\n".join(rows[:3]).encode())]


def _contact_limits(bag: Path | None) -> list[Example]:
    return [Example("limits.yaml", config_file("energy_monitor", "contact_force_limits.yaml").read_bytes())]


def _report_limits(bag: Path | None) -> list[Example]:
    return [Example("limits.yaml", config_file("energy_monitor", "report_limits.yaml").read_bytes())]


def _bags(bag: Path | None) -> list[Example]:
    assert bag is not None
    forms = bag_forms(bag)
    found = [
        Example(f"ride/bag/{name}", data, "bytes" if name.endswith("mcap") else "database") for name, data in forms
    ]
    plain = {f"ride/bag/{forms[0][0]}": forms[0][1]}
    metadata = (bag / "metadata.yaml").read_bytes()
    parameters = bag.parent / "params.yaml"
    beside = {"ride/params.yaml": parameters.read_bytes()} if parameters.is_file() else {}
    found.append(Example("ride/bag/metadata.yaml", metadata, beside=plain | beside))
    if beside:
        found.append(Example("ride/params.yaml", beside["ride/params.yaml"], beside=plain))
    return found


def bag_forms(bag: Path, cycles: int = 40) -> list[tuple[str, bytes]]:
    """Give the first cycles of a bag as MCAP in one piece, in compressed chunks, and as sqlite3: name and content."""
    from rosbags.rosbag2 import Reader, StoragePlugin, Writer

    with Reader(bag) as reader:
        rows = [(connection, time, bytes(data)) for connection, time, data in reader.messages()]
    states = [time for connection, time, _ in rows if connection.topic.endswith("test_rig_sim/state")]
    end = states[min(cycles, len(states) - 1)]
    rows = [row for row in rows if row[1] <= end]
    with TemporaryDirectory(prefix="phil_fuzz_") as name:
        folder = Path(name)
        writer = Writer(folder / "sqlite", version=9, storage_plugin=StoragePlugin.SQLITE3)
        with writer:
            made = {}
            for connection, time, data in rows:
                if connection.topic not in made:
                    text, digest = connection.msgdef.data, connection.digest
                    made[connection.topic] = writer.add_connection(
                        connection.topic, connection.msgtype, msgdef=text, rihs01=digest
                    )
                writer.write(made[connection.topic], time, data)
        database = next((folder / "sqlite").glob("*.db3")).read_bytes()
    return [
        ("ride.mcap", _mcap(rows, chunks=False)),
        ("ride.mcap", _mcap(rows, chunks=True)),
        ("ride.db3", database),
    ]


def _mcap(rows: list[tuple[Any, int, bytes]], *, chunks: bool) -> bytes:
    from mcap.writer import CompressionType, Writer

    stream = io.BytesIO()
    compression = CompressionType.ZSTD if chunks else CompressionType.NONE
    writer = Writer(stream, chunk_size=20_000, compression=compression, use_chunking=chunks)
    writer.start("ros2", "phil")
    channels: dict[str, int] = {}
    for connection, time, data in rows:
        topic = connection.topic
        if topic not in channels:
            schema = writer.register_schema(connection.msgtype, "ros2msg", connection.msgdef.data.encode())
            channels[topic] = writer.register_channel(topic, "cdr", schema)
        writer.add_message(channels[topic], time, data, time)
    writer.finish()
    return stream.getvalue()


OPTION = r"--[a-z]|^ROS |rcl: |^\S*[./]\S*: .|^.+: cannot be read: "
"""What a line about a command line names: an option, or a file that one names."""


def _command_lines(bag: Path | None) -> list[Example]:
    parameters = _parameter_files(None)[-1].content
    beside = {"file": b"a file\n", "ride/params.yaml": parameters}
    recorded = {"ride/bag/ride.mcap": bag_forms(bag)[0][1]} if bag is not None else {}
    if bag is not None and (bag.parent / "params.yaml").is_file():
        recorded["ride/params.yaml"] = (bag.parent / "params.yaml").read_bytes()
    return [
        Example("arguments", words.content(name, line), "words", beside | recorded)
        for name, lines in words.examples().items()
        for line in lines
    ]


KINDS = {
    kind.name: kind
    for kind in (
        Kind("yaml", ("yaml",), _parameter_files, 256.0, True),
        Kind("line", ("line",), _lines, 256.0, True),
        Kind("pantograph", ("pantograph",), _pantographs, 128.0, True),
        Kind("trajectory", ("trajectory",), _trajectories, 256.0, True),
        Kind("limits", ("limits",), _contact_limits, 128.0, False),
        Kind("report-limits", ("report_limits",), _report_limits, 128.0, False),
        Kind("bag", ("report", "recover"), _bags, 512.0, False),
        Kind("command-line", ("command",), _command_lines, 512.0, True, OPTION),
    )
}
