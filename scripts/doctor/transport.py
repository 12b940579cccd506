"""What the messages of a ride go through: shared memory, sockets, the folder of the bag."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from doctor.finding import CHANGE, NOTE, Finding, Machine
from phil_node.shared_memory import litter

MIB = 1 << 20
SHM_CHANGE, SHM_NOTE = 16 * MIB, 64 * MIB
"""Free shared memory: Fast DDS takes about 0.6 MiB a process, five for a ride and one for each viewer. A participant
that gets none speaks by UDP, or not at all."""
BAG_RATE = 3 * MIB
"""What a recorder of a ride at 500 Hz writes at most, bytes a second; 1.8 MiB/s was seen."""
DISK_CHANGE, DISK_NOTE = 600.0, 3600.0
"""Time of recording in s for which there is room."""
SLOW_SYNC = 1.0
"""Time in s that the disk may take for what a bag gains in about ten seconds."""
BLOCK = 32 * MIB
BUFFER = 212992
"""Default of Linux for the largest receive buffer of a socket, bytes: 400 states of the wire."""


def shared_memory(machine: Machine, folder: Path = Path("/dev/shm")) -> Iterator[Finding]:
    """Size and room of /dev/shm, and what dead processes have left there."""
    try:
        room = os.statvfs(folder)
    except OSError as error:
        do = "sudo mount -t tmpfs tmpfs /dev/shm"
        yield Finding("shared memory", "none", CHANGE, f"{folder}: {error.strerror}; all messages go by UDP", do)
        return
    size, free = room.f_blocks * room.f_frsize, room.f_bavail * room.f_frsize
    value = f"{free / MIB:.0f} MiB free of {size / MIB:.0f}"
    if not os.access(folder, os.W_OK):
        yield Finding("shared memory", value, CHANGE, f"{folder} cannot be written", f"sudo chmod 1777 {folder}")
    elif free >= SHM_NOTE:
        yield Finding("shared memory", value)
    else:
        verdict = CHANGE if free < SHM_CHANGE else NOTE
        do = f"sudo mount -o remount,size=256M {folder}   (in a container: start it with --shm-size=256m or --ipc=host)"
        yield Finding("shared memory", value, verdict, "a ride with viewers may fill it: messages are lost then", do)
    old = litter(folder=folder)
    if old:
        do = "they go with the next start of a node; at once: fastdds shm clean"
        yield Finding("left shared memory", f"{len(old)} files of dead processes", NOTE, "they take room", do)
    else:
        yield Finding("left shared memory", "none")


def sockets(machine: Machine) -> Iterator[Finding]:
    """Buffers of UDP and of Unix sockets."""
    for what in ("rmem", "wmem"):
        name, found = f"net.core.{what}_max", machine.number(f"/proc/sys/net/core/{what}_max")
        if found is None:
            # In a container's own network it is not there, and that of the host holds.
            yield Finding(name, "not to be seen here (the host's holds)")
        elif found >= BUFFER:
            yield Finding(name, f"{found / 1024:.0f} KiB")
        else:
            do = f"sudo sysctl -w {name}={20 * BUFFER}"
            yield Finding(name, f"{found / 1024:.0f} KiB", NOTE, "discovery and messages by UDP may be dropped", do)
    name, found = "net.unix.max_dgram_qlen", machine.number("/proc/sys/net/unix/max_dgram_qlen")
    if found is None:
        yield Finding(name, "not to be seen here (the host's holds)")
    elif found >= 10:
        yield Finding(name, f"{found} datagrams")
    else:
        why = "a peer that is held up for that many messages of the loop loses the next"
        yield Finding(name, f"{found} datagrams", NOTE, why, f"sudo sysctl -w {name}=512")


def disk(machine: Machine, folder: Path) -> Iterator[Finding]:
    """Room and speed of the folder for bags; a file is written there and removed."""
    where = next((path for path in (folder, *folder.parents) if path.is_dir()), Path("/"))
    room = os.statvfs(where)
    free = room.f_bavail * room.f_frsize
    lasts = free / BAG_RATE
    value = f"{free / 2**30:.1f} GiB free, {lasts / 3600:.1f} h of recording ({where})"
    if lasts >= DISK_NOTE:
        yield Finding("disk", value)
    else:
        verdict = CHANGE if lasts < DISK_CHANGE else NOTE
        yield Finding(
            "disk", value, verdict, "a ride ends when the disk is full", "make room, or ride with --out elsewhere"
        )
    if free < 4 * BLOCK:
        return
    try:
        seconds = _write(where)
    except OSError as error:
        do = f"sudo chown $USER {where}, or ride with --out elsewhere"
        yield Finding("disk speed", "cannot be written", CHANGE, f"{where}: {error.strerror}", do)
        return
    value = f"{BLOCK / MIB / seconds:.0f} MiB/s with what it takes to be on the disk"
    if seconds <= SLOW_SYNC:
        yield Finding("disk speed", value)
    else:
        verdict = CHANGE if BLOCK / seconds < BAG_RATE else NOTE
        why = f"a bag grows by up to {BAG_RATE / MIB:g} MiB/s and is kept in memory meanwhile"
        yield Finding(
            "disk speed", value, verdict, why, "ride with --out on a disk of this machine that nobody else uses"
        )


def _write(folder: Path) -> float:
    # What cannot be packed: a file system may do so.
    block = os.urandom(MIB)
    with tempfile.NamedTemporaryFile(dir=folder, prefix=".doctor-") as file:
        begun = time.perf_counter()
        for _ in range(BLOCK // MIB):
            file.write(block)
        file.flush()
        os.fsync(file.fileno())
        return time.perf_counter() - begun


LOOKS = (shared_memory, sockets)
