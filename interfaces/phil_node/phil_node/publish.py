"""Publishing bytes by rcl, without the interpreter's lock."""

from __future__ import annotations

import ctypes


class _Serialized(ctypes.Structure):
    """rcl_serialized_message_t (rcutils/types/uint8_array.h, rcutils/allocator.h)."""

    _fields_ = (
        ("buffer", ctypes.c_char_p),
        ("length", ctypes.c_size_t),
        ("capacity", ctypes.c_size_t),
        ("allocator", ctypes.c_void_p * 5),
    )


_RCL = ctypes.CDLL("librcl.so")
_PUBLISH = _RCL.rcl_publish_serialized_message
_PUBLISH.argtypes = (ctypes.c_void_p, ctypes.POINTER(_Serialized), ctypes.c_void_p)
_PUBLISH.restype = ctypes.c_int
_RESET_ERROR = ctypes.CDLL("librcutils.so").rcutils_reset_error
_RESET_ERROR.restype = None


def publish_bytes(publisher: int, data: bytes) -> bool:
    """Publish a message in CDR by the address of an rcl publisher; tell whether rcl took it.

    rclpy does the same, but keeps the interpreter's lock meanwhile: a write that waits for a lock of DDS would stop
    every thread of the node. A foreign function called by ctypes gives it up.
    """
    message = _Serialized(data, len(data), len(data))
    if _PUBLISH(publisher, ctypes.byref(message), None) == 0:
        return True
    _RESET_ERROR()
    return False
