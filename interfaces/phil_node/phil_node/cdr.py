"""Messages of the cycle as bytes: what rclpy reads and writes, at fixed offsets, without its message objects.

A message of the cycle has numbers, a header whose frame never changes, and at its end arrays whose lengths never
change: in CDR, the encoding of DDS, each of its fields then stands at one place. One `struct` call reads or writes all
numbers. What does not fit such a plan (another frame, another length) is left to rclpy.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import pairwise, takewhile
from struct import Struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message

CODES = {
    "boolean": "?",
    "octet": "B",
    "uint8": "B",
    "int8": "b",
    "uint16": "H",
    "int16": "h",
    "uint32": "I",
    "int32": "i",
    "uint64": "Q",
    "int64": "q",
    "float": "f",
    "double": "d",
}
"""Types of IDL to the codes of `struct` and of numpy; a number is aligned to its size, counted from behind `HEAD`."""
HEAD = b"\x00\x01\x00\x00"
"""Beginning of a message in plain CDR, little-endian."""
HEADER = "std_msgs/Header"
SEQUENCE = re.compile(r"sequence<(\w+)>")


class Stamp:
    """Time of a header in s and ns, named as in builtin_interfaces/Time."""

    __slots__ = ("nanosec", "sec")

    def __init__(self) -> None:
        self.sec = self.nanosec = 0


class Header:
    """Header, named as in std_msgs/Header."""

    __slots__ = ("frame_id", "stamp")

    def __init__(self, frame_id: str) -> None:
        self.stamp, self.frame_id = Stamp(), frame_id


class _Compiled(NamedTuple):
    """Functions that are written for one plan: a loop over its fields takes several times as long."""

    put: Callable[[Any, bytearray], None]
    """Writes the numbers of a message into its bytes."""
    fits: Callable[[bytes], bool]
    """Tells whether bytes are laid out as planned."""
    read: Callable[[bytes], Any]
    """Gives the message in bytes that fit; its arrays are views of them."""


class Plan:
    """Where each field of a kind of message stands, if its frame and the lengths of its arrays never change.

    Args:
        kind: class of messages: at most a header first, then numbers, then arrays of numbers.
        frame_id: of the header.
        sizes: field to number of entries, of each array.

    Raises:
    ------
    ValueError
        The message has a field that has no fixed place: a text, another message, a number behind an array.
    """

    def __init__(self, kind: Any, frame_id: str = "", sizes: Mapping[str, int] | None = None) -> None:
        self.kind, self.frame_id = kind, frame_id
        self.arrays: dict[str, tuple[int, str, int]] = {}
        self._sizes = dict(sizes or {})
        self._at = 0
        self._format = "<"
        self._scalars: list[str] = []
        self._marks = [(0, HEAD)]
        self._gridded = 0
        fields = kind.get_fields_and_field_types()
        for name, type_name in fields.items():
            self._place(name, type_name)
        self.size = len(HEAD) + self._at
        constants = {name: getattr(kind, name) for name in dir(kind) if name.isupper()}
        self.grid = self._grid()
        """Of the first arrays, of one type and one length: both, and the bytes from one to the next; else None."""
        names = {"__slots__": (*fields, *(("rows",) if self.grid else ())), **constants}
        self._view: Any = type(f"{kind.__name__}View", (), names)
        self._written: Any = type(f"{kind.__name__}Written", (Written,), names)
        self._begin = min((at for at, _, _ in self.arrays.values()), default=0)
        self._put, self.fits, self.read_fitting = self._compile()

    def _place(self, name: str, type_name: str) -> None:
        sequence = SEQUENCE.fullmatch(type_name)
        if type_name == HEADER and not self._at:
            self._number("I", "header.stamp.sec")
            self._number("I", "header.stamp.nanosec")
            self._mark(Struct("<I").pack(len(self.frame_id) + 1) + self.frame_id.encode() + b"\0")
        elif type_name in CODES and not self.arrays:
            self._number(CODES[type_name], name)
        elif sequence and sequence[1] in CODES:
            code, size = CODES[sequence[1]], self._sizes.get(name, 0)
            self._mark(Struct("<I").pack(size))
            width = np.dtype(code).itemsize
            if size:
                self._at += -self._at % width
            self.arrays[name] = (len(HEAD) + self._at, code, size)
            self._at += size * width
        else:
            raise ValueError(f"{self.kind.__name__}: '{name}' ({type_name}) has no fixed place")

    def _number(self, code: str, name: str) -> None:
        width = Struct("<" + code).size
        gap = -self._at % width
        self._format += (f"{gap}x" if gap else "") + code
        self._at += gap + width
        self._scalars.append(name)

    def _mark(self, content: bytes) -> None:
        """Place what is the same in each message: a frame, the length of an array (both begin with a count)."""
        gap = -self._at % 4
        self._marks.append((len(HEAD) + self._at + gap, content))
        if not self.arrays:
            self._format += (f"{gap}x" if gap else "") + f"{len(content)}s"
            self._scalars.append(f"mark_{len(self._marks) - 1}")
        self._at += gap + len(content)

    def _grid(self) -> tuple[np.dtype[Any], int, int] | None:
        alike = takewhile(lambda item: item[1][1:] == first[1:], self.arrays.items())
        first = next(iter(self.arrays.values()), (0, "", 0))
        places = [place for _, (place, _, _) in alike]
        steps = {after - before for before, after in pairwise(places)}
        if len(steps) != 1 or not first[2]:
            return None
        self._gridded = len(places)
        return np.dtype(first[1]), first[2], steps.pop()

    def _compile(self) -> _Compiled:
        """Write the functions that move all numbers at once."""
        struct = Struct(self._format)
        space: dict[str, Any] = {"pack_into": struct.pack_into, "unpack_from": struct.unpack_from}
        space |= {"new": object.__new__, "View": self._view, "Header": Header, "Stamp": Stamp, "frame": self.frame_id}
        space |= {f"mark_{i}": content for i, (_, content) in enumerate(self._marks)}
        names = [name if name.startswith("mark_") else f"m.{name}" for name in self._scalars]
        targets = ["_" if name.startswith("mark_") else name for name in names]
        source = f"def put(m, data):\n pack_into(data, {len(HEAD)}, {', '.join(names)})\n"
        alike = [f"data[{at}:{at + len(mark)}] == mark_{i}" for i, (at, mark) in enumerate(self._marks)]
        source += f"def fits(data):\n return len(data) == {self.size} and {' and '.join(alike)}\n"
        source += "def read(data):\n m = new(View)\n m.header = h = new(Header)\n h.stamp = new(Stamp)\n"
        source += " h.frame_id = frame\n"
        source += f" {', '.join(targets)}, = unpack_from(data, {len(HEAD)})\n" if names else ""
        source += self._views(space) + " return m\n"
        exec(source, space)  # names of fields, out of a message's own definition, and nothing else
        return _Compiled(space["put"], space["fits"], space["read"])

    def _views(self, space: dict[str, Any]) -> str:
        """Write the lines that make views of the arrays; as ``rows`` of one, too, if they are alike."""
        space |= {"frombuffer": np.frombuffer, "rows": self._rows}
        source = ""
        if self.grid is not None:
            names = list(self.arrays)[: self._gridded]
            source += f" m.rows = r = rows(data)\n {', '.join(f'm.{name}' for name in names)} = r\n"
        for name, (at, code, size) in list(self.arrays.items())[self._gridded :]:
            space[f"kind_{name}"] = np.dtype(code)
            space[f"empty_{name}"] = empty = np.empty(0, code)
            empty.flags.writeable = False  # all messages share it
            source += (
                f" m.{name} = frombuffer(data, kind_{name}, {size}, {at})\n" if size else f" m.{name} = empty_{name}\n"
            )
        return source

    def _rows(self, data: bytes | bytearray) -> NDArray[Any]:
        """Give the arrays in some bytes as rows of one, if there is a `grid`."""
        assert self.grid is not None
        kind, size, step = self.grid
        return np.ndarray((self._gridded, size), kind, data, self._begin, (step, kind.itemsize))

    def read(self, data: bytes) -> Any:
        """Give the message in these bytes, with the fields' names; arrays of one that fits are views of the bytes.

        One that does not fit is given as rclpy reads it.

        Raises
        ------
        Exception
            The bytes are no message of this kind.
        """
        return self.read_fitting(data) if self.fits(data) else deserialize_message(data, self.kind)

    def writer(self) -> Writer:
        """Give a message to be filled and sent again and again."""
        buffer = bytearray(self.size)
        message, empty = self._written(), self.kind()
        for name in self.kind.get_fields_and_field_types():
            setattr(message, name, getattr(empty, name))
        message.header = Header(self.frame_id)
        for at, mark in self._marks:
            buffer[at : at + len(mark)] = mark
        for name, (at, code, size) in self.arrays.items():
            setattr(message, name, np.frombuffer(buffer, code, size, at))
        if self.grid is not None:
            message.rows = self._rows(buffer)
        return Writer(message, buffer, self._put, self.writer)


class Written:
    """A message that a `Writer` writes: it has the fields of its kind, can be published and copied (`copy`)."""

    __slots__ = ("writer",)
    writer: Writer

    def __deepcopy__(self, memo: dict[int, Any]) -> Written:
        return self.writer.copy()


class Writer:
    """One message, written each cycle: set the numbers of ``message``, fill its arrays in place, take `bytes`."""

    def __init__(
        self,
        message: Any,
        buffer: bytearray,
        put: Callable[[Any, bytearray], None],
        another: Callable[[], Writer],
    ) -> None:
        self.message, self._buffer, self._put, self._another = message, buffer, put, another
        message.writer = self

    def copy(self) -> Written:
        """Give another message with the same content, and a writer of its own."""
        made, mine = self._another().message, self.message
        made.header.stamp.sec, made.header.stamp.nanosec = mine.header.stamp.sec, mine.header.stamp.nanosec
        for name in type(mine).__slots__:
            value = getattr(mine, name)
            if name not in ("header", "rows"):
                self._set(made, name, value)
        return made  # type: ignore[no-any-return]

    def _set(self, message: Any, name: str, value: Any) -> None:
        if isinstance(value, np.ndarray):
            getattr(message, name)[:] = value
        else:
            setattr(message, name, value)

    def bytes(self) -> bytes:
        """Give the message as it stands in CDR.

        Raises
        ------
        struct.error
            A number is not of its field's type, or too large for it.
        """
        self._put(self.message, self._buffer)
        return bytes(self._buffer)


class OpenWriter(Writer):
    """One message whose arrays of four-byte numbers have other lengths each time: set its fields, take `bytes`.

    Raises
    ------
    ValueError
        The message does not end in such arrays, or has something else behind them (`Plan`).
    """

    def __init__(self, kind: Any, frame_id: str = "") -> None:
        """Take a class of messages, and the frame of its header."""
        plan = Plan(kind, frame_id)
        wide = [name for name, (_, code, _) in plan.arrays.items() if np.dtype(code).itemsize != 4]
        if wide or not plan.arrays:
            raise ValueError(f"{kind.__name__}: {', '.join(wide) or 'no array'} has no place that follows from lengths")
        fixed = plan.writer()
        super().__init__(fixed.message, fixed._buffer, plan._put, lambda: OpenWriter(kind, frame_id))
        self._arrays = [(name, np.dtype(code)) for name, (_, code, _) in plan.arrays.items()]
        self._head = min(at for at, _, _ in plan.arrays.values()) - _LENGTH.size

    def _set(self, message: Any, name: str, value: Any) -> None:
        setattr(message, name, np.array(value) if any(name == array for array, _ in self._arrays) else value)

    def bytes(self) -> bytes:
        """Give the message as it stands in CDR.

        Raises
        ------
        struct.error
            A number is not of its field's type, or too large for it.
        """
        self._put(self.message, self._buffer)
        parts: list[Any] = [memoryview(self._buffer)[: self._head]]
        for name, code in self._arrays:
            content = np.ascontiguousarray(getattr(self.message, name), code)
            parts += (_LENGTH.pack(content.size), content.data)
        return b"".join(parts)


_LENGTH = Struct("<I")

LESSONS = 8
"""Layouts that a reader learns; one that meets more is fed by different senders in turn, and leaves them to rclpy."""


class Reader:
    """Reads the messages of a topic by a plan that it learns from the first one."""

    def __init__(self, kind: Any) -> None:
        self._kind = kind
        self._plan: Plan | None = None
        self._lessons = LESSONS

    def read(self, data: bytes) -> Any:
        """Give the message, as `Plan.read` does.

        Raises
        ------
        Exception
            The bytes are no message of this kind.
        """
        plan = self._plan
        if plan is not None and plan.fits(data):
            return plan.read_fitting(data)
        message = deserialize_message(data, self._kind)
        if self._lessons:
            self._lessons -= 1
            self._learn(message)
        return message

    def _learn(self, message: Any) -> None:
        header = getattr(message, "header", None)
        types = self._kind.get_fields_and_field_types()
        sizes = {name: len(getattr(message, name)) for name in types if SEQUENCE.fullmatch(types[name])}
        try:
            self._plan = Plan(self._kind, "" if header is None else header.frame_id, sizes)
        except ValueError:
            self._lessons = 0
