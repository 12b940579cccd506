"""Memory that was touched before is there for the thread that uses it, and stays: the kernel's page faults tell."""

import subprocess
import sys

import pytest

FAULTS = """
import ctypes, resource, sys, threading
from phil_base import memory
MIB = 1 << 20
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.malloc.argtypes = ctypes.c_void_p, [ctypes.c_size_t]
libc.free.restype, libc.free.argtypes = None, [ctypes.c_void_p]
def faults():
    return resource.getrusage(resource.RUSAGE_THREAD).ru_minflt
def blocks():
    made = []
    for _ in range(1500):
        made.append(libc.malloc(4000))
        ctypes.memset(made[-1], 1, 4000)
    for one in made:
        libc.free(one)
def objects():
    made = [bytes(400) for _ in range(13000)]
    del made
def count(use, touch):
    def run():
        if touch:
            memory.touch_heap(8 * MIB)
            memory.touch_objects(8 * MIB)
        use()  # what a first call alone costs
        before = faults()
        for _ in range(5):
            use()
        found.append(faults() - before)
    def first():
        if touch:
            memory.touch_heap(8 * MIB)
            memory.touch_objects(8 * MIB)
        before = faults()
        use()
        found.append(faults() - before)
    found = []
    for each in (first, run):
        thread = threading.Thread(target=each)
        thread.start()
        thread.join()
    return found
memory.keep_heap(0)
print(*count({"blocks": blocks, "objects": objects}[sys.argv[1]], sys.argv[2] == "touched"))
"""


def faults(kind: str, touched: str) -> list[int]:
    """Give the page faults of a thread's first use of 5 to 6 MiB, and of five more, in a process of its own."""
    command = [sys.executable, "-c", FAULTS, kind, touched]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [int(word) for word in done.stdout.split()]


@pytest.mark.parametrize("kind", ["blocks", "objects"])
def test_what_was_touched_costs_no_page_fault(kind: str) -> None:
    """5 to 6 MiB are 1300 to 1500 pages. Some tens of faults are left for lists, frames and stack."""
    first, again = faults(kind, "touched")
    assert first < 100
    assert again < 100


@pytest.mark.parametrize("kind", ["blocks", "objects"])
def test_what_was_not_touched_does(kind: str) -> None:
    """Else the test above would say nothing."""
    first, _ = faults(kind, "not")
    assert first > 1000
