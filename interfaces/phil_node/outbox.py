"""Publishing beside the cycle: what a node sends goes to a thread that may wait for DDS while the cycle does not."""

from __future__ import annotations

import ctypes
import threading
from collections import deque
from time import sleep
from typing import Any

from rclpy.exceptions import InvalidHandle

from phil_node.real_time import set_thread

EVERY = 0.004
"""Time in s from one batch to the next: what nobody in the loop waits for costs a fraction if it goes in batches."""


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


class Outbox:
    """Publishes in a thread of its own, in the order of `post`, a few milliseconds later or at once."""

    def __init__(self) -> None:
        self.failed = 0
        self._waiting: deque[tuple[Any, bytes]] = deque()
        self._turn = threading.Lock()
        self._thread: threading.Thread | None = None
        self._running = False

    def start(self) -> None:
        """Begin."""
        self._running = True
        self._thread = threading.Thread(target=self._run, name="publish", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End, after all that was posted is published."""
        self._running = False
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self.flush()

    def post(self, publisher: Any, data: bytes) -> None:
        """Have a message (CDR) published by the publisher of that handle (rclpy's)."""
        self._waiting.append((publisher, data))

    def flush(self) -> None:
        """Publish all that waits, now and here."""
        waiting = self._waiting
        with self._turn:
            while waiting:
                publisher, data = waiting.popleft()
                try:
                    with publisher:  # it cannot be destroyed meanwhile
                        self.failed += not publish_bytes(publisher.pointer, data)
                except InvalidHandle:
                    self.failed += 1

    def _run(self) -> None:
        set_thread("publish")
        while self._running:
            sleep(EVERY)
            self.flush()
