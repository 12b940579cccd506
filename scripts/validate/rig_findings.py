"""What the study of the test rig finds of one rig."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from test_rig_sim.identify import Pt2, Response
from test_rig_sim.linear_loop import LinearLoop
from test_rig_sim.parameters import Parameters

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Findings:
    """What the picture shows of one rig."""

    name: str
    parameters: Parameters
    found: Pt2
    response: Response
    chirp: tuple[Array, Array, Array]
    """Reference, position and model, m."""
    deviation: Array
    """After the force step, m."""
    loops: tuple[LinearLoop, ...]
    """The whole loop without and with frequency weighting."""
