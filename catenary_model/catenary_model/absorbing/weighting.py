"""Which frequencies an absorbing boundary is designed for: the weighting function of (3.29)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from catenary_model.absorbing.stencil import Array


@dataclass(frozen=True)
class Weighting:
    """Weights over frequency, straight lines over log f between the given points and constant beyond them.

    Frequencies outside the band of interest must keep some weight, up to half the rate of the steps: what an
    absorbing boundary does there decides whether the scheme is stable.

    Attributes:
        frequencies: Hz, rising.
        weights: one each, not negative.
        band: lower and upper end of the band of interest, Hz: figures of merit are the largest values in it.
    """

    frequencies: tuple[float, ...]
    weights: tuple[float, ...]
    band: tuple[float, float]

    def __post_init__(self) -> None:
        """Check the table."""
        if len(self.frequencies) != len(self.weights) or not self.frequencies:
            raise ValueError("a weighting needs as many weights as frequencies")
        if self.frequencies[0] <= 0.0 or np.any(np.diff(self.frequencies) <= 0.0):
            raise ValueError("frequencies of a weighting must be positive and rise")
        if min(self.weights) < 0.0 or not np.all(np.isfinite(self.weights)):
            raise ValueError("weights must be finite and not negative")
        if not 0.0 < self.band[0] < self.band[1]:
            raise ValueError(f"the band {self.band} Hz must rise from above 0")

    def __call__(self, f: Array) -> Array:
        """Weights at frequencies in Hz."""
        return np.interp(np.log(f), np.log(self.frequencies), self.weights)

    def grid(self, dt: float, points: int = 240) -> Array:
        """Frequencies from far below the band to half the rate of the steps, Hz, evenly spaced over log f.

        Raises:
            ValueError: the band reaches above half the rate of the steps.
        """
        nyquist = 0.5 / dt
        if self.band[1] >= nyquist:
            raise ValueError(f"the band ends at {self.band[1]:g} Hz, half the rate of the steps is {nyquist:g} Hz")
        return np.geomspace(0.02 * self.band[0], 0.998 * nyquist, points)

    def inside(self, points: int = 200) -> Array:
        """Frequencies of the band, Hz, evenly spaced over log f."""
        return np.geomspace(*self.band, points)


def band(low: float, high: float, outside: float = 1e-2) -> Weighting:
    """Weight 1 from `low` to `high` Hz, falling to `outside` within a quarter of an octave or so on both sides."""
    return Weighting((0.8 * low, low, high, 1.25 * high), (outside, 1.0, 1.0, outside), (low, high))
