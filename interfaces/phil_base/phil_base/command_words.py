"""The command line of this process as others see it (ps, /proc), set anew: for one that was forked, not started."""

from __future__ import annotations

import ctypes
import mmap
from collections.abc import Sequence
from pathlib import Path

PR_SET_NAME, PR_SET_MM, PR_SET_MM_MAP = 15, 35, 14
LONGEST_NAME = 15
NO_FILE = 0xFFFFFFFF
FIELDS = {"start_code": 26, "end_code": 27, "start_stack": 28, "start_data": 45, "end_data": 46, "start_brk": 47}
FIELDS |= {"env_start": 50, "env_end": 51}
"""Fields of /proc/PID/stat (proc(5)), the first being 1."""


class _Map(ctypes.Structure):
    """struct prctl_mm_map (linux/prctl.h)."""

    _fields_ = (
        *((name, ctypes.c_uint64) for name in ("start_code", "end_code", "start_data", "end_data", "start_brk", "brk")),
        *((name, ctypes.c_uint64) for name in ("start_stack", "arg_start", "arg_end", "env_start", "env_end")),
        ("auxv", ctypes.c_void_p),
        ("auxv_size", ctypes.c_uint32),
        ("exe_fd", ctypes.c_uint32),
    )


_held: list[mmap.mmap] = []
"""Where the words stand, for the life of the process."""


def show(words: Sequence[str], name: str) -> bool:
    """Show these words as the command line, and a name of at most 15 bytes; tell whether the kernel took both."""
    content = b"".join(word.encode(errors="surrogateescape") + b"\0" for word in words)
    room = mmap.mmap(-1, len(content), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    room.write(content)
    libc = ctypes.CDLL(None, use_errno=True)
    libc.sbrk.restype, libc.sbrk.argtypes = ctypes.c_void_p, [ctypes.c_ssize_t]
    found = _Map(auxv_size=0, exe_fd=NO_FILE, brk=libc.sbrk(0))
    try:
        fields = ["", "", *Path("/proc/self/stat").read_text().rpartition(") ")[2].split()]
        for key, number in FIELDS.items():
            setattr(found, key, int(fields[number - 1]))
    except (OSError, ValueError, IndexError):
        return False
    found.arg_start = ctypes.addressof(ctypes.c_char.from_buffer(room))
    found.arg_end = found.arg_start + len(content)
    arguments = [ctypes.c_ulong(number) for number in (PR_SET_MM_MAP, ctypes.addressof(found), ctypes.sizeof(found), 0)]
    if libc.prctl(PR_SET_MM, *arguments):
        return False
    _held.append(room)
    short = ctypes.create_string_buffer(name.encode()[:LONGEST_NAME])
    return not libc.prctl(PR_SET_NAME, ctypes.cast(short, ctypes.c_void_p), *[ctypes.c_ulong(0)] * 3)
