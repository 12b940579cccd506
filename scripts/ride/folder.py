"""The folder of a ride: what is in it, and what may be replaced."""

from __future__ import annotations

import shutil
from pathlib import Path

PRODUCTS = (
    "bag",
    "params.yaml",
    "line.yaml",
    "pantograph.yaml",
    "report.json",
    "report.html",
    "ride.png",
    "figures",
    "logs",
)
"""All that a ride leaves. Anything else in the folder is somebody's and stays."""


def clear(folder: Path, overwrite: bool) -> bool:
    """Make room for a ride; tell whether there is room. An earlier ride goes only with ``overwrite``, and then whole.

    Raises
    ------
    OSError
        The folder cannot be read or changed.
    """
    there = [folder / name for name in PRODUCTS if (folder / name).exists()]
    if there and not overwrite:
        return False
    for path in there:
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
    return True
