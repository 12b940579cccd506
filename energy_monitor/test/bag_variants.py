"""Variants of a recorded ride, written by other libraries than the ones under test read with."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import yaml
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer

Row = tuple[Any, int, bytes]
RIG = "/test_rig_sim/state"


def rows_of(bag: Path) -> list[Row]:
    """Read (connection, log time, message) of a whole bag."""
    with Reader(bag) as reader:
        return [(connection, time, bytes(data)) for connection, time, data in reader.messages()]


def write_rows(out: Path, rows: Sequence[Row], *, sqlite: bool = False, compression: str | None = None) -> Path:
    """Write a bag as rosbag2 does."""
    writer = Writer(out, version=9, storage_plugin=StoragePlugin.SQLITE3 if sqlite else StoragePlugin.MCAP)
    if compression:
        writer.set_compression(getattr(CompressionMode, compression), CompressionFormat.ZSTD)
    with writer:
        made: dict[str, Any] = {}
        for connection, time, data in rows:
            topic = connection.topic
            if topic not in made:
                text, digest = connection.msgdef.data, connection.digest
                made[topic] = writer.add_connection(topic, connection.msgtype, msgdef=text, rihs01=digest)
            writer.write(made[topic], time, data)
    return out


def write_mcap(
    file: Path,
    rows: Sequence[Row],
    *,
    definition: Callable[[Any], str] = lambda connection: connection.msgdef.data,
    encoding: Callable[[Any], str] = lambda connection: "cdr",
    silent: Sequence[str] = (),
    compression: CompressionType = CompressionType.ZSTD,
) -> Path:
    """Write a bare MCAP file by the reference library; topics that are `silent` are known and have no message."""
    with file.open("wb") as stream:
        writer = McapWriter(stream, chunk_size=20_000, compression=compression)
        writer.start("ros2", "test")
        channels: dict[str, int] = {}
        for connection, time, data in rows:
            topic = connection.topic
            if topic not in channels:
                schema = writer.register_schema(connection.msgtype, "ros2msg", definition(connection).encode())
                channels[topic] = writer.register_channel(topic, encoding(connection), schema)
            if topic not in silent:
                writer.add_message(channels[topic], time, data, time)
        writer.finish()
    return file


def write_split(out: Path, parts: Sequence[Sequence[Row]], names: Sequence[str], listed: Sequence[str] = ()) -> Path:
    """Write one file a part, and a metadata.yaml that lists `listed` if that is anything."""
    out.mkdir()
    for name, part in zip(names, parts, strict=True):
        write_mcap(out / name, part)
    if listed:
        information = {"relative_file_paths": list(listed), "compression_mode": ""}
        (out / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))
    return out


def with_cycle(data: bytes, cycle: int) -> bytes:
    """Give the message another cycle number: behind a header, at the next multiple of eight."""
    (length,) = struct.unpack_from("<I", data, 12)
    place = -(-(12 + length) // 8) * 8 + 4
    return data[:place] + struct.pack("<Q", cycle) + data[place + 8 :]
