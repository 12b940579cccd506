"""The sockets of processes, as the kernel lists them: no more than /proc is needed."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Socket:
    """A bound socket: ``address`` and ``port`` of an internet one, ``path`` of a Unix one; ``waiting`` bytes unread."""

    kind: str
    address: str = ""
    port: int = 0
    path: str = ""
    waiting: int = 0


def sockets_of(pid: int) -> list[Socket]:
    """List the sockets of a process that are bound to an address or a path."""
    links = [fd.readlink().name for fd in Path(f"/proc/{pid}/fd").iterdir() if fd.is_symlink()]
    inodes = {match[1] for match in map(re.compile(r"socket:\[(\d+)\]").fullmatch, links) if match}
    found = []
    for kind in ("udp", "udp6", "tcp", "tcp6", "raw", "raw6"):
        table = Path(f"/proc/{pid}/net/{kind}")
        for row in map(str.split, table.read_text().splitlines()[1:] if table.exists() else ()):
            if row[9] in inodes:
                address, port = row[1].split(":")
                waiting = int(row[4].split(":")[1], 16)
                found.append(Socket(kind, _address(address), int(port, 16), waiting=waiting))
    for row in map(str.split, Path(f"/proc/{pid}/net/unix").read_text().splitlines()[1:]):
        if row[6] in inodes and len(row) > 7:
            found.append(Socket("unix", path=row[7]))
    return found


def _address(text: str) -> str:
    """Give an IPv4 address in its usual form; the kernel writes its four bytes as one number of the machine."""
    return ".".join(str(byte) for byte in reversed(bytes.fromhex(text))) if len(text) == 8 else text
