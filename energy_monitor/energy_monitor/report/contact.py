"""The contact: statistics of its force, and its losses one by one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from energy_monitor.contact_quality import cycles_of_loss, losses_of, low_passed, statistics_of
from energy_monitor.report.results import Companion, ContactForce, Loss, Series


def contact_force(
    series: Series, duration: float, lost: Sequence[Loss], prediction: float | None = None
) -> ContactForce:
    """Give the statistics of EN 50317: force low-passed at 20 Hz after the run-in, loss by the measured force.

    `lost` are its losses, of which those count that last `duration` s; `prediction` is the rms error of the force
    that was predicted, N.
    """
    used = series.evaluated
    counted = np.array([(loss.cycle, loss.cycles) for loss in lost if loss.counted], np.int64).reshape(-1, 2)
    found = statistics_of(series.f_filtered[used], counted)
    return ContactForce(
        samples=found.samples,
        mean=found.mean,
        sigma=found.sigma,
        sigma_share=found.sigma / found.mean if found.mean > 0.0 else float("nan"),
        minimum=found.minimum,
        maximum=found.maximum,
        statistical_minimum=found.statistical_minimum,
        statistical_maximum=found.statistical_maximum,
        loss_share=found.loss_share,
        losses=found.losses,
        loss_duration=duration,
        shorter_losses=len(lost) - found.losses,
        raw_minimum=float(series.f_raw[used].min()),
        raw_maximum=float(series.f_raw[used].max()),
        prediction_error=prediction,
    )


def companions(
    series: Series, ts: float, threshold: float, duration: float, cutoff: float, order: int
) -> list[Companion]:
    """Give the statistics of each further pantograph, evaluated as the one on the rig: see `contact_force`.

    The force (N) is low-passed at ``cutoff`` (Hz); contact is lost at or below ``threshold`` (N) for ``duration`` (s).
    """
    used, least = series.evaluated, cycles_of_loss(duration, ts)
    grid = np.arange(series.cycle[0], series.cycle[-1] + 1)
    found = []
    for place, force in zip(series.companion_place, series.companion_force.T, strict=True):
        filtered = low_passed(np.interp(grid, series.cycle, force), ts, cutoff, order)[series.cycle - series.cycle[0]]
        one = statistics_of(filtered[used], losses_of(used & (force <= threshold), least))
        found.append(
            Companion(
                place=float(place),
                mean=one.mean,
                sigma=one.sigma,
                sigma_share=one.sigma / one.mean if one.mean > 0.0 else float("nan"),
                minimum=one.minimum,
                maximum=one.maximum,
                statistical_minimum=one.statistical_minimum,
                statistical_maximum=one.statistical_maximum,
                loss_share=one.loss_share,
                losses=one.losses,
            )
        )
    return found


def losses(series: Series, ts: float, threshold: float, duration: float) -> list[Loss]:
    """List the losses of contact among the cycles that are judged: measured force at or below `threshold` (N).

    Those that last `duration` (s) and longer are counted ones. Missing cycles do not end a loss.
    """
    least = cycles_of_loss(duration, ts)
    found = []
    for first, length in losses_of(series.evaluated & (series.f_tr <= threshold)):
        place = float(series.track_position[first])
        before, behind = _masts(series, int(series.cycle[first]), place)
        found.append(
            Loss(
                cycle=int(series.cycle[first]),
                cycles=int(length),
                counted=bool(length >= least),
                time=float(series.time[first]),
                track_position=place,
                mast_before=before,
                mast_behind=behind,
                length=float(length * ts),
                lowest_force=float(series.f_tr[first : first + length].min()),
            )
        )
    return found


def _masts(series: Series, cycle: int, place: float) -> tuple[float | None, float | None]:
    """Give the last mast before a place and the first behind it (m along the line), from the nearest wire shape."""
    shapes = series.shapes
    if shapes is None or len(shapes) == 0:
        return None, None
    row = int(np.abs(shapes["cycle"].astype(np.int64) - cycle).argmin())
    masts = shapes.real("track_position")[row] + np.asarray(shapes.entries("mast_x")[row], dtype=np.float64)
    before, behind = masts[masts <= place], masts[masts > place]
    return (float(before.max()) if before.size else None), (float(behind.min()) if behind.size else None)
