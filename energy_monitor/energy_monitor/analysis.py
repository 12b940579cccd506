"""Numbers of a ride, recomputed from its bag: what `write_report` writes and the verdicts are made of.

Only what the rig, the catenary and the controller published is used; the monitor's and the controller's own books
are then compared with the result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from energy_monitor.bag import Bag, BagError, Table
from energy_monitor.beliefs import beliefs
from energy_monitor.books import accumulated_of, books_of
from energy_monitor.contact_quality import low_passed, run_in_cycles
from energy_monitor.report import comparison, nodes
from energy_monitor.report.alignment import Aligned, align, cycle_time
from energy_monitor.report.contact import companions, contact_force, losses
from energy_monitor.report.results import (
    Conservation,
    Correction,
    Held,
    Report,
    Ride,
    Series,
    Tracking,
)
from energy_monitor.report.verdicts import Limits, judge
from energy_monitor.report.wall_clock import WallTime, leap_of_stamps, wall_time
from phil_base import enumerations

Floats = NDArray[np.float64]

AT_ONCE = 10
"""A ride that follows within so many cycles followed from its beginning: a rig holds in cycle 0."""
LAG_WINDOW = 0.1
"""Largest lag between rig and wire that is searched for, s."""


@dataclass(frozen=True)
class Settings:
    """How to evaluate: `run_in` in s, `cutoff` in Hz and `order` of the force's low-pass.

    Contact is lost at or below `loss_threshold` in N; a loss counts from `loss_duration` in s on.
    """

    run_in: float = 2.0
    loss_threshold: float = 2.0
    cutoff: float = 20.0
    order: int = 6
    loss_duration: float = 0.0


def analyse(
    bag: Bag,
    settings: Settings,
    limits: Limits,
    *,
    parameters: Mapping[str, Mapping[str, Any]] | None = None,
    versions: Mapping[str, str] | None = None,
    ride: int | None = None,
) -> Report:
    """Make the report of the last ride in a bag, or of number `ride`.

    `parameters` (node, flat name, value) and `versions` are passed on to the report.

    Raises
    ------
    BagError
        A cycle topic is missing, or the three have no cycle in common.
    """
    # A ride whose parameters are at hand was recorded from its first cycle on.
    aligned = align(bag, whole=_uplift_force(parameters or {}) is not None, ride=ride)
    bag = aligned.bag
    ts = cycle_time(bag, aligned.rig)
    if settings.cutoff >= 0.5 / ts:
        raise BagError(f"the low-pass of {settings.cutoff:g} Hz needs more than the {1.0 / ts:g} cycles a second here")
    series = _series(bag, aligned, ts, settings)
    speed = float(np.median(aligned.catenary["speed"]))
    notes = list(aligned.notes)
    if aligned.missing:
        notes.append("Filters and spectra bridge missing cycles by straight lines.")
    beyond_run_in = bool(series.evaluated.any())
    if not beyond_run_in:
        notes.append(
            f"The ride is not longer than its run-in of {settings.run_in:g} s: the numbers are those of the run-in, "
            "position, energy and force are not judged."
        )
        series = _series(bag, aligned, ts, _without_run_in(settings))
    lost = losses(series, ts, settings.loss_threshold, settings.loss_duration)
    force = contact_force(series, settings.loss_duration, lost, prediction_error(aligned, series.evaluated))
    track = tracking(series, ts)
    conservation = conserved(series)
    agreement = comparison.books(series, bag, nodes.left_the_catenary(aligned))
    quality = comparison.contact_quality(
        series, bag, ts, settings.loss_threshold, settings.cutoff, settings.order, settings.loss_duration
    )
    wall = wall_time(bag, aligned.rig)
    warned, others = nodes.warnings(bag, aligned, ts, wall.jumped)
    notes += [note for note in (wall.note, leap_of_stamps(aligned.rig)) if note]
    if others:
        named = ", ".join(others[:5]) + (f" and {len(others) - 5} more" if len(others) > 5 else "")
        notes.append(f"Others than the ride's nodes warned on /diagnostics, not counted: {named}.")
    notes += nodes.several_processes(bag, aligned)
    return Report(
        ride=_ride(bag, aligned, ts, speed, series, wall),
        verdicts=judge(
            limits,
            speed,
            aligned,
            track,
            force,
            conservation,
            agreement,
            quality,
            nodes.retracted(aligned),
            nodes.mismatches(aligned),
            fallbacks=nodes.solver(aligned).fallbacks,
            bridged=nodes.bridged(aligned),
            uplift_force=_uplift_force(parameters or {}),
            beyond_run_in=beyond_run_in,
        ),
        streams=aligned.streams,
        tracking=track,
        contact_force=force,
        losses=lost,
        companions=companions(
            series, ts, settings.loss_threshold, settings.loss_duration, settings.cutoff, settings.order
        ),
        conservation=conservation,
        agreement=[*agreement, *quality],
        correction=correction(aligned),
        solver=nodes.solver(aligned),
        catenary=nodes.catenary(aligned, series.evaluated),
        timing=nodes.timing(bag),
        modes=nodes.modes(aligned, ts),
        warnings=warned,
        notes=notes,
        beliefs=[
            Held(one.name, one.parameter, one.of_rig, one.unit, one.believed, one.has, one.differs)
            for one in beliefs(parameters or {})
        ],
        parameters={node: dict(values) for node, values in (parameters or {}).items()},
        versions=dict(versions or {}),
        series=series,
    )


def tracking(series: Series, ts: float) -> Tracking:
    """Hold the rig's motion against the wire's: w_tr(k) - w_cat(k) and v_tr(k) - v_cat(k) after the run-in."""
    used = series.evaluated
    position, velocity = (series.w_tr - series.w_cat), (series.v_tr - series.v_cat)[used]
    error, wire = position[used], series.w_cat[used]
    grid = np.arange(series.cycle[used][0], series.cycle[used][-1] + 1)
    delay, likeness = correlation_lag(
        np.interp(grid, series.cycle, series.w_cat), np.interp(grid, series.cycle, series.w_tr), ts
    )
    return Tracking(
        position_error_rms=rms(error),
        position_error_max=float(np.abs(error).max()),
        position_error_mean=float(error.mean()),
        position_error_rms_ride=rms(position),
        velocity_error_rms=rms(velocity),
        velocity_error_max=float(np.abs(velocity).max()),
        lag=delay,
        correlation=likeness,
        displacement_mean=float(wire.mean()),
        displacement_min=float(wire.min()),
        displacement_max=float(wire.max()),
    )


def correlation_lag(
    leader: Floats, follower: Floats, ts: float, window: float = LAG_WINDOW
) -> tuple[float | None, float | None]:
    """Find by how many seconds `follower` lags `leader`, and their correlation there.

    The correlation coefficient is taken for all lags of whole cycles within +-`window` (s), always over the same
    number of samples, and the peak refined by a parabola through it and its neighbours. None if there is no peak
    inside the window, or nothing moves.
    """
    n = round(window / ts)
    core = len(leader) - 2 * n
    if core < 2 * n or core < 3:
        return None, None
    reference = leader[n : n + core] - leader[n : n + core].mean()
    windows = np.lib.stride_tricks.sliding_window_view(follower, core)
    means = windows.mean(axis=1)
    spread = np.sqrt(np.maximum(np.array([np.dot(w, w) for w in windows]) / core - means**2, 0.0))
    scale = spread * reference.std() * core
    if scale.min() <= 1e-12 * core:
        return None, None
    likeness = windows @ reference / scale
    best = int(likeness.argmax())
    if best in (0, 2 * n):
        return None, None
    left, middle, right = likeness[best - 1 : best + 2]
    curvature = left - 2.0 * middle + right
    shift = 0.5 * (left - right) / curvature if curvature < 0.0 else 0.0
    peak = middle - 0.25 * (left - right) * shift
    return float((best - n + shift) * ts), float(min(peak, 1.0))


def prediction_error(aligned: Aligned, used: NDArray[np.bool_]) -> float | None:
    """Hold the force predicted in cycle k against the F_tr(k+1) that came; rms in N, None if no two cycles follow."""
    came, said = aligned.rig.real("f_tr")[1:], aligned.command.real("f_predicted")[:-1]
    successive = (np.diff(aligned.cycle) == 1) & used[:-1]
    return rms(came[successive] - said[successive]) if successive.any() else None


def spectrum(force: Floats, ts: float) -> tuple[Floats, Floats]:
    """Estimate the power spectral density (Welch, Hann windows of up to 4.096 s): Hz and N^2/Hz, without f = 0."""
    length = min(len(force), round(4.096 / ts))
    if length < 8:
        return np.zeros(0), np.zeros(0)
    frequency, density = welch(force, fs=1.0 / ts, nperseg=length, detrend="constant")
    return np.asarray(frequency[1:], np.float64), np.asarray(density[1:], np.float64)


def conserved(series: Series) -> Conservation:
    """Draw up both books: sums, eqs. (3.46) and (3.47), and accumulated work and impulse."""
    energy, momentum = float(series.exchanged_energy[-1]), float(series.exchanged_momentum[-1])
    exchanged = series.exchanged_energy[series.evaluated]

    def most(values: Floats) -> float:
        return float(np.abs(values).max())

    def running(values: Floats) -> float | None:
        return float((np.abs(values[series.evaluated]) / exchanged).max()) if exchanged.min() > 0.0 else None

    return Conservation(
        e_tr=float(series.e_tr[-1]),
        e_cat=float(series.e_cat[-1]),
        delta_e=float(series.delta_e[-1]),
        delta_e_max=most(series.delta_e),
        work_tr=float(series.work_tr[-1]),
        work_cat=float(series.work_cat[-1]),
        delta_work=float(series.delta_work[-1]),
        delta_work_max=most(series.delta_work),
        exchanged_energy=energy,
        delta_e_share=_share(abs(float(series.delta_e[-1])), energy),
        delta_e_max_share=_share(most(series.delta_e), energy),
        delta_e_running_share=running(series.delta_e),
        delta_work_max_share=_share(most(series.delta_work), energy),
        delta_work_running_share=running(series.delta_work),
        p_tr=float(series.p_tr[-1]),
        p_cat=float(series.p_cat[-1]),
        delta_p=float(series.delta_p[-1]),
        delta_p_max=most(series.delta_p),
        impulse_tr=float(series.impulse_tr[-1]),
        impulse_cat=float(series.impulse_cat[-1]),
        delta_impulse=float(series.delta_impulse[-1]),
        delta_impulse_max=most(series.delta_impulse),
        exchanged_momentum=momentum,
        delta_p_share=_share(abs(float(series.delta_p[-1])), momentum),
        delta_p_max_share=_share(most(series.delta_p), momentum),
        delta_impulse_max_share=_share(most(series.delta_impulse), momentum),
        work_difference=float(series.e_tr[-1] - series.work_tr[-1]),
    )


def correction(aligned: Aligned) -> Correction:
    """Tell how much the correction force did, and how often a bound held it (within a thousandth of a newton)."""
    force, low, high = (aligned.command.real(name) for name in ("f_cor", "f_cor_lower", "f_cor_upper"))
    near = 1e-3
    active = aligned.command["correction"] != enumerations.Correction.OFF
    held = active & ((force <= low + near) | (force >= high - near))
    return Correction(
        rms=rms(force),
        mean=float(force.mean()),
        largest=float(np.abs(force).max()),
        at_bounds_share=float(held.mean()),
        forced_share=float((active & ((low > near) | (high < -near))).mean()),
        modes=nodes.counts(aligned.command["correction"], enumerations.Correction),
    )


def rms(values: Floats) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _uplift_force(parameters: Mapping[str, Mapping[str, Any]]) -> float | None:
    value = parameters.get("test_rig_sim", {}).get("uplift_force")
    return float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else None


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole > 0.0 else None


def _without_run_in(settings: Settings) -> Settings:
    return replace(settings, run_in=0.0)


def _evaluated(cycle: NDArray[np.int64], counted: NDArray[np.bool_], wait: int) -> NDArray[np.bool_]:
    """Choose what tracking and force are judged by: cycles that follow the catenary, `wait` cycles after they began to.

    A ride that never followed it is taken as a whole.
    """
    if not counted.any():
        return np.asarray(cycle >= wait)
    begins = counted & ~np.concatenate([[False], counted[:-1]])
    since = np.maximum.accumulate(np.where(begins, cycle, 0))
    since[since <= AT_ONCE] = 0
    return np.asarray(counted & (cycle - since >= wait))


def _spectrum_within(
    force: Floats, grid: NDArray[np.int64], evaluated: NDArray[np.int64], ts: float
) -> tuple[Floats, Floats]:
    """Spectrum of a force on an even grid of cycles, from the first that is judged to the last: without a landing."""
    if not len(evaluated):
        return np.zeros(0), np.zeros(0)
    return spectrum(force[(grid >= evaluated[0]) & (grid <= evaluated[-1])], ts)


def _series(bag: Bag, aligned: Aligned, ts: float, settings: Settings) -> Series:
    rig, catenary, command = aligned.rig, aligned.catenary, aligned.command
    cycle = aligned.cycle
    counted = nodes.counted(aligned)
    f_tr, v_tr = rig.real("f_tr"), rig.real("v_tr")
    books = books_of(f_tr, v_tr, catenary.real("f_cat"), catenary.real("v_cat"), ts, counted)
    accumulated = accumulated_of(
        rig.real("work"), catenary.real("work"), rig.real("impulse"), catenary.real("impulse"), counted
    )
    evaluated = _evaluated(cycle, counted, run_in_cycles(settings.run_in, ts))
    grid = np.arange(cycle[0], cycle[-1] + 1)
    even = np.interp(grid, cycle, f_tr)
    filtered = low_passed(even, ts, settings.cutoff, settings.order)
    frequency, density = _spectrum_within(even, grid, cycle[evaluated], ts)
    places, forces = _beside(catenary)
    return Series(
        cycle=cycle,
        time=cycle.astype(np.float64) * ts,
        w_tr=rig.real("w_tr"),
        w_cat=catenary.real("w_cat"),
        v_tr=v_tr,
        v_cat=catenary.real("v_cat"),
        f_tr=f_tr,
        f_raw=rig.real("f_raw"),
        f_filtered=filtered[cycle - cycle[0]],
        f_cor=command.real("f_cor"),
        f_cor_lower=command.real("f_cor_lower"),
        f_cor_upper=command.real("f_cor_upper"),
        delta_e=books.delta_e,
        delta_p=books.delta_p,
        delta_work=accumulated.delta_work,
        delta_impulse=accumulated.delta_impulse,
        e_tr=books.e_tr,
        e_cat=books.e_cat,
        p_tr=books.p_tr,
        p_cat=books.p_cat,
        exchanged_energy=books.exchanged_energy,
        exchanged_momentum=books.exchanged_momentum,
        work_tr=accumulated.work_tr,
        work_cat=accumulated.work_cat,
        impulse_tr=accumulated.impulse_tr,
        impulse_cat=accumulated.impulse_cat,
        track_position=catenary.real("track_position"),
        evaluated=evaluated,
        frequency=frequency,
        density=density,
        books=comparison.own_books(bag),
        shapes=bag.find("catenary_model/wire_shape", "WireShape"),
        turnaround=nodes.turnaround(bag),
        companion_force=forces,
        companion_place=places,
    )


def _beside(catenary: Table) -> tuple[Floats, Floats]:
    """Give place (n,) and force (cycles, n) of the further pantographs; none where the bag knows of none.

    One whose number changes within a ride was put together by hand: nothing can be said of it.
    """
    none = np.zeros(0), np.zeros((len(catenary), 0))
    if "companion_force" not in catenary.columns or not len(catenary):
        return none
    forces, places = catenary.entries("companion_force"), catenary.entries("companion_place")
    count = len(forces[0])
    if not count or any(len(force) != count for force in forces) or len(places[0]) != count:
        return none
    return np.asarray(places[0], dtype=np.float64), np.stack(forces).astype(np.float64)


def _ride(bag: Bag, aligned: Aligned, ts: float, speed: float, series: Series, wall: WallTime) -> Ride:
    simulated = float((aligned.cycle[-1] - aligned.cycle[0] + 1) * ts)
    started = datetime.fromtimestamp(float(aligned.rig.log_time[0]) * 1e-9, tz=timezone.utc)
    return Ride(
        bag=bag.path.name,
        storage=bag.storage,
        recording_whole=bag.complete,
        started=started.strftime("%Y-%m-%d %H:%M:%S UTC"),
        cycles=len(aligned.cycle),
        ts=ts,
        simulated_time=simulated,
        wall_time=wall.seconds,
        speed_factor=simulated / wall.seconds if wall.seconds > 0.0 and not wall.jumped else float("nan"),
        speed=speed,
        distance=float(series.track_position[-1] - series.track_position[0]),
        run_in=float(series.cycle[series.evaluated][0]) * ts,
        ended=aligned.ended,
    )
