"""What a ride of the closed loop differs in from the wire that it follows, and from the coupling without a rig.

tracking   true position and velocity of the drive against those of the wire at the contact point
lag        where the cross-correlation of both, within `BAND`, has its peak
books      energy and momentum of either side since cycle 0, by three measures: the printed sums (3.46) and (3.47); the
           work and impulse that rig and wire accumulated between their samples; and those that were really done, which
           only a simulation knows. Each error is compared with what was exchanged in the whole ride, and until then
force      below 20 Hz without phase, against the direct coupling: statistics, spectrum, sample by sample
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import csd, welch

from energy_monitor.books import books_of
from energy_monitor.contact_quality import CUTOFF, losses_of, statistics_of
from validate.en50318 import zero_phase
from validate.impedance_ride import RUN_IN, Direct, Record

Array = NDArray[np.float64]

SETTLED, TAIL = 5.0, 0.3
"""From s on force and motion are evaluated, and up to s before the end, so that no filter sees it."""
BAND = (0.3, CUTOFF)
"""Frequencies of lag and spectrum, Hz."""
REACH = 0.1
"""Largest lag that is searched for, s."""
WIDTH = 1.0
"""Width of the spectrum's bands, Hz."""
_SEGMENT = 2.048
"""Length of a window of the spectra, s."""


def figure(label: str, unit: str = "", scale: float = 1.0) -> Any:
    """Declare a figure: what it is, the unit that people read, and by what to multiply it for that unit."""
    return field(metadata={"label": label, "unit": unit, "scale": scale})


@dataclass(frozen=True)
class Statistics:
    """A contact force in N, below 20 Hz without phase but for the losses of contact."""

    mean: float = figure("mean force", "N")
    sigma: float = figure("sigma of the force", "N")
    least: float = figure("smallest force", "N")
    most: float = figure("largest force", "N")
    losses: float = figure("losses of contact")
    loss_share: float = figure("time without contact", "%", 100.0)


@dataclass(frozen=True)
class Figures:
    """All figures of one ride in SI units; what cannot be told is NaN."""

    position: float = figure("position error, rms", "mm", 1e3)
    position_max: float = figure("position error, largest", "mm", 1e3)
    velocity: float = figure("velocity error, rms", "mm/s", 1e3)
    lag: float = figure("lag of the position", "ms", 1e3)
    velocity_lag: float = figure("lag of the velocity", "ms", 1e3)
    energy: float = figure("|dE| printed sum / exchanged", "%", 100.0)
    energy_then: float = figure("|dE| printed sum / exchanged by then", "%", 100.0)
    work: float = figure("|dE| accumulated / exchanged", "%", 100.0)
    work_then: float = figure("|dE| accumulated / exchanged by then", "%", 100.0)
    true_work: float = figure("|dE| true work / exchanged", "%", 100.0)
    true_work_then: float = figure("|dE| true work / exchanged by then", "%", 100.0)
    momentum: float = figure("|dp| printed sum / exchanged", "%", 100.0)
    momentum_then: float = figure("|dp| printed sum / exchanged by then", "%", 100.0)
    impulse: float = figure("|dp| accumulated / exchanged", "%", 100.0)
    true_impulse: float = figure("|dp| true impulse / exchanged", "%", 100.0)
    true_impulse_then: float = figure("|dp| true impulse / exchanged by then", "%", 100.0)
    exchanged_energy: float = figure("exchanged energy", "J")
    exchanged_momentum: float = figure("exchanged momentum", "N s")
    mean: float = figure("mean force", "N")
    mean_change: float = figure("mean force against no rig", "%", 100.0)
    sigma: float = figure("sigma of the force", "N")
    sigma_change: float = figure("sigma against no rig", "%", 100.0)
    least: float = figure("smallest force", "N")
    most: float = figure("largest force", "N")
    difference: float = figure("force against no rig in time, rms", "N")
    spectrum: float = figure("spectrum against no rig, rms over bands", "%", 100.0)
    coherence: float = figure("coherence with no rig")
    losses: float = figure("losses of contact")
    loss_share: float = figure("time without contact", "%", 100.0)
    f_cor: float = figure("F_cor, rms", "N")
    f_cor_max: float = figure("F_cor, largest", "N")
    program: float = figure("quadratic program, median", "ms", 1e3)
    program_p99: float = figure("quadratic program, 99th percentile", "ms", 1e3)
    iterations: float = figure("iterations, mean")
    iterations_max: float = figure("iterations, most")
    fallbacks: float = figure("cycles without a solution")
    controller: float = figure("controller's cycle, median", "ms", 1e3)
    left: float = figure("left the loop at", "s")
    tripped: float = figure("limits of the rig tripped at", "s")


def whole_spans(ts: float, end: float, passing: float, settled: float = SETTLED) -> slice:
    """Choose the cycles that are evaluated: as many whole spans as fit between `settled` and `TAIL` before `end` (s).

    `passing` is the time that a span takes (s). Raises ValueError if not even one fits.
    """
    count = math.floor((end - TAIL - settled) / passing + 1e-9)
    if count < 1:
        raise ValueError(f"no whole span of {passing:.2f} s fits between {settled:g} s and {end - TAIL:g} s")
    first = round(settled / ts)
    return slice(first, first + round(count * passing / ts))


def in_units(found: Figures | Statistics) -> dict[str, float]:
    """Give all figures by name in the units that people read."""
    return {entry.name: getattr(found, entry.name) * entry.metadata["scale"] for entry in fields(found)}


def statistics(force: Array, ts: float, window: slice) -> Statistics:
    """Evaluate a contact force (N, one entry a cycle of ts s) within the window."""
    found = statistics_of(zero_phase(force, ts)[window], losses_of(force[window] <= 0.0))
    return Statistics(
        mean=found.mean,
        sigma=found.sigma,
        least=found.minimum,
        most=found.maximum,
        losses=float(found.losses),
        loss_share=found.loss_share,
    )


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def spectral_lag(leader: Array, follower: Array, ts: float) -> float:
    """Say how far (s) the follower is behind the leader by the phase of their cross spectrum within `BAND`.

    Good to some 10 us, which the study's goals need; the report's `energy_monitor.analysis.correlation_lag` also gives
    a correlation and needs no band.

    First the peak among whole samples within `REACH`. With these taken out (and both cut to the same length), the peak
    lies where sum |S| omega sin(omega tau + arg S) = 0, S being the cross spectrum; to first order in tau that is a
    quotient of sums. NaN if nothing moves.
    """
    frequency, cross = _cross_spectrum(leader, follower, ts)
    if not np.abs(cross).max() > 0.0:
        return math.nan
    reach = round(REACH / ts)
    whole = int(np.roll(np.fft.irfft(cross), reach)[: 2 * reach + 1].argmax()) - reach
    kept = leader.size - abs(whole)
    frequency, cross = _cross_spectrum(leader[max(-whole, 0) :][:kept], follower[max(whole, 0) :][:kept], ts)
    weight = np.abs(cross) * frequency
    return float(whole * ts - (weight * np.angle(cross)).sum() / (2.0 * np.pi * (weight * frequency).sum()))


def _cross_spectrum(leader: Array, follower: Array, ts: float) -> tuple[Array, NDArray[np.complex128]]:
    """Return frequencies (Hz) and cross spectrum of both under a Hann window, zero outside `BAND`."""
    window, size = np.hanning(leader.size), 2 * leader.size
    one, other = (np.fft.rfft(window * (x - x.mean()), size) for x in (leader, follower))
    frequency: Array = np.asarray(np.fft.rfftfreq(size, ts), dtype=np.float64)
    return frequency, np.where((frequency >= BAND[0]) & (frequency <= BAND[1]), np.conj(one) * other, 0.0)


@dataclass(frozen=True)
class Spectra:
    """Both forces by bands of `WIDTH` within `BAND`; each array (bands,)."""

    middle: Array
    """Hz."""
    ours: Array
    """Root of the power within the band, N."""
    direct: Array
    """The same of the direct coupling, N."""
    shared: Array
    """Coherence, mean over the band, 1."""

    @property
    def difference(self) -> float:
        """Return rms over the bands of the difference over rms of the direct coupling's."""
        return rms(self.ours - self.direct) / rms(self.direct)

    @property
    def coherence(self) -> float:
        """Return the mean coherence, weighted with the direct coupling's power."""
        return float((self.shared * self.direct**2).sum() / (self.direct**2).sum())


def spectra(ours: Array, other: Array, ts: float) -> Spectra:
    """Compare the spectra of two forces (samples,) by bands (Welch, Hann)."""
    length = min(ours.size, round(_SEGMENT / ts))
    both = []
    for force in (ours, other):
        f, density = welch(force, 1.0 / ts, nperseg=length, detrend="constant")
        both.append(density)
    _, cross = csd(ours, other, 1.0 / ts, nperseg=length, detrend="constant")
    coherent = np.abs(cross) ** 2 / np.maximum(both[0] * both[1], 1e-300)
    edges = np.arange(0.5 * WIDTH, BAND[1] + 1e-9, WIDTH)
    within = [(f >= low) & (f < low + WIDTH) for low in edges if low + WIDTH <= BAND[1] + 1e-9]
    within = [band for band in within if band.any()]
    step = f[1] - f[0]
    roots = [np.array([math.sqrt(d[band].sum() * step) for band in within]) for d in both]
    middle = np.array([f[band].mean() for band in within])
    return Spectra(middle, roots[0], roots[1], np.array([coherent[band].mean() for band in within]))


@dataclass(frozen=True)
class Account:
    """Errors of energy (J) and momentum (N s) by one measure since cycle 0, each array (cycles,)."""

    energy: Array
    momentum: Array


@dataclass(frozen=True)
class Accounts:
    """The books of a ride by three measures, and what was exchanged until each cycle."""

    printed: Account
    accumulated: Account
    true: Account
    energy: Array
    """Exchanged energy, sum Ts |F_tr v_tr|, J."""
    momentum: Array
    """Exchanged momentum, sum Ts |F_tr|, N s."""


def accounts(record: Record) -> Accounts:
    """Keep the books of a ride anew from what rig and wire showed; in cycle 0 the rig follows nothing yet."""
    counted = np.arange(record.cycles) > 0
    sums = books_of(record.f_tr, record.v_tr, record.f_cat, record.v_cat, record.ts, counted)
    return Accounts(
        Account(sums.delta_e, sums.delta_p),
        Account(record.work - record.work_cat, record.impulse - record.impulse_cat),
        Account(record.true_work - record.work_cat, record.true_impulse - record.impulse_cat),
        sums.exchanged_energy,
        sums.exchanged_momentum,
    )


def _shares(error: Array, exchanged: Array, first: int) -> tuple[float, float]:
    """Return the largest error from cycle `first` on, over all that was exchanged, and over that until then."""
    size = np.abs(error[first:])
    return float(size.max() / exchanged[-1]), float((size / exchanged[first:]).max())


def evaluate(record: Record, direct: Direct, window: slice) -> Figures:
    """Make the figures of a ride. One that ended before the window does has only the time at which it did."""
    nothing = math.nan
    left = nothing if record.left is None else record.left
    tripped = nothing if record.tripped is None else record.tripped
    if record.cycles < window.stop:
        empty = dict.fromkeys(Figures.__dataclass_fields__, nothing)
        return Figures(**empty | {"left": left, "tripped": tripped})
    ts = record.ts
    w, v, w_cat, v_cat = (x[window] for x in (record.w, record.v, record.w_cat, record.v_cat))
    # The direct coupling has no entry for cycle 0.
    before = slice(window.start - 1, window.stop - 1)
    force, coupled = zero_phase(record.f, ts)[window], zero_phase(direct.f, ts)[before]
    found = spectra(record.f[window], direct.f[before], ts)
    ours, other = statistics(record.f, ts, window), statistics(direct.f, ts, before)
    books, first = accounts(record), round(RUN_IN / ts)
    energy = [_shares(a.energy, books.energy, first) for a in (books.printed, books.accumulated, books.true)]
    momentum = [_shares(a.momentum, books.momentum, first) for a in (books.printed, books.accumulated, books.true)]
    return Figures(
        position=rms(w - w_cat),
        position_max=float(np.abs(w - w_cat).max()),
        velocity=rms(v - v_cat),
        lag=spectral_lag(w_cat, w, ts),
        velocity_lag=spectral_lag(v_cat, v, ts),
        energy=energy[0][0],
        energy_then=energy[0][1],
        work=energy[1][0],
        work_then=energy[1][1],
        true_work=energy[2][0],
        true_work_then=energy[2][1],
        momentum=momentum[0][0],
        momentum_then=momentum[0][1],
        impulse=momentum[1][0],
        true_impulse=momentum[2][0],
        true_impulse_then=momentum[2][1],
        exchanged_energy=float(books.energy[-1]),
        exchanged_momentum=float(books.momentum[-1]),
        **asdict(ours),
        mean_change=ours.mean / other.mean - 1.0,
        sigma_change=ours.sigma / other.sigma - 1.0,
        difference=rms(force - coupled),
        spectrum=found.difference,
        coherence=found.coherence,
        f_cor=rms(record.f_cor[first:]),
        f_cor_max=float(np.abs(record.f_cor[first:]).max()),
        program=float(np.median(record.program)),
        program_p99=float(np.percentile(record.program, 99)),
        iterations=float(record.iterations.mean()),
        iterations_max=float(record.iterations.max()),
        fallbacks=float(record.fallbacks[-1]),
        controller=float(np.median(record.controller)),
        left=left,
        tripped=tripped,
    )
