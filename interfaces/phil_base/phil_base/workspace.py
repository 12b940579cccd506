"""Where the workspace is: the folder in which the scripts put rides and find documents, however this was installed."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "PHIL_ROOT"
"""Environment variable that the shell scripts set to the folder of the workspace."""


def workspace() -> Path:
    """Give the folder of the workspace, absolute: where the scripts lie, else where the command was typed."""
    return Path(os.environ.get(VARIABLE) or ".").absolute()
