"""Raw records of a bag: MCAP and sqlite3 files, whole, cut off, damaged or compressed, without ROS."""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path

from energy_monitor.bag_channel import BagError, Channel, Record, Source, Wanted
from energy_monitor.bag_compression import codec_of, decompress, decompress_file, is_compressed
from energy_monitor.bag_folder import open_source, storage_of
from energy_monitor.bag_mcap import MAGIC, mcap_batches
from energy_monitor.bag_sqlite import sqlite_batches

__all__ = ["BagError", "Channel", "Source", "Wanted", "file_batches", "open_source"]


def file_batches(source: Source, file: Path, wanted: Wanted) -> Iterator[list[Record]]:
    """Yield (channel, log time in ns, payload) of one file, of the channels that `wanted` accepts, as they lie in it.

    They come in lists of any length, and decompressed where messages are compressed one by one. Fills
    `source.channels` with every channel met, clears `source.complete` and adds notes where the file is cut off or
    damaged. Raises BagError for a file that is no bag.
    """
    for batch in _raw(source, file, wanted):
        # CDR begins with a zero byte, what compresses a message does not.
        if all(record[2][:1] == b"\0" for record in batch):
            yield batch
        else:
            yield [plain for record in batch if (plain := _decompressed(source, record)) is not None]


def _decompressed(source: Source, record: Record) -> Record | None:
    """Give a record whose message is not compressed; None, and a count, if it cannot be decompressed."""
    channel, log_time, payload = record
    if payload[:1] == b"\0" or (codec := codec_of(payload[:4])) is None:
        return record
    plain = decompress(codec, payload)
    if plain.problem is None:
        return channel, log_time, plain.data
    source.left_out[channel.topic, f"they cannot be decompressed ({plain.problem})"] += 1
    return None


def _raw(source: Source, file: Path, wanted: Wanted) -> Iterator[list[Record]]:
    if file.stat().st_size == 0:
        raise BagError(f"{file}: empty, nothing was recorded")
    with file.open("rb") as stream:
        compressed = codec_of(stream.read(4)) is not None
    storage = storage_of(file)
    if compressed or is_compressed(file):
        plain = decompress_file(file)
        if plain.problem:
            source.damaged(file, f"it cannot be decompressed to its end ({plain.problem})")
        if storage == "mcap":
            yield from mcap_batches(source, file, wanted, _checked(file, plain.data))
        else:
            yield from sqlite_batches(source, file, wanted, plain.data)
    elif storage == "sqlite3":
        yield from sqlite_batches(source, file, wanted)
    else:
        with file.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as mapped:
            yield from mcap_batches(source, file, wanted, _checked(file, mapped))


def _checked(file: Path, data: mmap.mmap | bytes) -> mmap.mmap | bytes:
    if len(data) < len(MAGIC) and MAGIC.startswith(data[:]):
        raise BagError(f"{file}: empty, cut off before anything was recorded")
    if data[: len(MAGIC)] != MAGIC:
        raise BagError(f"{file}: not an MCAP file (wrong magic bytes)")
    return data
