"""Compressed files, chunks and messages, told by their first bytes and decompressed in memory."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from energy_monitor.bag_channel import BagError

ZSTD, LZ4, GZIP = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18", b"\x1f\x8b"
SUFFIXES = (".zstd", ".zst", ".lz4", ".gz")
_SKIPPABLE = tuple(bytes([0x50 + n]) + b"\x2a\x4d\x18" for n in range(16))
_BLOCK = 1 << 17
_FOREIGN = {
    b"PK\x03\x04": "a zip archive: unpack it first and name what was in it",
    b"7z\xbc\xaf": "a 7-zip archive: unpack it first and name what was in it",
    b"Rar!": "a rar archive: unpack it first and name what was in it",
    b"BZh": "compressed by bzip2: decompress it first (bunzip2 --keep) and name the new file",
    b"\xfd7zXZ": "compressed by xz: decompress it first (unxz --keep) and name the new file",
    b"#ROSBAG": "a bag of ROS 1: convert it first (rosbags-convert --src BAG --dst FOLDER)",
}


class Plain(NamedTuple):
    """What came out of a compressed block, and what ended it before its end (None: it is whole)."""

    data: bytes
    problem: str | None


def foreign(head: bytes) -> str | None:
    """Say what a file is that begins with `head` and is no bag, and what to do; None if that is not known."""
    return next((text for magic, text in _FOREIGN.items() if head.startswith(magic)), None)


def codec_of(head: bytes) -> str | None:
    """Name the compression of what begins with `head`; None if it is none that is known here."""
    if head.startswith((ZSTD, *_SKIPPABLE)):
        return "zstd"
    return "lz4" if head.startswith(LZ4) else "gzip" if head.startswith(GZIP) else None


def is_compressed(file: Path) -> bool:
    """Tell from a file's name whether it is compressed as a whole."""
    return file.suffix.lower() in SUFFIXES


def plain_name(file: Path) -> str:
    """Give the name of a file without what its compression added, in lower case."""
    name = file.name.lower()
    return next((name.removesuffix(suffix) for suffix in SUFFIXES if name.endswith(suffix)), name)


def decompress(codec: str, data: bytes) -> Plain:
    """Decompress frame after frame as far as it goes: a block that is cut off or damaged gives what it holds.

    Raises BagError for a codec that is not supported or not installed.
    """
    begin, error_type = _codec(codec)
    parts: list[bytes] = []
    rest = memoryview(data)
    while len(rest):
        if bytes(rest[:4]) in _SKIPPABLE and len(rest) >= 8:
            rest = rest[8 + int.from_bytes(rest[4:8], "little") :]
            continue
        frame = begin()
        while len(rest) and not frame.eof:
            block, rest = rest[:_BLOCK], rest[_BLOCK:]
            try:
                parts.append(frame.decompress(block))
            except error_type as error:
                return Plain(b"".join(parts), " ".join(str(error).split()))
        if not frame.eof:
            return Plain(b"".join(parts), "cut off")
        if unused := len(frame.unused_data or b""):
            rest = memoryview(data)[len(data) - len(rest) - unused :]
            if codec_of(bytes(rest[:4])) != codec:
                return Plain(b"".join(parts), "followed by something else")
    return Plain(b"".join(parts), None)


def decompress_file(file: Path) -> Plain:
    """Decompress a file that is compressed as a whole; raises BagError if there is nothing in it to be had."""
    data = file.read_bytes()
    codec = codec_of(data[:4])
    if codec is None:
        what = foreign(data[:8]) or "not compressed as its name says: an interrupted or failed copy?"
        raise BagError(f"{file}: {what if data else 'empty'}")
    plain = decompress(codec, data)
    if not plain.data:
        raise BagError(f"{file}: cannot be decompressed ({codec}: {plain.problem or 'nothing in it'})")
    return plain


def _codec(name: str) -> tuple[Callable[[], Any], type[Exception] | tuple[type[Exception], ...]]:
    try:
        if name == "zstd":
            import zstandard

            return zstandard.ZstdDecompressor().decompressobj, zstandard.ZstdError
        if name == "lz4":
            import lz4.frame  # type: ignore[import-untyped]

            return lz4.frame.LZ4FrameDecompressor, (RuntimeError, EOFError, ValueError)
        if name == "gzip":
            return lambda: zlib.decompressobj(wbits=31), zlib.error
    except ImportError as error:
        raise BagError(f"the bag is compressed by {name}: Python package {error.name} is missing") from None
    raise BagError(f"the bag is compressed by {name!r}, which is not supported")
