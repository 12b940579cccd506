"""CDR messages of one type into numpy columns, by whole batches instead of message by message.

Within a batch all messages whose strings and sequences have equal lengths share one memory layout; their bytes
are laid side by side and seen as a structured array. Only the fields asked for, and what lies before them, is
looked at.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Typesdict
from rosbags.typesys import Stores, TypesysError, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from energy_monitor.bag_channel import BagError, Channel, DefinitionError

Column = NDArray[Any] | list[Any]

_ENCAPSULATION = 4
_CODES = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip


def types_of(channel: Channel) -> Typesdict:
    """Parse the message definition that a bag carries for a channel, with all types nested in it.

    Raises DefinitionError if the bag carries none or one that cannot be parsed.
    """
    if not channel.definition:
        raise DefinitionError(f"the bag holds no message definition for {channel.msgtype} ({channel.topic})")
    definition = channel.definition.replace("\r\n", "\n")  # from a checkout on Windows
    try:
        types: Typesdict = {}
        if channel.encoding == "ros2msg":
            types = get_types_from_msg(definition, channel.msgtype)
            _complete(types, channel.msgtype, channel.msgtype)
            return types
        for part in definition.split("=" * 80 + "\n"):
            text = part.split("\n", 1)[1] if part.startswith("IDL: ") else part
            if text.strip():
                types.update(get_types_from_idl(text))
        _complete(types, channel.msgtype, channel.msgtype)
        return types
    except (TypesysError, AssertionError, LookupError, ValueError, TypeError, AttributeError, RecursionError) as error:
        said = [line.strip() for line in str(error).splitlines() if line.strip()]
        reason = " ".join(said[: 2 if said and said[0].endswith(":") else 1]) or type(error).__name__
        raise DefinitionError(f"message definition of {channel.msgtype} cannot be parsed: {reason}") from None


def store_of(channel: Channel) -> Typestore:
    """Give a type store that knows the channel's type, as the bag defines it, and no other.

    Raises DefinitionError if the bag carries no definition of it, one that cannot be parsed, or one that has another
    idea of what is built in (`builtin_interfaces/msg/Time`).
    """
    types = types_of(channel)
    store = get_typestore(Stores.EMPTY)
    try:
        store.register(types)
    except TypesysError as error:
        raise DefinitionError(
            f"message definition of {channel.msgtype} cannot be used: {str(error).rstrip('.')}"
        ) from None
    return store


def _complete(types: Typesdict, typename: str, whole: str, above: tuple[str, ...] = ()) -> None:
    """Check that every type that `typename` contains is there; else raises DefinitionError with its name."""
    if typename not in types:
        raise DefinitionError(f"message definition of {whole} lacks {typename}")
    if typename in above:
        raise DefinitionError(f"message definition of {whole} cannot be parsed: {typename} contains itself")
    fields: Any = types[typename][1]
    for _, (kind, detail) in fields:
        inner, name = (kind, detail) if kind in (Nodetype.BASE, Nodetype.NAME) else detail[0]
        if inner == Nodetype.NAME:
            _complete(types, name, whole, (*above, typename))


class _Leaf(NamedTuple):
    code: str
    offset: int
    length: int | None  # None: a scalar; else elements of an array, bytes of a string


class _Item(NamedTuple):
    """A field in the order of the message: name, base type, and elements (0: as many as the message says)."""

    name: str
    base: str
    elements: int | None


_SPARE = 8
"""Bytes that may follow a message's last field: middlewares fill up to a multiple of four."""


@dataclass
class _Layout:
    """Where each wanted field lies in messages of one shape, and the lengths that make this shape."""

    leaves: dict[str, _Leaf] = field(default_factory=dict)
    lengths: dict[int, int] = field(default_factory=dict)


class _Grown:
    """An array that grows at its end, without the pieces that would lie scattered in memory for as long as it does."""

    def __init__(self, dtype: np.dtype[Any]) -> None:
        self._array = np.empty(0, dtype)
        self._filled = 0

    def extend(self, values: NDArray[Any]) -> None:
        end = self._filled + len(values)
        if end > len(self._array):
            self._array.resize(end + end // 4, refcheck=False)
        self._array[self._filled : end] = values
        self._filled = end

    def whole(self) -> NDArray[Any]:
        """Give all values; nothing can be added any more."""
        self._array.resize(self._filled, refcheck=False)
        return self._array


class Columns:
    """Collects the wanted fields of messages of one type; nested fields are named with a dot.

    Scalars become arrays of shape (messages,), strings and sequences lists with one entry a message. Messages that do
    not fit the definition are left out.
    """

    BATCH = 4096
    BATCH_BYTES = 1 << 22
    THIN = 4000
    """Entries of a field to be thinned up to which all are kept; of more every second, fourth, ... is."""

    def __init__(
        self, channel: Channel, fields: Sequence[str], lists: Sequence[str] | None = None, thin: Sequence[str] = ()
    ) -> None:
        """Prepare for a channel; raises BagError if its type lacks a wanted field.

        `lists` names those of the fields that have to be strings or sequences, where the others have to be scalars;
        `thin` those of the sequences that are only for pictures: of very many messages most entries are left empty.
        """
        self.channel = channel
        self.fields = tuple(fields)
        self.refused: Counter[str] = Counter()
        """How many messages were left out, by reason."""
        self._types = types_of(channel)
        self._pending: list[bytes] = []
        self._pending_bytes = 0
        self._grown: dict[str, _Grown] = {}
        self._lists: dict[str, list[Any]] = {name: [] for name in fields}
        self._thin = [name for name in thin if name in fields]
        self._stride = 1
        self._kept: list[NDArray[np.int64]] = []
        self._finished: dict[str, Column] | None = None
        self._count = 0
        known = dict(self._flatten(channel.msgtype, ""))
        missing = [name for name in fields if name not in known]
        if missing:
            raise BagError(
                f"{channel.msgtype} in this bag has no field {', '.join(missing)}: it was recorded by another version "
                "of the nodes, and only that version's analysis fits it"
            )
        for name in fields if lists is not None else ():
            listed = known[name][0] != Nodetype.BASE or known[name][1][0] in ("string", "wstring")
            if listed != (name in (lists or ())):
                kinds = ("a number", "a list or a text") if listed else ("a list or a text", "a number")
                raise BagError(f"{channel.msgtype}.{name} in this bag is not {kinds[0]} but {kinds[1]}")
        self._items, self._exact = self._order(known)

    def add(self, payloads: Sequence[bytes]) -> None:
        """Take CDR payloads, unless `finish` was called."""
        self._pending += payloads
        self._pending_bytes += sum(map(len, payloads))
        if len(self._pending) >= self.BATCH or self._pending_bytes >= self.BATCH_BYTES:
            self._flush()

    def finish(self) -> dict[str, Column]:
        """Return one column a field, in the order in which the messages came."""
        if self._finished is None:
            self._flush()
            grown = self._grown
            self._finished = {n: grown[n].whole() if n in grown else self._lists[n] for n in self.fields}
        return self._finished

    @property
    def kept(self) -> NDArray[np.int64]:
        """Which of the messages are in the columns of `finish`, by the order in which they were added."""
        return np.concatenate(self._kept) if self._kept else np.zeros(0, np.int64)

    def _order(self, known: dict[str, tuple[Any, ...]]) -> tuple[list[_Item], bool]:
        """List the fields up to the first that is not supported behind the wanted ones; tell if these are all."""
        wanted = set(self.fields)
        items: list[_Item] = []
        for name, (kind, detail) in known.items():
            (inner, base), bound = ((kind, detail), None) if kind == Nodetype.BASE else detail
            named = "" if inner != Nodetype.BASE else str(base[0])
            single = bound is None or named not in ("string", "wstring")
            if not (single and (named == "string" or named in _CODES)):
                if wanted:
                    raise BagError(f"{self.channel.msgtype}.{name}: fields of this type are not supported")
                return items, False
            items.append(_Item(name, named, None if bound is None else bound if kind == Nodetype.ARRAY else 0))
            wanted.discard(name)
        return items, True

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
        payloads, self._pending, self._pending_bytes = self._pending, [], 0
        if not payloads:
            return
        columns: dict[str, Column] = {}
        good = np.zeros(len(payloads), np.bool_)
        by_size: dict[int, list[int]] = {}
        for index, payload in enumerate(payloads):
            by_size.setdefault(len(payload), []).append(index)
        for size, indices in by_size.items():
            rest = np.array(indices)
            if size < _ENCAPSULATION:
                self.refused["they are empty"] += len(rest)
                continue
            block = np.frombuffer(b"".join([payloads[i] for i in rest]), np.uint8).reshape(-1, size)
            while len(rest):
                taken = self._decode(block, rest, len(payloads), columns, good)
                rest, block = rest[~taken], block[~taken]
        for name, column in columns.items():
            if isinstance(column, np.ndarray):
                self._grown.setdefault(name, _Grown(column.dtype)).extend(column[good])
            else:
                self._lists[name] += [column[i] for i in np.flatnonzero(good)]
        self._thin_out(int(good.sum()))
        self._kept.append(np.flatnonzero(good) + self._count)
        self._count += len(payloads)

    def _thin_out(self, fresh: int) -> None:
        """Empty the entries that are not to be kept; what is kept is a copy, that does not hold its whole batch."""
        for name in self._thin:
            entries = self._lists[name]
            stride = 1
            while len(entries) > stride * self.THIN:
                stride *= 2
            begin = 0 if stride != self._stride else len(entries) - fresh
            nothing = entries[0][:0].copy() if entries else None
            for i in range(begin, len(entries)) if stride > 1 else ():
                entries[i] = nothing if i % stride else entries[i].copy()
        if self._thin:
            self._stride = stride

    def _decode(
        self,
        block: NDArray[np.uint8],
        rows: NDArray[np.int64],
        total: int,
        columns: dict[str, Column],
        good: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """Decode those rows of the block that have the first row's layout, or refuse them; tell which."""
        same: NDArray[np.bool_] = (block[:, 0] == block[0, 0]) & (block[:, 1] == block[0, 1])
        if block[0, 0] != 0 or block[0, 1] > 1:
            self.refused[f"they are no CDR (encapsulation 0x{block[0, 0]:02x}{block[0, 1]:02x})"] += int(same.sum())
            return same
        order = "<" if block[0, 1] & 1 else ">"
        layout, problem = self._layout(block[0].tobytes(), order)
        for offset, length in layout.lengths.items():
            found = np.ascontiguousarray(block[:, offset : offset + 4]).view(order + "u4")[:, 0]
            same &= found == length
        if problem is not None:
            self.refused[problem] += int(same.sum())
            return same
        chosen, at = block[same], rows[same]
        good[at] = True
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
                if (raw == raw[:1]).all():  # places in the frame of the train stay: one array serves all messages
                    same_for_all = array[0].copy()
                    for row in at:
                        listed[row] = same_for_all
                    continue
                for row, entry in zip(at, array, strict=True):
                    listed[row] = entry
        return same

    def _layout(self, payload: bytes, order: str) -> tuple[_Layout, str | None]:
        """Find where the fields lie in a message, and say what is wrong with it if it does not fit the definition."""
        layout = _Layout()
        position = 0  # behind the encapsulation, which alignment does not count
        wanted = set(self.fields)
        room = len(payload) - _ENCAPSULATION

        def align(width: int) -> None:
            nonlocal position
            position = -(-position // width) * width

        def length() -> int:
            nonlocal position
            align(4)
            at = position + _ENCAPSULATION
            position += 4
            if position > room:
                return 0
            value = int.from_bytes(payload[at : at + 4], "little" if order == "<" else "big")
            layout.lengths[at] = value
            return value

        for name, base, count in self._items:
            if count == 0:
                count = length()
            if base == "string":
                code, count = "S1", length()
            else:
                code = _CODES[base]
                if count != 0:  # an empty sequence is not padded
                    align(np.dtype(code).itemsize)
            if name in wanted:
                layout.leaves[name] = _Leaf(code, position + _ENCAPSULATION, count)
            position += np.dtype(code).itemsize * (1 if count is None else count)
            if position > room:
                return layout, "they are shorter than their definition says"
        if self._exact and room - position >= _SPARE:
            return layout, "they are longer than their definition says"
        return layout, None
