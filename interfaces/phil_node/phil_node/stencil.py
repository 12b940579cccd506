"""Messages of any kind of which only some numbers change: written by rclpy once, and from then on in place.

What rclpy writes takes 10 to 60 us a message, for its checks and its objects. Texts and lengths of such a message never
change, so its numbers stay where they are; they are found by writing numbers that nothing else has.
"""

from __future__ import annotations

from copy import deepcopy
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message

from phil_node.cdr import CODES, HEAD, SEQUENCE, Written

STAMP = Struct("<iI")


class Stencil(Written):
    """A message with a header; its numbers are set by their names: ``stencil["wrench.force.z"][0] = 1.0``.

    Args:
        message: as it is to be, with its texts, and with arrays of the lengths that they keep.
        fields: dotted names of the numbers and the arrays of numbers that change.

    Raises:
    ------
    ValueError
        A field is no number and no array of numbers.
    """

    __slots__ = ("_buffer", "_kind", "_numbers")

    def __init__(self, message: Any, *fields: str) -> None:
        self._kind = type(message)
        self._buffer = bytearray(serialize_message(message))
        self._numbers: dict[str, NDArray[Any]] = {}
        for field in fields:
            dtype, size, at = self._find(message, field)
            self._numbers[field] = np.frombuffer(self._buffer, dtype, size, at)
        self.writer: Any = self

    def _find(self, message: Any, field: str) -> tuple[np.dtype[Any], int, int]:
        """Give type, number of entries and place of a field."""
        marked = deepcopy(message)
        *way, name = field.split(".")
        owner = marked
        for part in way:
            owner = getattr(owner, part)
        type_name = owner.get_fields_and_field_types()[name]
        sequence = SEQUENCE.fullmatch(type_name)
        code = CODES.get(sequence[1] if sequence else type_name)
        if code is None:
            raise ValueError(f"{self._kind.__name__}: '{field}' ({type_name}) is no number")
        dtype = np.dtype(code)
        size = len(getattr(owner, name)) if sequence else 1
        marks = np.frombuffer(bytes(range(1, 1 + dtype.itemsize)), dtype).repeat(size)
        setattr(owner, name, marks.tolist() if sequence else marks[0].item())
        data, mark = bytes(serialize_message(marked)), marks.tobytes()
        if not size or data.count(mark) != 1:
            raise ValueError(f"{self._kind.__name__}: '{field}' has no place that could be told")
        return dtype, size, data.index(mark)

    def __getitem__(self, field: str) -> NDArray[Any]:
        """Give the numbers of a field, to be set; one entry for what is no array."""
        return self._numbers[field]

    def stamp(self, seconds: int, nanoseconds: int) -> None:
        """Set the time of the header."""
        STAMP.pack_into(self._buffer, len(HEAD), seconds, nanoseconds)

    def bytes(self) -> bytes:
        """Give the message as it stands in CDR."""
        return bytes(self._buffer)

    def message(self) -> Any:
        """Give it as rclpy reads it."""
        return deserialize_message(self.bytes(), self._kind)

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        return self.message()
