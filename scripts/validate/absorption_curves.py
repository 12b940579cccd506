"""What the study of the absorbing boundaries finds: reflection over frequency, a wire that a dropper moves through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary import AHEAD, BEHIND

Array = NDArray[np.float64]

ENDS = {BEHIND: "behind", AHEAD: "ahead"}
LOW = 30.0
"""The goals of the rms and of the worst hold up to here, Hz."""


@dataclass(frozen=True)
class Curve:
    """Reflected amplitude over frequency, as a share of what a clamped end returns."""

    frequency: Array
    share: Array

    @property
    def rms(self) -> float:
        """Up to LOW, %."""
        return 100.0 * float(np.sqrt(np.mean(self.share[self.frequency <= LOW] ** 2)))

    @property
    def worst(self) -> float:
        """Up to LOW, %."""
        return 100.0 * float(np.max(self.share[self.frequency <= LOW]))

    @property
    def above(self) -> float:
        """Worst above LOW, %."""
        return 100.0 * float(np.max(self.share[self.frequency > LOW], initial=0.0))


Curves = dict[tuple[int, int, int], dict[str, Curve]]
"""By speed (km/h), wire and end: by kind."""


@dataclass(frozen=True)
class Snapshot:
    """Contact wire at one time."""

    time: float
    """s."""
    dropper: float | None
    """Where the dropper is, m; None: it has left the domain."""
    layered: Array
    """Deviation on the nodes of the domain with layers, m."""
    unbounded: Array
    """On those of the one without ends, m."""


@dataclass(frozen=True)
class Passing:
    """A contact wire that is pushed at x = 0 while a dropper moves through, with layers and without ends."""

    kmh: int
    x: Array
    """Nodes of the domain with layers, m."""
    far: Array
    """Of the one without ends, m."""
    fading: Array
    """Share of a dropper's stiffness on the former nodes."""
    inside: float
    """Where the layers begin, m from the middle."""
    snapshots: Sequence[Snapshot]
