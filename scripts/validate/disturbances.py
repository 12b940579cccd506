"""What a disturbance does to a ride: its difference to the undisturbed ride over time.

Two ways: the contact force of an undisturbed ride, recorded, altered and replayed (the wire alone), and the pantograph
on the wire (it is struck downwards until contact is lost for as long as asked; a force pushes the wire beside it; the
contact force is held on both sides).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary_model.model import Catenary, Config
from catenary_model.moving_frame import CONTACT
from catenary_model.pantograph import Pantograph
from catenary_model.ride import Coupled, Ride, joined, push
from phil_study.drawing import save, subplots
from phil_study.outcome import Row

Array = NDArray[np.float64]

BEFORE, AFTER = 5.0, 25.0
"""Undisturbed until s, then watched for s."""
LOSS, STEP, STEP_TIME, GAP = 0.1, 100.0, 1.0, 0.02
"""Contact lost for s; force more by N for s; force held for s."""
WINDOWS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""Times after the end of the disturbance at which the difference is told: rms over the span passed last, s."""
KICKS = 0.5 * 1.15 ** np.arange(20)
"""Speeds by which the pantograph is struck downwards, m/s: the first one that loses contact for `LOSS` is taken."""
BOUND, LATEST = 200.0, 2.0
"""Largest difference of w that counts as bounded, mm (about twice the uplift at 320 km/h), and s after the disturbance
by which it must have been reached."""
LEFT = {10.0: 0.05, 20.0: 0.01}
"""Share of the largest difference that may be left after s."""


@dataclass(frozen=True)
class Disturbance:
    """A ride with a disturbance minus the undisturbed one."""

    name: str
    length: float
    """Duration of the disturbance, s."""
    t: Array
    """Time since its beginning, s."""
    w: Array
    """m."""
    F: Array
    """N."""
    lost: float
    """Time without contact that the disturbed ride has more, s."""

    def left(self, after: float, passing: float) -> float:
        """Return the rms of the difference of w over the `passing` s before `after` s after the end, m."""
        end = self.length + after
        inside = (self.t > end - passing) & (self.t <= end)
        return float(np.sqrt((self.w[inside] ** 2).mean()))


def forced(name: str, force: Array, ts: float) -> tuple[Array, float]:
    """Alter a recorded force (N, one entry a cycle, from the disturbance on); return it and the duration (s)."""
    out = force.copy()
    if name == "contact lost":
        out[: round(LOSS / ts)] = 0.0
        return out, LOSS
    if name == "force step":
        out[: round(STEP_TIME / ts)] += STEP
        return out, STEP_TIME
    out[: round(GAP / ts)] = force[0]
    return out, GAP


def forced_disturbances(setting: Config, record: Ride, after: float) -> list[Disturbance]:
    """Replay a recorded contact force, undisturbed and disturbed: the wire alone."""
    ts = setting.cycle_time
    first, cycles = round(BEFORE / ts), round(after / ts)
    catenary, made = Catenary(setting), []

    def replay(force: Array) -> Ride:
        catenary.reset()
        push(catenary, record.F[:first])
        return push(catenary, force)

    rest = record.F[first : first + cycles]
    calm = replay(rest)
    for name in ("contact lost", "force step", "force held"):
        force, length = forced(name, rest, ts)
        found = replay(force)
        lost = ts * float((found.F <= 0.0).sum() - (calm.F <= 0.0).sum())
        made.append(
            Disturbance(
                name, length, ts * np.arange(1, cycles + 1, dtype=np.float64), found.w - calm.w, found.F - calm.F, lost
            )
        )
    return made


def coupled_disturbances(setting: Config, rider: Pantograph, after: float) -> list[Disturbance]:
    """Disturb the ride of a pantograph: struck off the wire, wire pushed by a force, force held on both sides."""
    ts = setting.cycle_time
    cycles = round(after / ts)

    def ride(name: str, count: int, kick: float = 0.0) -> Ride:
        catenary = Catenary(setting)
        train = Coupled(catenary, rider)
        train.go_on(round(BEFORE / ts))
        parts = []
        if name == "contact lost":
            train.strike(-kick)
        elif name == "force step":
            push_at = catenary.external_load[catenary.mesh.middle, CONTACT]
            push_at[0] = STEP
            parts.append(train.go_on(round(STEP_TIME / ts)))
            push_at[0] = 0.0
        elif name == "force held":
            parts.append(train.go_on(round(GAP / ts), held=catenary.f_cat))
        return joined([*parts, train.go_on(count - sum(part.t.size for part in parts))])

    def lost(record: Ride) -> float:
        return ts * float((record.F <= 0.0).sum())

    calm, made = ride("", cycles), []
    second = round(1.0 / ts)
    kicks = (float(k) for k in KICKS)
    kick = next((k for k in kicks if lost(ride("contact lost", second, k)) >= LOSS), float(KICKS[-1]))
    for name, length in (("contact lost", LOSS), ("force step", STEP_TIME), ("force held", GAP)):
        found = ride(name, cycles, kick)
        more, t = lost(found) - lost(calm), ts * np.arange(1, cycles + 1, dtype=np.float64)
        made.append(Disturbance(name, length, t, found.w - calm.w, found.F - calm.F, more))
    return made


def disturbance_rows(case: str, found: list[Disturbance], passing: float) -> list[Row]:
    """Tell the largest difference and what is left of it; `passing` is the time for one span, s."""
    made = []
    for one in found:
        top = float(np.abs(one.w).max())
        here = f"{one.name}, {case}"
        course = ", ".join(f"{after:g} s {1e3 * one.left(after, min(passing, after)):.2g}" for after in WINDOWS)
        note = f"rms in mm after {course}; contact lost {one.lost:.3f} s"
        made.append(Row("largest difference of w", here, 1e3 * top, "mm", None, BOUND, note))
        when = float(one.t[np.abs(one.w).argmax()]) - one.length
        made.append(Row("reached after the end of it", here, when, "s", None, LATEST))
        made.append(Row("largest difference of F", here, float(np.abs(one.F).max()), "N"))
        for after, share in LEFT.items():
            value = 100.0 * one.left(after, passing) / top
            made.append(Row(f"left of it after {after:g} s", here, value, "%", None, 100.0 * share))
    return made


def draw(found: dict[str, list[Disturbance]], passing: float, path: Path) -> None:
    """Draw the differences of w: as they are, and their rms over one span on a logarithmic axis."""
    figure, axes = subplots(3, 2, figsize=(11, 9), layout="constrained")
    for pair, names in zip(axes, zip(*found.values(), strict=True), strict=True):
        for label, one in zip(found, names, strict=True):
            near = one.t < one.length + 3.0
            pair[0].plot(one.t[near], 1e3 * one.w[near], lw=1.0, label=label)
            window = max(1, round(passing / (one.t[1] - one.t[0])))
            mean = np.convolve(one.w**2, np.full(window, 1.0 / window), mode="valid")
            pair[1].semilogy(one.t[window - 1 :], 1e3 * np.sqrt(np.maximum(mean, 1e-24)), lw=1.0, label=label)
        pair[0].set(title=names[0].name, ylabel="difference of w in mm")
        pair[1].set(title="rms over one span", ylabel="mm", ylim=(1e-4, None))
        for axis in pair:
            axis.grid(alpha=0.3)
    for axis in axes[-1]:
        axis.set_xlabel("time since the disturbance began in s")
    axes[0, 0].legend(fontsize=8)
    save(figure, path)
