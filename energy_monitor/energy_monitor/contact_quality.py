"""Statistics of the contact force, low-passed at 20 Hz as EN 50317 asks.

EN 50317 names the cut-off frequency, not the filter: a causal Butterworth low-pass is used, its order is a parameter.
The filter starts in the steady state of the first sample, so that it has no start-up transient of its own. Contact is
lost where the *measured* force (before the 20 Hz low-pass, which would hide a short loss) is at or below a threshold;
a loss counts if it lasts long enough, as an arc does. :class:`ContactQuality` takes one cycle at a time,
:func:`contact_quality_of` a whole ride.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from energy_monitor.butterworth import sections_of, steady_state

Array = NDArray[np.float64]

CUTOFF = 20.0
"""Hz, EN 50317."""


@dataclass(frozen=True)
class ContactStatistics:
    """What is said of a ride's contact force: N, but for ``loss_share`` (1) and the two counts.

    ``sigma`` is the root mean square about the mean (division by the number of samples). ``loss_share`` and ``losses``
    are of those losses that last long enough to count. All zero for no samples.
    """

    samples: int = 0
    mean: float = 0.0
    sigma: float = 0.0
    minimum: float = 0.0
    maximum: float = 0.0
    loss_share: float = 0.0
    losses: int = 0

    @property
    def statistical_minimum(self) -> float:
        """Mean - 3 sigma, N."""
        return self.mean - 3.0 * self.sigma

    @property
    def statistical_maximum(self) -> float:
        """Mean + 3 sigma, N."""
        return self.mean + 3.0 * self.sigma


def low_pass(ts: float, cutoff: float = CUTOFF, order: int = 6) -> Array:
    """Design the Butterworth low-pass as second-order sections, shape (ceil(order / 2), 6).

    Raises
    ------
    ValueError
        The cut-off frequency (Hz) is not below half the sampling rate 1 / ``ts``, or the order is below 1.
    """
    if not 0.0 < cutoff < 0.5 / ts:
        raise ValueError(f"cut-off {cutoff:g} Hz has to lie between 0 and {0.5 / ts:g} Hz")
    return sections_of(order, cutoff, 1.0 / ts)


def low_passed(force: Array, ts: float, cutoff: float = CUTOFF, order: int = 6) -> Array:
    """Low-pass a whole record (N, one entry a cycle) as the live monitor does: causal, steady at the first sample."""
    sections = low_pass(ts, cutoff, order)
    if force.size == 0:
        return np.zeros(0)
    from scipy.signal import sosfilt  # half a second to load, and a ride needs it not

    filtered: Array = sosfilt(sections, force, zi=steady_state(sections) * force[0])[0]
    return filtered


def run_in_cycles(run_in: float, ts: float) -> int:
    """Give the first cycle at or after ``run_in`` s; a millionth of a cycle is forgiven as rounding."""
    return max(0, math.ceil(run_in / ts - 1e-6))


def cycles_of_loss(duration: float, ts: float) -> int:
    """Give the cycles of the shortest loss that counts, from its ``duration`` in s; at least one."""
    return max(1, math.ceil(duration / ts - 1e-6))


def losses_of(lost: NDArray[np.bool_], least: int = 1) -> NDArray[np.int64]:
    """List the losses of at least ``least`` entries in a record of lost contact: first entry and length, (n, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], lost, [False]]).astype(np.int8)))
    begin, length = edges[::2], edges[1::2] - edges[::2]
    found: NDArray[np.int64] = np.stack([begin, length], axis=1)[length >= least].astype(np.int64)
    return found


class LowPass:
    """The filter of :func:`low_pass` for one sample at a time (scalars: an array call costs more than the filter)."""

    def __init__(self, sections: Array) -> None:
        """Take sections of shape (n, 6), normalised to a0 = 1 as scipy gives them."""
        self._steady = [(float(a), float(b)) for a, b in steady_state(sections)]
        self._coefficients = [(float(s[0]), float(s[1]), float(s[2]), float(s[4]), float(s[5])) for s in sections]
        self.clear()

    def clear(self) -> None:
        """Forget the past: the next sample is taken as the steady state."""
        self._state = [[0.0, 0.0] for _ in self._coefficients]
        self._started = False

    def step(self, value: float) -> float:
        """Filter one sample (transposed direct form II)."""
        if not self._started:
            self._state = [[a * value, b * value] for a, b in self._steady]
            self._started = True
        for (b0, b1, b2, a1, a2), state in zip(self._coefficients, self._state, strict=True):
            out = b0 * value + state[0]
            state[0] = b1 * value - a1 * out + state[1]
            state[1] = b2 * value - a2 * out
            value = out
        return value


class ContactQuality:
    """Running statistics of the contact force, a cycle at a time (Welford's recursion for mean and variance)."""

    def __init__(
        self,
        ts: float,
        run_in: float,
        loss_threshold: float,
        cutoff: float = CUTOFF,
        order: int = 6,
        loss_duration: float = 0.0,
    ) -> None:
        """Leave out the first ``run_in`` s; contact is lost at or below ``loss_threshold`` N; ``cutoff`` in Hz.

        A loss counts, from its beginning on, once it has lasted ``loss_duration`` s.
        """
        self._filter = LowPass(low_pass(ts, cutoff, order))
        self._first = run_in_cycles(run_in, ts)
        self._threshold = loss_threshold
        self._least = cycles_of_loss(loss_duration, ts)
        self.clear()

    def clear(self) -> None:
        """Forget the ride."""
        self._filter.clear()
        self.force = 0.0
        self.samples = 0
        self._mean = 0.0
        self._square = 0.0
        self._minimum = math.inf
        self._maximum = -math.inf
        self._lost_cycles = 0
        self._losses = 0
        self._lost = 0

    def add(self, cycle: int, force: float) -> float:
        """Take the measured ``force`` in N of cycle k; cycles come in order. Gives the low-passed force in N."""
        filtered = self._filter.step(force)
        self.force = filtered
        if cycle < self._first:
            return filtered
        self.samples += 1
        deviation = filtered - self._mean
        self._mean += deviation / self.samples
        self._square += deviation * (filtered - self._mean)
        if filtered < self._minimum:
            self._minimum = filtered
        if filtered > self._maximum:
            self._maximum = filtered
        if force > self._threshold:
            self._lost = 0
            return filtered
        self._lost += 1
        if self._lost > self._least:
            self._lost_cycles += 1
        elif self._lost == self._least:
            self._lost_cycles += self._least
            self._losses += 1
        return filtered

    @property
    def statistics(self) -> ContactStatistics:
        """Statistics of the cycles after the run-in."""
        if self.samples == 0:
            return ContactStatistics()
        return ContactStatistics(
            samples=self.samples,
            mean=self._mean,
            sigma=math.sqrt(self._square / self.samples),
            minimum=self._minimum,
            maximum=self._maximum,
            loss_share=self._lost_cycles / self.samples,
            losses=self._losses,
        )


def statistics_of(filtered: Array, losses: NDArray[np.int64]) -> ContactStatistics:
    """Give the statistics of a low-passed force (N) and of the losses that count, first entry and length, (n, 2).

    The one place for a whole record: monitor, report, studies and the closed loop differ in the filter, in what they
    take for a loss, and in the cycles that they evaluate.
    """
    if filtered.size == 0:
        return ContactStatistics()
    return ContactStatistics(
        samples=int(filtered.size),
        mean=float(filtered.mean()),
        sigma=float(filtered.std()),
        minimum=float(filtered.min()),
        maximum=float(filtered.max()),
        loss_share=float(losses[:, 1].sum() / filtered.size),
        losses=len(losses),
    )


def contact_quality_of(
    force: Array,
    ts: float,
    run_in: float,
    loss_threshold: float,
    cutoff: float = CUTOFF,
    order: int = 6,
    loss_duration: float = 0.0,
) -> ContactStatistics:
    """Give the statistics of a whole ride from its measured force (N, entry k is cycle k).

    Losses shorter than ``loss_duration`` in s are left out.
    """
    first = run_in_cycles(run_in, ts)
    filtered = low_passed(force, ts, cutoff, order)[first:]
    return statistics_of(filtered, losses_of(force[first:] <= loss_threshold, cycles_of_loss(loss_duration, ts)))
