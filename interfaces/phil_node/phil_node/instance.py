"""One node of a name on a machine and a domain: a second one, started by accident, does not begin."""

from __future__ import annotations

import hashlib
import socket
from pathlib import Path

LONGEST_NAME = 100
"""Bytes of a socket's name; a longer one is cut and made unique by its digest. Linux allows 107."""


class AlreadyRunning(RuntimeError):  # noqa: N818 - says what is the matter
    """Another process on this machine is that node."""


def claim(name: str, domain: int) -> socket.socket:
    """Be the only process on this machine that is the node ``name`` (full) on the ROS ``domain``.

    Returns
    -------
    socket.socket
        The claim: it holds until the socket is closed or the process ends, however it ends, and leaves nothing behind.
        It is a name in the kernel (an abstract Unix socket, Linux only) at which nobody listens.

    Raises
    ------
    AlreadyRunning
        With one line that says which process is it, and what to do.
    """
    held = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    address = _address(name, domain)
    try:
        held.bind("\0" + address)
    except OSError:
        held.close()
        number = holder(address)
        process = f" (process {number})" if number else ""
        raise AlreadyRunning(
            f"{name} already runs on this machine, on ROS domain {domain}{process}: end it first, or give this one "
            "another namespace (-r __ns:=/NAME) or another ROS_DOMAIN_ID"
        ) from None
    return held


def claimed(name: str, domain: int) -> bool:
    """Tell whether a process on this machine is the node ``name`` (full) on the ROS ``domain``."""
    return any(entry[7:] == [f"@{_address(name, domain)}"] for entry in _sockets())


def holder(address: str) -> int | None:
    """Give the number of the process that holds an abstract address; None if it is not to be seen (another user's)."""
    inodes = {f"socket:[{entry[6]}]" for entry in _sockets() if entry[7:] == [f"@{address}"]}
    for process in Path("/proc").glob("[0-9]*"):
        try:
            for handle in (process / "fd").iterdir():
                if str(handle.readlink()) in inodes:
                    return int(process.name)
        except OSError:
            continue
    return None


def _sockets() -> list[list[str]]:
    """Give the lines of the kernel's table of Unix sockets: the inode is the seventh word, a name the eighth."""
    try:
        return [line.split() for line in Path("/proc/net/unix").read_text(errors="replace").splitlines()]
    except OSError:
        return []


def _address(name: str, domain: int) -> str:
    address = f"phil-node/{domain}{name}"
    if len(address) <= LONGEST_NAME:
        return address
    digest = hashlib.sha256(address.encode()).hexdigest()[:32]
    return f"{address[: LONGEST_NAME - 33]}-{digest}"
