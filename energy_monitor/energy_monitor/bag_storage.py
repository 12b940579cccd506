"""Raw records of a bag: MCAP and sqlite3 files, whole or cut off, without ROS."""

from __future__ import annotations

import mmap
import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
_RECORD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")


class BagError(Exception):
    """A bag cannot be used; the message is one line for the person who named it."""


@dataclass(frozen=True)
class Channel:
    """One topic of a bag file: its name, message type and message definition (text, encoding)."""

    topic: str
    msgtype: str
    definition: str
    encoding: str


@dataclass
class Source:
    """The storage files of one bag, in order, and what reading them showed.

    `complete` turns false when a file ends without its footer, as after a SIGKILL.
    """

    path: Path
    files: tuple[Path, ...]
    storage: str
    message_compression: bool = False
    complete: bool = True
    channels: dict[str, Channel] = field(default_factory=dict)


Wanted = Callable[[Channel], bool]
Record = tuple[Channel, int, bytes]


def open_source(path: Path) -> Source:
    """Find the storage files behind a path: a bag directory, a directory that holds one, or a bare file.

    Raises BagError if there is none.
    """
    if not path.exists():
        raise BagError(f"{path}: no such file or directory")
    if path.is_file():
        return Source(path, (path,), _storage_of(path))
    if not path.is_dir():
        raise BagError(f"{path}: neither a folder nor a regular file")
    files = _files_in(path)
    if files:
        return _with_metadata(path, files)
    below = [child for child in sorted(path.iterdir()) if child.is_dir() and _files_in(child)]
    if len(below) == 1:
        return _with_metadata(below[0], _files_in(below[0]))
    if below:
        names = ", ".join(child.name for child in below)
        raise BagError(f"{path}: holds several bags ({names}), name one of them")
    raise BagError(f"{path}: no bag here (neither *.mcap nor *.db3)")


def records(source: Source, wanted: Wanted) -> Iterator[Record]:
    """Yield (channel, log time in ns, CDR payload) of the channels that `wanted` accepts, file by file.

    Fills `source.channels` with every channel met, and clears `source.complete` if a file is cut off.
    Raises BagError for a file that is no bag at all.
    """
    for file in source.files:
        storage = _storage_of(file)
        reader = _mcap_records if storage == "mcap" else _sqlite_records
        if not source.message_compression:
            yield from reader(source, file, wanted)
            continue
        decompress = _decompressor("zstd")
        for channel, log_time, payload in reader(source, file, wanted):
            yield channel, log_time, decompress(payload)


def _files_in(directory: Path) -> tuple[Path, ...]:
    return tuple(file for file in sorted(directory.iterdir()) if file.is_file() and _known(file))


def _known(file: Path) -> bool:
    return file.name.removesuffix(".zstd").endswith((".mcap", ".db3"))


def _storage_of(file: Path) -> str:
    name = file.name.removesuffix(".zstd")
    if name.endswith(".mcap"):
        return "mcap"
    if name.endswith(".db3"):
        return "sqlite3"
    with file.open("rb") as stream:
        head = stream.read(16)
    if head.startswith(MAGIC):
        return "mcap"
    if head.startswith(b"SQLite format 3"):
        return "sqlite3"
    raise BagError(f"{file}: not a bag (neither MCAP nor sqlite3)")


def _with_metadata(directory: Path, files: tuple[Path, ...]) -> Source:
    """Order split files as metadata.yaml lists them; without that file, by name and marked incomplete."""
    source = Source(directory, files, _storage_of(files[0]))
    metadata = directory / "metadata.yaml"
    try:
        information = yaml.safe_load(metadata.read_text())["rosbag2_bagfile_information"]
        listed = [directory / Path(name).name for name in information["relative_file_paths"]]
    except (OSError, UnicodeDecodeError, yaml.YAMLError, KeyError, TypeError):
        source.complete = False
        return source
    present = [file for file in listed if file.exists()]
    source.complete = len(present) == len(listed)
    source.files = tuple(present) or files
    source.message_compression = str(information.get("compression_mode", "")).lower() == "message"
    return source


# MCAP (https://mcap.dev/spec). A walker of our own and not a library reader: those take the index at the end
# for granted or read field by field; this one takes what is there, up to the last whole message.


@dataclass
class _McapState:
    source: Source
    file: Path
    wanted: Wanted
    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    channels: dict[int, Channel | None] = field(default_factory=dict)
    footer: bool = False


def _mcap_records(source: Source, file: Path, wanted: Wanted) -> Iterator[Record]:
    state = _McapState(source, file, wanted)
    if file.stat().st_size == 0:
        raise BagError(f"{file}: empty, nothing was recorded")
    with file.open("rb") as stream:
        if file.suffix == ".zstd":
            yield from _walk(state, memoryview(_decompressor("zstd")(stream.read())), len(MAGIC))
        else:
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
                if len(mapped) < len(MAGIC) and MAGIC.startswith(mapped[:]):
                    raise BagError(f"{file}: empty, cut off before anything was recorded")
                if mapped[: len(MAGIC)] != MAGIC:
                    raise BagError(f"{file}: not an MCAP file (wrong magic bytes)")
                with memoryview(mapped) as view:
                    yield from _walk(state, view, len(MAGIC))
    source.complete = source.complete and state.footer


def _walk(state: _McapState, data: memoryview, position: int) -> Iterator[Record]:
    """Walk records from `position` to the footer or to the first one that is cut off."""
    size = len(data)
    while position + _RECORD.size <= size:
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        position = start + length
        whole = position <= size
        if opcode == _CHUNK:
            yield from _chunk(state, data, start, min(position, size), whole)
        if not whole:
            return
        if opcode == _MESSAGE:
            identity, _, log_time, _ = _MESSAGE_HEAD.unpack_from(data, start)
            channel = state.channels.get(identity)
            if channel is not None:
                yield channel, log_time, bytes(data[start + _MESSAGE_HEAD.size : position])
        elif opcode == _SCHEMA:
            (identity,) = struct.unpack_from("<H", data, start)
            name, at = _string(data, start + 2)
            encoding, at = _string(data, at)
            text, _ = _string(data, at)
            state.schemas[identity] = (name, encoding, text)
        elif opcode == _CHANNEL:
            identity, schema = struct.unpack_from("<HH", data, start)
            topic, at = _string(data, start + 4)
            message_encoding, _ = _string(data, at)
            name, encoding, text = state.schemas.get(schema, ("", "", ""))
            channel = Channel(topic, name, text, encoding)
            state.source.channels.setdefault(topic, channel)
            use = message_encoding == "cdr" and state.wanted(channel)
            state.channels[identity] = channel if use else None
        elif opcode == _FOOTER:
            state.footer = data[position : position + len(MAGIC)] == MAGIC
            return


def _chunk(state: _McapState, data: memoryview, start: int, end: int, whole: bool) -> Iterator[Record]:
    if end - start < _CHUNK_HEAD.size + 4:
        return
    try:
        compression, at = _string(data, start + _CHUNK_HEAD.size)
    except struct.error:
        return
    at += 8  # length of the compressed data: all up to `end`
    if at >= end:
        return
    with data[at:end] as content:
        if compression == "":
            yield from _walk(state, content, 0)
            return
        try:
            plain = _decompressor(compression)(bytes(content))
        except BagError:
            raise
        except Exception as error:  # each codec has an exception type of its own
            if whole:
                raise BagError(f"{state.file}: a chunk is damaged ({error})") from None
            return  # too little of the last chunk to decompress
    yield from _walk(state, memoryview(plain), 0)


def _string(data: memoryview, position: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, position)
    end = position + 4 + length
    return str(data[position + 4 : end], "utf-8", "replace"), end


def _decompressor(name: str) -> Callable[[bytes], bytes]:
    """Streaming decompression, so that a block that is cut off gives what it holds."""
    try:
        if name == "zstd":
            import zstandard

            return lambda data: bytes(zstandard.ZstdDecompressor().decompressobj().decompress(data))
        if name == "lz4":
            import lz4.frame  # type: ignore[import-untyped]

            return lambda data: bytes(lz4.frame.LZ4FrameDecompressor().decompress(data))
    except ImportError as error:
        raise BagError(f"the bag is compressed by {name}: Python package {error.name} is missing") from None
    raise BagError(f"the bag is compressed by {name!r}, which is not supported")


# sqlite3 (rosbag2's older storage)


def _sqlite_records(source: Source, file: Path, wanted: Wanted) -> Iterator[Record]:
    if file.suffix == ".zstd":
        raise BagError(f"{file}: decompress it first (zstd -d)")
    log = file.with_name(file.name + "-wal")
    mode = "mode=ro" if log.exists() else "mode=ro&immutable=1"
    try:
        with closing(sqlite3.connect(f"file:{file}?{mode}", uri=True)) as connection:
            channels = _sqlite_channels(connection)
            for channel in channels.values():
                source.channels.setdefault(channel.topic, channel)
            used = {identity: channel for identity, channel in channels.items() if wanted(channel)}
            marks = ",".join("?" * len(used))
            query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
            for identity, log_time, payload in connection.execute(query, tuple(used)):
                yield used[identity], log_time, payload
    except sqlite3.DatabaseError as error:
        if not source.channels:
            raise BagError(f"{file}: not a bag that can be read ({error})") from None
        source.complete = False


def _sqlite_channels(connection: sqlite3.Connection) -> dict[int, Channel]:
    definitions: dict[str, tuple[str, str]] = {}
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
        rows: list[Any] = connection.execute(
            "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
        ).fetchall()
        definitions = {name: (text, encoding) for name, text, encoding in rows}
    return {
        identity: Channel(topic, msgtype, *definitions.get(msgtype, ("", "")))
        for identity, topic, msgtype in connection.execute("SELECT id, name, type FROM topics")
    }
