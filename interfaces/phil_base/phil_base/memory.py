"""Memory that is there when a cycle needs it: locked, touched before, and not given back to the system."""

from __future__ import annotations

import ctypes
import mmap
import os
import resource
from pathlib import Path

from phil_base.scheduling import Answer

MIB = 1 << 20
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_THRESHOLD, M_ARENA_MAX = -1, -2, -3, -8
"""Numbers of mallopt(3)."""
LARGEST_FROM_HEAP = 32 * MIB
"""Largest block that glibc takes from its heap rather than by mmap: its DEFAULT_MMAP_THRESHOLD_MAX."""
SMALLEST_MAPPED = 128 * 1024
"""Smallest block that glibc maps by itself, unless its rule raises that: its DEFAULT_MMAP_THRESHOLD_MIN."""
KEEP = 512 * MIB
"""Free memory at the end of the heap from which glibc gives it back."""
MADV_POPULATE_WRITE = 23
"""Of Linux 5.14: make the pages be there, without a change to what is in them."""
CAP_IPC_LOCK = 14
RESERVE = 1024 * MIB
"""What a process with a limit to locked memory has to be allowed beyond its present size: past the limit every mmap
fails, and with it the process. Address space counts, not what is used of it: threads' stacks, the compiler's arenas."""
SMALL = 479
"""Bytes in an object for which Python needs 512 (CPython's SMALL_REQUEST_THRESHOLD)."""
EACH = 512
"""Of so many objects one is kept: some in each MiB (CPython's ARENA_SIZE; 256 KiB before 3.10)."""

_libc = ctypes.CDLL(None, use_errno=True)
_KEPT: list[bytes] = []
"""Objects that keep memory of Python's."""


def status_of(key: str) -> int:
    """Give a size of this process in bytes by its name in /proc/self/status (VmRSS, VmLck, VmSize), 0 without it."""
    for line in Path("/proc/self/status").read_text().splitlines():
        name, _, rest = line.partition(":")
        if name == key:
            return int(rest.split()[0]) * 1024
    return 0


def lock_memory() -> Answer:
    """Keep in memory what the process has touched and will touch.

    What was never touched stays away (MCL_ONFAULT): locking the whole address space would fill the 8 MiB of stack of
    each thread, and all that the just-in-time compiler has put aside.
    """
    if (refusal := _why_not_locked()) is not None:
        return refusal
    if _libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT):
        error = ctypes.get_errno()
        return Answer(f"not locked: {os.strerror(error)}", advice_to_lock())
    return Answer(f"locked as it is touched, {status_of('VmRSS') / MIB:.0f} MiB resident")


def release_memory() -> None:
    """Undo :func:`lock_memory`."""
    _libc.munlockall()


def may_lock() -> bool:
    """Tell whether this process may lock memory without a limit; raises the soft limit to the hard one first."""
    return _why_not_locked() is None


def advice_to_lock() -> str:
    """Say what to type so that this user may lock memory."""
    return (
        'type: echo "$USER - memlock unlimited" | sudo tee -a /etc/security/limits.d/90-rig.conf   and log in again '
        "(in a container: start it with --ulimit memlock=-1)"
    )


def keep_heap(arenas: int) -> Answer:
    """Let malloc keep what is freed: neither trims the heap nor maps large blocks one by one.

    Args:
        arenas: most arenas of malloc, 0: glibc's own rule, 8 a CPU. Threads that share one wait for its lock.
    """
    if not hasattr(_libc, "mallopt"):
        return Answer("as the C library does", "only glibc can be told: nothing to do about it on this system")
    wanted = [(M_MMAP_THRESHOLD, LARGEST_FROM_HEAP), (M_TRIM_THRESHOLD, KEEP)]
    if arenas:
        wanted.append((M_ARENA_MAX, arenas))
    if not all(_libc.mallopt(name, value) for name, value in wanted):
        return Answer("as the C library does", "glibc refused mallopt: is another malloc preloaded (LD_PRELOAD)?")
    return Answer("kept" + (f", at most {arenas} arenas" if arenas else ""))


def lean_heap() -> bool:
    """Let malloc have one heap for all threads, and map blocks from 128 KiB on one by one; tell whether it will.

    For a process that writes in large pieces of ever other sizes and that nobody waits for. By its own rule glibc takes
    such pieces from the heaps as soon as one was freed: these get gaps, and grow for hours. Before threads are started.
    """
    wanted = ((M_MMAP_THRESHOLD, SMALLEST_MAPPED), (M_ARENA_MAX, 1))
    return hasattr(_libc, "mallopt") and all(_libc.mallopt(name, value) for name, value in wanted)


def touch_heap(size: int) -> int:
    """Touch ``size`` bytes of heap that later calls of malloc in the calling thread get, and give how many.

    After :func:`keep_heap`. A thread has a heap of its own as a rule, and that grows page by page, by a system call and
    a page fault each.
    """
    _libc.malloc.restype, _libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
    _libc.free.restype, _libc.free.argtypes = None, [ctypes.c_void_p]
    blocks = []
    # In blocks that come from the heap whatever their sum is.
    for start in range(0, size, MIB):
        length = min(MIB, size - start)
        block = _libc.malloc(length)
        if not block:
            break
        ctypes.memset(block, 0, length)
        blocks.append((block, length))
    for block, _ in blocks:
        _libc.free(block)
    return sum(length for _, length in blocks)


def touch_objects(size: int) -> int:
    """Touch ``size`` bytes for Python's small objects, and have them stay; give how many do.

    Python maps memory for objects of up to 512 bytes by the MiB, and unmaps a MiB in which no object is left. So a few
    objects of each are kept for ever.
    """
    made = [bytes(SMALL) for _ in range(0, max(0, size - len(_KEPT) * EACH * 512), 512)]
    _KEPT.extend(made[::EACH])
    return len(_KEPT) * EACH * 512


class _Attributes(ctypes.Structure):
    """pthread_attr_t; glibc's has 56 bytes on 64 bit."""

    _fields_ = (("opaque", ctypes.c_byte * 128),)


def touch_stack(size: int) -> int:
    """Make ``size`` bytes of the calling thread's stack be there; give how many are, 0 where the system cannot."""
    attributes, low, length = _Attributes(), ctypes.c_void_p(), ctypes.c_size_t()
    _libc.pthread_self.restype = ctypes.c_ulong
    if _libc.pthread_getattr_np(ctypes.c_ulong(_libc.pthread_self()), ctypes.byref(attributes)):
        return 0
    failed = _libc.pthread_attr_getstack(ctypes.byref(attributes), ctypes.byref(low), ctypes.byref(length))
    _libc.pthread_attr_destroy(ctypes.byref(attributes))
    if failed or not low.value:
        return 0
    page = mmap.PAGESIZE
    # The end of the stack is not that of a page.
    high = (low.value + length.value) // page * page
    # Of a stack without a limit glibc makes a guess; nobody uses its last pages.
    size = min(size, length.value - 16 * page) // page * page
    if size <= 0:
        return 0
    # The first thread's stack grows when it is touched; the others' are there.
    ctypes.string_at(high - size, 1)
    start, amount = ctypes.c_void_p(high - size), ctypes.c_size_t(size)
    return 0 if _libc.madvise(start, amount, ctypes.c_int(MADV_POPULATE_WRITE)) else size


def _why_not_locked() -> Answer | None:
    """Give the refusal if locking would fail, now or, with a limit, at some later mmap."""
    soft, hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_MEMLOCK, (hard, hard))
    if hard == resource.RLIM_INFINITY or _is_privileged() or hard >= status_of("VmSize") + RESERVE:
        return None
    return Answer(f"not locked: the limit is {hard / MIB:g} MiB", advice_to_lock())


def _is_privileged() -> bool:
    """Tell whether limits do not count: CAP_IPC_LOCK, and not only in a user namespace."""
    lines = dict(line.split(":\t", 1) for line in Path("/proc/self/status").read_text().splitlines() if ":\t" in line)
    capable = int(lines.get("CapEff", "0"), 16) >> CAP_IPC_LOCK & 1
    return bool(capable) and Path("/proc/self/uid_map").read_text().split() == ["0", "0", "4294967295"]
