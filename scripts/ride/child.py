"""Runs a module as a child that ends with its parent: ``python -m ride.child PARENT_PID MODULE ARGUMENTS...``."""

from __future__ import annotations

import ctypes
import os
import runpy
import signal
import sys

PR_SET_PDEATHSIG = 1


def as_child(parent: int) -> None:
    """Ask the kernel for SIGTERM at the parent's death; end if it has died before."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        sys.exit(1)


def main() -> None:
    """Become the module, as a child of the parent."""
    parent, module = int(sys.argv[1]), sys.argv[2]
    as_child(parent)
    sys.argv = [module, *sys.argv[3:]]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
