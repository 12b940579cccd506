"""Reference trajectory of the layer: harmonics that run on and fade, (3.34) to (3.37)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.control_design.dispersion import Harmonics
from catenary_model.boundary.control_design.modal import cosines_and_sines

Array = NDArray[np.float64]


def damping_profile(nodes: int, damped: int, decay: float, growth: float) -> Array:
    """Return the diagonal of D (3.36) for `nodes` nodes from the end inwards, w and phi alike, (2 nodes,).

    sigma_w = decay (depth / damped)^growth, depth counted in nodes from the first undamped one outwards.
    """
    depth = np.clip(1.0 - np.arange(nodes) / damped, 0.0, None)
    return np.repeat(np.exp(-decay * depth**growth), 2)


def trajectory(harmonics: Harmonics, profile: Array, horizon: int) -> Array:
    """Return T (3.34) to (3.37): y_ref of steps 1 .. horizon per amplitude, (horizon, 2 nodes, 2 frequencies)."""
    damped = profile[:, None] * harmonics.field
    return np.stack([cosines_and_sines(damped * harmonics.shift**step) for step in range(1, horizon + 1)])
