"""CDR messages of one type into numpy columns, by whole batches instead of message by message.

Within a batch all messages whose strings and sequences have equal lengths share one memory layout; their bytes
are laid side by side and seen as a structured array. Only the fields asked for, and what lies before them, is
looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

from .bag_storage import BagError, Channel

Column = NDArray[Any] | list[Any]

_ENCAPSULATION = 4
_CODES = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


def types_of(channel: Channel) -> Typesdict:
    """Parse the message definition that a bag carries for a channel, with all types nested in it.

    Raises BagError if the bag carries none or one that cannot be parsed.
    """
    if not channel.definition:
        raise BagError(f"the bag holds no message definition for {channel.msgtype} ({channel.topic})")
    try:
        if channel.encoding == "ros2msg":
            return get_types_from_msg(channel.definition, channel.msgtype)
        types: Typesdict = {}
        for part in channel.definition.split("=" * 80 + "\n"):
            text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
            if text.strip():
                types.update(get_types_from_idl(text))
        return types
    except TypesysError as error:
        first = str(error).splitlines()[0]
        raise BagError(f"message definition of {channel.msgtype} cannot be parsed: {first}") from None


class _Leaf(NamedTuple):
    code: str
    offset: int
    length: int | None  # None: a scalar; else elements of an array, bytes of a string


@dataclass
class _Layout:
    """Where each wanted field lies in messages of one shape, and the lengths that make this shape."""

    leaves: dict[str, _Leaf] = field(default_factory=dict)
    lengths: dict[int, int] = field(default_factory=dict)


class Columns:
    """Collects the wanted fields of messages of one type; nested fields are named with a dot.

    Scalars become arrays of shape (messages,), strings and sequences lists with one entry a message.
    """

    BATCH = 4096

    def __init__(self, channel: Channel, fields: Sequence[str]) -> None:
        """Prepare for a channel; raises BagError if its type lacks a wanted field."""
        self.channel = channel
        self.fields = tuple(fields)
        self._types = types_of(channel)
        self._pending: list[bytes] = []
        self._parts: dict[str, list[Column]] = {name: [] for name in fields}
        known = {leaf for leaf, _ in self._flatten(channel.msgtype, "")}
        missing = [name for name in fields if name not in known]
        if missing:
            raise BagError(
                f"{channel.msgtype} in this bag has no field {', '.join(missing)}: it was recorded by another version "
                "of the nodes, and only that version's analysis fits it"
            )

    def add(self, payload: bytes) -> None:
        """Take one CDR payload."""
        self._pending.append(payload)
        if len(self._pending) == self.BATCH:
            self._flush()

    def finish(self) -> dict[str, Column]:
        """Return one column a field, in the order in which the messages came."""
        self._flush()
        result: dict[str, Column] = {}
        for name, parts in self._parts.items():
            if parts and isinstance(parts[0], np.ndarray):
                result[name] = np.concatenate(parts)
            else:
                result[name] = [entry for part in parts for entry in part]
        return result

    def _flatten(self, typename: str, prefix: str) -> list[tuple[str, tuple[Any, ...]]]:
        leaves: list[tuple[str, tuple[Any, ...]]] = []
        fields: Any = self._types[typename][1]
        for name, (kind, detail) in fields:
            if kind == Nodetype.NAME:
                leaves += self._flatten(detail, f"{prefix}{name}.")
            else:
                leaves.append((prefix + name, (kind, detail)))
        return leaves

    def _flush(self) -> None:
        payloads, self._pending = self._pending, []
        if not payloads:
            return
        columns: dict[str, Column] = {}
        by_size: dict[int, list[int]] = {}
        for index, payload in enumerate(payloads):
            by_size.setdefault(len(payload), []).append(index)
        for size, indices in by_size.items():
            rest = np.array(indices)
            while len(rest):
                block = np.frombuffer(b"".join([payloads[i] for i in rest]), np.uint8).reshape(-1, size)
                same = self._decode(block, rest, len(payloads), columns)
                rest = rest[~same]
        for name in self.fields:
            self._parts[name].append(columns[name])

    def _decode(
        self, block: NDArray[np.uint8], rows: NDArray[np.int64], total: int, columns: dict[str, Column]
    ) -> NDArray[np.bool_]:
        """Decode those rows of the block that have the first row's layout; tell which."""
        order = "<" if block[0, 1] & 1 else ">"
        layout = self._layout(block[0].tobytes(), order)
        same = block[:, 1] == block[0, 1]
        for offset, length in layout.lengths.items():
            found = np.ascontiguousarray(block[:, offset : offset + 4]).view(order + "u4")[:, 0]
            same &= found == length
        chosen, at = block[same], rows[same]
        for name, leaf in layout.leaves.items():
            width = np.dtype(leaf.code).itemsize * (1 if leaf.length is None else leaf.length)
            raw = np.ascontiguousarray(chosen[:, leaf.offset : leaf.offset + width])
            if leaf.length is None:
                values = raw.view(order + leaf.code)[:, 0]
                target = columns.setdefault(name, np.empty(total, values.dtype.newbyteorder("=")))
                assert isinstance(target, np.ndarray)
                target[at] = values
                continue
            listed = columns.setdefault(name, [None] * total)
            if leaf.code == "S1":
                for row, entry in zip(at, raw, strict=True):
                    listed[row] = entry[:-1].tobytes().decode("utf-8", "replace")
            else:
                array = raw.view(order + leaf.code) if leaf.length else np.empty((len(at), 0), leaf.code)
                for row, entry in zip(at, array, strict=True):
                    listed[row] = entry
        return same

    def _layout(self, payload: bytes, order: str) -> _Layout:
        layout = _Layout()
        position = 0  # behind the encapsulation, which alignment does not count
        last = set(self.fields)

        def align(width: int) -> None:
            nonlocal position
            position = -(-position // width) * width

        def length() -> int:
            nonlocal position
            align(4)
            at = position + _ENCAPSULATION
            value = int.from_bytes(payload[at : at + 4], "little" if order == "<" else "big")
            layout.lengths[at] = value
            position += 4
            return value

        for name, (kind, detail) in self._flatten(self.channel.msgtype, ""):
            base, count = detail, None
            if kind != Nodetype.BASE:
                (inner, base), bound = detail
                if inner != Nodetype.BASE or base[0] in ("string", "wstring"):
                    raise BagError(f"{self.channel.msgtype}.{name}: arrays of this type are not supported")
                count = bound if kind == Nodetype.ARRAY else length()
            if base[0] == "string":
                code, count = "S1", length()
            else:
                code = _CODES[base[0]]
                if count != 0:  # an empty sequence is not padded
                    align(np.dtype(code).itemsize)
            if name in last:
                layout.leaves[name] = _Leaf(code, position + _ENCAPSULATION, count)
                last.discard(name)
            position += np.dtype(code).itemsize * (1 if count is None else count)
            if not last:
                break
        if position + _ENCAPSULATION > len(payload):
            raise BagError(f"a message on {self.channel.topic} is shorter than its definition says")
        return layout
