"""A wall clock that can be set for the processes of a ride alone: the machine's own belongs to others, too."""

from __future__ import annotations

import mmap
import os
import shutil
import struct
import subprocess
from pathlib import Path

SOURCE = Path(__file__).with_name("wall_clock.c")
HERE = "PHIL_WALL_CLOCK"


class WallClock:
    """Compiles the shim into a folder; processes that are started in its `environment` have this wall clock."""

    def __init__(self, folder: Path) -> None:
        """Be the machine's clock until it is `set`.

        Raises
        ------
        RuntimeError
            There is no compiler, or it fails.
        """
        compiler = shutil.which("gcc") or shutil.which("cc")
        if compiler is None:
            raise RuntimeError("there is no C compiler for the shim that shifts the wall clock")
        library = folder.absolute() / "wall_clock.so"
        command = [compiler, "-shared", "-fPIC", "-O2", "-o", str(library), str(SOURCE), "-ldl"]
        built = subprocess.run(command, capture_output=True, text=True)
        if built.returncode:
            raise RuntimeError(f"the shim that shifts the wall clock cannot be compiled: {built.stderr.strip()}")
        file = folder.absolute() / "wall_clock.offset"
        file.write_bytes(struct.pack("=q", 0))
        with file.open("r+b") as opened:
            self._offset = mmap.mmap(opened.fileno(), 8)
        preloaded = os.environ.get("LD_PRELOAD", "")
        self.environment = {HERE: str(file), "LD_PRELOAD": f"{library} {preloaded}".strip()}

    def set(self, seconds: float) -> None:
        """Let the clock be this much ahead of the machine's, at once and in all processes."""
        struct.pack_into("=q", self._offset, 0, round(seconds * 1e9))
