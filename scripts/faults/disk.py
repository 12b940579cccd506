"""A small disk for a bag: a file system of its own where that is allowed, else a limit of the size of files."""

from __future__ import annotations

import resource
import subprocess
from pathlib import Path

SIZE = 2 << 20
"""Bytes: a ride at 500 Hz fills them within 2 s."""


class SmallDisk:
    """A tmpfs on ``folder``, or nothing if the system forbids it; `limit` then does what is left to do."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        command = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "phil-faults", str(folder)]
        try:
            self.mounted = subprocess.run(command, capture_output=True).returncode == 0
        except OSError:
            self.mounted = False

    def limit(self, process: int) -> None:
        """Limit the files of the process, where the disk itself could not be made small."""
        if not self.mounted:
            resource.prlimit(process, resource.RLIMIT_FSIZE, (SIZE, SIZE))

    @property
    def kind(self) -> str:
        """Say what it is."""
        size = f"{SIZE >> 20} MiB"
        return f"tmpfs of {size}" if self.mounted else f"files limited to {size} (a mount is not allowed)"

    def close(self) -> None:
        """Take it away with all that is on it."""
        if self.mounted:
            subprocess.run(["umount", "-l", str(self.folder)], capture_output=True)
