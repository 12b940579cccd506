"""Motion and force of a contact point as signals, and how well one follows another."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validate.en50318 import zero_phase

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signals:
    """Motion and force of the contact point of any model; each array (samples,)."""

    t: Array
    """Time since the start, s, evenly spaced."""
    w: Array
    """Height of the contact wire, m."""
    F: Array
    """Contact force, N."""

    @property
    def ts(self) -> float:
        """Distance of the samples, s."""
        return float(self.t[1] - self.t[0])

    def filtered(self) -> Signals:
        """Return the signals below 20 Hz."""
        return dataclasses.replace(self, w=zero_phase(self.w, self.ts), F=zero_phase(self.F, self.ts))

    def at(self, times: Array) -> Signals:
        """Return the samples nearest to these times (s). Raises ValueError where there is none within 1 % of a step."""
        index = np.rint((times - self.t[0]) / self.ts).astype(np.int64)
        if index.min() < 0 or index.max() >= self.t.size or np.abs(self.t[index] - times).max() > 0.01 * self.ts:
            raise ValueError("the signals have no samples at these times")
        return Signals(times, self.w[index], self.F[index])


@dataclass(frozen=True)
class Agreement:
    """How well one signal follows another."""

    correlation: float
    """1."""
    error: float
    """rms of the difference over the standard deviation of the truth, 1."""
    rms: float
    """rms of the difference, unit of the signals."""
    offset: float
    """Mean of the difference, unit of the signals."""


def agreement(signal: Array, truth: Array) -> Agreement:
    """Compare a signal with the truth, sample by sample."""
    difference = signal - truth
    rms = float(np.sqrt((difference**2).mean()))
    return Agreement(float(np.corrcoef(signal, truth)[0, 1]), rms / float(truth.std()), rms, float(difference.mean()))
