"""What an unquoted scalar of a parameter file means to ROS, which takes it by strtoll and strtod of the C library."""

from __future__ import annotations

import ctypes
import errno
import re
from typing import Any

YES = frozenset(("Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"))
NO = frozenset(("N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"))
_DOTTED = re.compile(r"^(\.(nan|NaN|NAN)|[-+]?\.(inf|Inf|INF))$")

_libc = ctypes.CDLL(None, use_errno=True)
_libc.strtoll.restype, _libc.strtoll.argtypes = ctypes.c_longlong, (ctypes.c_char_p, ctypes.c_void_p, ctypes.c_int)
_libc.strtod.restype, _libc.strtod.argtypes = ctypes.c_double, (ctypes.c_char_p, ctypes.c_void_p)


def ros_value(text: str) -> bool | int | float | str:
    """Return what an unquoted scalar means to ROS.

    >>> ros_value("010"), ros_value("08"), ros_value("0x1p3"), ros_value("1:30"), ros_value("off")
    (8, 8.0, 8.0, '1:30', False)
    """
    text = text.split("\0")[0]
    if text in YES or text in NO:
        return text in YES
    whole = _number(_libc.strtoll, text, 0)
    if whole is not None:
        return int(whole)
    dotted = _DOTTED.match(text) is not None
    real = _number(_libc.strtod, text.lstrip("+-.") if dotted else text)
    if real is None:
        return text
    return -float(real) if dotted and text[0] == "-" else float(real)


def _number(convert: Any, text: str, *base: int) -> Any:
    """Let the C library convert a whole text; None if it does not take all of it, or leaves its range."""
    try:
        content = ctypes.create_string_buffer(text.encode())
    except UnicodeEncodeError:
        return None
    end = ctypes.c_void_p()
    ctypes.set_errno(0)
    value = convert(ctypes.cast(content, ctypes.c_char_p), ctypes.byref(end), *base)
    taken = (end.value or 0) - ctypes.addressof(content)
    return value if ctypes.get_errno() != errno.ERANGE and 0 < taken == len(content) - 1 else None
