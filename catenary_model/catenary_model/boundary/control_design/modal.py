"""Modal approximation of the wave field by sines and cosines (3.32), (3.33)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def cosines_and_sines(waves: Complex) -> Array:
    """Return Re and -Im of complex waves (..., n) side by side: Re(a exp(i ...)) = waves @ (Re a, Im a), (..., 2 n)."""
    return np.concatenate((waves.real, -waves.imag), axis=-1)


def modal_gain(L: Array, row_weight: Array, amplitude_weight: Array, alpha: float) -> Array:
    """Return K_mod, g = K_mod x, of the regularised least squares (3.32).

    Minimises |row_weight (L g - x)|^2 + alpha |g / amplitude_weight|^2. L has shape (rows, amplitudes), K_mod the
    transposed one. Raises ValueError unless alpha > 0: more harmonics than nodes are usual.
    """
    if not alpha > 0.0:
        raise ValueError(f"alpha = {alpha} must be above 0")
    weighted = row_weight[:, None] * L * amplitude_weight
    normal = weighted.T @ weighted + alpha * np.eye(L.shape[1])
    return np.asarray(amplitude_weight[:, None] * np.linalg.solve(normal, weighted.T * row_weight))
