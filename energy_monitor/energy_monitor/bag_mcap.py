"""MCAP files (https://mcap.dev/spec), whole, cut off or damaged.

A walker of our own and not a library reader: those take the index at the end for granted or read field by field; this
one takes what is there, and goes on behind what is damaged.
"""

from __future__ import annotations

import bisect
import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from energy_monitor.bag_channel import BATCH, Channel, Record, Source, Wanted, type_name
from energy_monitor.bag_compression import decompress

MAGIC = b"\x89MCAP0\r\n"
_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _CHUNK_INDEX, _DATA_END = 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x0F
_PRIVATE = 0x80
"""Opcodes from here on are an application's own."""
_RECORD = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQI")
_CHUNK_PLACE = struct.Struct("<QQQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_WHOLE_MESSAGE = struct.Struct("<BQHIQQ")
_FOOTER_SIZE = _RECORD.size + 20
_RELEASED = 1 << 26
"""Bytes of a mapped file behind which its pages are given back: else all of it counts as this process' memory."""
_LATEST = 2**63 - 1


@dataclass
class _State:
    source: Source
    file: Path
    wanted: Wanted
    mapped: mmap.mmap | None = None
    released: int = 0
    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    used: dict[int, bool] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)
    """Where chunks begin, as the index at the end says."""
    footer: bool = False

    def damaged(self, what: str) -> None:
        self.source.damaged(self.file, what)

    def release(self, position: int) -> None:
        """Give the pages of the mapped file before a position back; what is read of them again is read again."""
        if self.mapped is not None and position - self.released >= _RELEASED and hasattr(mmap, "MADV_DONTNEED"):
            end = position // mmap.PAGESIZE * mmap.PAGESIZE
            self.mapped.madvise(mmap.MADV_DONTNEED, self.released, end - self.released)
            self.released = end


def mcap_batches(source: Source, file: Path, wanted: Wanted, data: mmap.mmap | bytes) -> Iterator[list[Record]]:
    """Yield the records, in batches, of one MCAP file whose content is `data`."""
    state = _State(source, file, wanted, data if isinstance(data, mmap.mmap) else None)
    with memoryview(data) as view:
        _summary(state, view)
        yield from _walk(state, view, len(MAGIC), top=True)
    if not state.footer:
        source.cut_off(file)


def _summary(state: _State, data: memoryview) -> None:
    """Read channels and places of chunks from the end of a whole file, in case that the front is damaged."""
    tail = len(data) - len(MAGIC)
    begin = tail - _FOOTER_SIZE
    if begin < len(MAGIC) or data[tail:] != MAGIC or data[begin] != _FOOTER:
        return
    state.footer = True
    (position,) = struct.unpack_from("<Q", data, begin + _RECORD.size)
    while len(MAGIC) <= position < begin:
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        position = start + length
        if position > begin:
            return
        _declare(state, opcode, data[start:position])
        if opcode == _CHUNK_INDEX and length >= _CHUNK_PLACE.size:
            state.chunks.append(_CHUNK_PLACE.unpack_from(data, start)[2])
    state.chunks.sort()


def _declare(state: _State, opcode: int, record: memoryview) -> None:
    """Take a schema or a channel; one that is damaged is none."""
    try:
        if opcode == _SCHEMA:
            (identity,) = struct.unpack_from("<H", record)
            name, at = _string(record, 2)
            encoding, at = _string(record, at)
            text, _ = _string(record, at)
            state.schemas[identity] = (type_name(name), encoding, text)
        elif opcode == _CHANNEL:
            identity, schema = struct.unpack_from("<HH", record)
            topic, at = _string(record, 4)
            message_encoding, at = _string(record, at)
            name, encoding, text = state.schemas.get(schema, ("", "", ""))
            channel = Channel(topic, name, text, encoding, message_encoding, _map(record, at))
            if state.channels.get(identity) != channel:
                state.channels[identity] = channel
                state.source.channels.setdefault(topic, channel)
                state.used[identity] = state.wanted(channel)
    except struct.error:
        state.damaged("a schema or channel in it cannot be read")


def _walk(state: _State, data: memoryview, position: int, *, top: bool) -> Iterator[list[Record]]:
    """Walk records from `position` to the footer or to the first one that is cut off; `top` outside of chunks."""
    size = len(data)
    batch: list[Record] = []
    while True:
        position = _messages(state, data, position, batch)
        if batch:
            yield batch
        full, batch = len(batch) == BATCH, []
        if full:
            continue
        if position + _RECORD.size > size:
            return
        opcode, length = _RECORD.unpack_from(data, position)
        start = position + _RECORD.size
        end = start + length
        if top and state.footer and (end > size or opcode == 0 or _DATA_END < opcode < _PRIVATE):
            position = _resume(state, position, size)
            continue
        if opcode == _CHUNK:
            yield from _chunk(state, data[start : min(end, size)], whole=end <= size)
            if top:
                state.release(min(end, size))
        if end > size:
            return
        if opcode == _MESSAGE:
            _odd_message(state, data[start:end])
        elif opcode in (_SCHEMA, _CHANNEL):
            _declare(state, opcode, data[start:end])
        elif opcode in (_FOOTER, _DATA_END) and top:
            # Files that were put one behind the other (cat) go on behind the end of the first.
            behind = bytes(data[end:]).find(MAGIC + MAGIC)
            if behind < 0:
                return
            end += behind + 2 * len(MAGIC)
        position = end


def _messages(state: _State, data: memoryview, position: int, batch: list[Record]) -> int:
    """Put the messages that follow each other from `position` on into a batch; give the place behind the last of them.

    A batch is full with the first that is not one, that is cut off, or of which something is to be said. Most of a bag
    goes through this loop.
    """
    last = len(data) - _WHOLE_MESSAGE.size
    size, unpack, used, channels, append = (
        len(data),
        _WHOLE_MESSAGE.unpack_from,
        state.used,
        state.channels,
        batch.append,
    )
    while position <= last and len(batch) < BATCH:
        opcode, length, identity, _, log_time, _ = unpack(data, position)
        end = position + _RECORD.size + length
        if opcode != _MESSAGE or end > size or length < _MESSAGE_HEAD.size or log_time > _LATEST:
            return position
        wanted = used.get(identity)
        if wanted:
            append((channels[identity], log_time, bytes(data[position + _WHOLE_MESSAGE.size : end])))
        elif wanted is None:
            return position
        position = end
    return position


def _odd_message(state: _State, record: memoryview) -> None:
    """Say why a message cannot be used, if anybody wants it."""
    if len(record) < _MESSAGE_HEAD.size:
        state.damaged("a message in it is too short")
        return
    identity, _, _, _ = _MESSAGE_HEAD.unpack_from(record)
    if identity not in state.channels:
        state.damaged("messages in it belong to no topic that it knows")
    elif state.used.get(identity):
        state.source.left_out[state.channels[identity].topic, "their log time is damaged"] += 1


def _resume(state: _State, position: int, size: int) -> int:
    """Find the next chunk behind a damaged record by the index at the end; `size` if there is none."""
    index = bisect.bisect_right(state.chunks, position)
    following = state.chunks[index] if index < len(state.chunks) else size
    state.damaged(f"{following - position} bytes from byte {position} on cannot be read and are left out")
    return following


def _chunk(state: _State, data: memoryview, *, whole: bool) -> Iterator[list[Record]]:
    if len(data) < _CHUNK_HEAD.size + 4:
        return
    begin, _, _, checksum = _CHUNK_HEAD.unpack_from(data)
    try:
        compression, at = _string(data, _CHUNK_HEAD.size)
    except struct.error:
        if whole:
            state.damaged("a chunk cannot be read and is left out")
        return
    content = data[at + 8 :]  # behind the length of the compressed data, which is all there is
    if not compression:
        plain, problem = content, None
    else:
        unpacked = decompress(compression, bytes(content))
        plain, problem = memoryview(unpacked.data), unpacked.problem
    if not whole:  # what there is of the last chunk is taken
        yield from _walk(state, plain, 0, top=False)
        return
    if problem is None and checksum and zlib.crc32(plain) != checksum:
        problem = "its checksum is wrong"
    if problem is None:
        yield from _walk(state, plain, 0, top=False)
        return
    state.damaged(f"a chunk of {len(data)} bytes that begins at log time {begin} ns is left out ({problem})")


def _string(data: memoryview, position: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", data, position)
    end = position + 4 + length
    if end > len(data):
        raise struct.error("a text reaches beyond its record")
    return str(data[position + 4 : end], "utf-8", "replace"), end


def _map(data: memoryview, position: int) -> dict[str, str]:
    """Read the metadata of a channel; empty if there is none."""
    (length,) = struct.unpack_from("<I", data, position)
    position, end = position + 4, position + 4 + length
    found = {}
    while position < min(end, len(data)):
        key, position = _string(data, position)
        found[key], position = _string(data, position)
    return found
