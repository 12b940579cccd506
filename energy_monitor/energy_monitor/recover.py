"""A bag that was cut off, written anew with index and metadata, so that every reader takes it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, WriterError
from rosbags.rosbag2.metadata import parse_qos

from energy_monitor.bag_channel import CDR, BagError, Channel, Source
from energy_monitor.bag_columns import store_of
from energy_monitor.bag_folder import base_name
from energy_monitor.bag_storage import file_batches, open_source
from energy_monitor.definitions import SEPARATOR, UNKNOWN_DIGEST
from energy_monitor.recorder import SteadyWriter


@dataclass
class Recovered:
    """Where the new bag is, how many messages and topics it holds, and what is to be said of the old one."""

    path: Path
    messages: int = 0
    topics: int = 0
    notes: list[str] = field(default_factory=list)


def recover(bag: Path, out: Path | None = None) -> Recovered:
    """Copy every message that can be read of `bag` to a new bag `out` (BAG_recovered beside it); `bag` stays as it is.

    Raises
    ------
    BagError
        There is nothing to be read, or `out` exists already or cannot be written.
    """
    try:
        source = open_source(bag)
        folder, name = base_name(source.path)
        path = out or folder / f"{name}_recovered"
        writer = SteadyWriter(path, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.open()
    except WriterError as error:
        raise BagError(str(error)) from None
    except OSError as error:
        raise BagError(f"{error.filename or bag}: {error.strerror or error}") from None
    found = Recovered(path)
    try:
        _copy(source, writer, found)
        writer.close()
    except (OSError, WriterError) as error:
        raise BagError(f"{path}: {getattr(error, 'strerror', None) or error}") from None
    finally:
        if not writer.metapath.exists():  # what is no bag is not left behind
            with suppress(OSError):  # on a full disk even that fails
                if writer.storage is not None:
                    writer.abort()
            shutil.rmtree(path, ignore_errors=True)
    found.topics = len(writer.connections)
    found.notes += [note for note in source.notes if "--recover" not in note]
    found.notes += [f"{count} messages on {topic}: {why}." for (topic, why), count in source.left_out.items()]
    return found


def _copy(source: Source, writer: SteadyWriter, found: Recovered) -> None:
    connections: dict[int, tuple[Channel, Connection | None]] = {}
    for file in source.files:
        for channel, log_time, payload in chain.from_iterable(file_batches(source, file, lambda _: True)):
            entry = connections.get(id(channel))
            if entry is None:
                entry = connections[id(channel)] = (channel, _connect(source, writer, channel))
            if entry[1] is None:
                source.left_out[channel.topic, "left out, they are not encoded as cdr"] += 1
                continue
            writer.write(entry[1], log_time, payload)
            found.messages += 1
    for topic, channel in source.channels.items():  # those without a message
        if topic not in {connection.topic for connection in writer.connections}:
            _connect(source, writer, channel)
    if not found.messages:
        raise BagError(f"{source.path}: no message in it can be read")


def _connect(source: Source, writer: SteadyWriter, channel: Channel) -> Connection | None:
    if channel.message_encoding != CDR:
        return None
    text, digest = _definition(source, channel)
    for connection in writer.connections:
        if connection.msgtype == channel.msgtype and connection.msgdef.data != text:
            raise BagError(f"{source.path} holds two definitions of {channel.msgtype}: recover its files one by one")
        if connection.topic == channel.topic and connection.msgtype == channel.msgtype:
            return connection
    return writer.add_connection(
        channel.topic, channel.msgtype, msgdef=text, rihs01=digest, offered_qos_profiles=_profiles(channel)
    )


def _definition(source: Source, channel: Channel) -> tuple[str, str]:
    """Give definition and hash; none where there is one that would make readers refuse the whole bag."""
    try:
        digest = store_of(channel).hash_rihs01(channel.msgtype)
    except BagError as error:
        source.note(f"{channel.topic} is in the new bag without its definition: {error}.")
        return "", UNKNOWN_DIGEST
    definition = channel.definition.replace("\r\n", "\n")
    header = f"{SEPARATOR}\nIDL: "
    idl = channel.encoding != "ros2msg" and not definition.startswith(header)
    return (f"{header}{channel.msgtype}\n{definition}" if idl else definition), digest


def _profiles(channel: Channel) -> Sequence[Qos]:
    try:
        return parse_qos(channel.metadata.get("offered_qos_profiles", ""))
    except Exception:  # of whichever kind: a player then offers its usual quality of service
        return ()
