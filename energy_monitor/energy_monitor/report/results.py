"""What the analysis of a ride finds: plain data, each number with its label, its unit and how it is best shown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag import Table

Floats = NDArray[np.float64]

TRUTH = "truth"
"""Unit of a verdict's value that is 1 for yes and 0 for no."""


def quantity(label: str, unit: str = "1", *, shown: str = "", scale: float = 1.0, digits: int = 4) -> Any:
    """Declare a number: `unit` is the one it is stored in, `shown` and `scale` those that people read."""
    return field(
        metadata={
            "label": label,
            "unit": unit,
            "shown": shown or ("" if unit == "1" else unit),
            "scale": scale,
            "digits": digits,
        }
    )


def plain(unit: str) -> Any:
    """Declare a number that stands in a table of its own: its unit only."""
    return field(metadata={"unit": unit})


class Shown(NamedTuple):
    """One number made ready for a table: what it is, its text and the unit of that text."""

    label: str
    text: str
    unit: str


def shown(result: Any) -> Iterator[Shown]:
    """Give the declared numbers of a result in their order, formatted; None and NaN as a dash."""
    for entry in fields(result):
        if "label" not in entry.metadata:
            continue
        value = getattr(result, entry.name)
        meta = entry.metadata
        if value is not None and not isinstance(value, (str, bool, int)):
            value = float(value) * meta["scale"]
        yield Shown(meta["label"], number(value, meta["digits"]), meta["shown"])


def number(value: Any, digits: int = 4) -> str:
    """Format one value: significant digits for reals, all digits for integers, words for truth."""
    if value is None or (isinstance(value, float) and value != value):
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, str)):
        return str(value)
    if value == 0.0:
        return "0"
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e7 else text


@dataclass(frozen=True)
class Ride:
    """What was ridden and recorded."""

    bag: str
    storage: str
    recording_whole: bool = quantity("Recording closed properly")
    started: str = quantity("Recorded from")
    cycles: int = quantity("Cycles with all three states")
    ts: float = quantity("Cycle time", "s", shown="ms", scale=1e3)
    simulated_time: float = quantity("Simulated time", "s", digits=6)
    wall_time: float = quantity("Wall time", "s", digits=5)
    speed_factor: float = quantity("Simulated over wall time")
    speed: float = quantity("Speed", "m/s", shown="km/h", scale=3.6)
    distance: float = quantity("Distance", "m", digits=5)
    run_in: float = quantity("Run-in, not in the statistics", "s")
    ended: bool = quantity("Ended with its last cycle")


@dataclass(frozen=True)
class Stream:
    """How complete one topic is, by cycle numbers."""

    topic: str
    messages: int
    first: int
    last: int
    expected: int
    missing: int
    missing_ranges: list[str]
    duplicates: int
    restarts: int


@dataclass(frozen=True)
class Tracking:
    """How well the rig moves as the wire, after the run-in."""

    position_error_rms: float = quantity("Position error w_tr - w_cat, rms", "m", shown="mm", scale=1e3)
    position_error_max: float = quantity("Position error, largest", "m", shown="mm", scale=1e3)
    position_error_mean: float = quantity("Position error, mean", "m", shown="mm", scale=1e3)
    position_error_rms_ride: float = quantity("Position error with run-in, rms", "m", shown="mm", scale=1e3)
    velocity_error_rms: float = quantity("Velocity error v_tr - v_cat, rms", "m/s", shown="mm/s", scale=1e3)
    velocity_error_max: float = quantity("Velocity error, largest", "m/s", shown="mm/s", scale=1e3)
    lag: float | None = quantity("Lag of the rig behind the wire", "s", shown="ms", scale=1e3, digits=3)
    correlation: float | None = quantity("Correlation at that lag", digits=6)
    displacement_mean: float = quantity("Wire displacement, mean", "m", shown="mm", scale=1e3)
    displacement_min: float = quantity("Wire displacement, lowest", "m", shown="mm", scale=1e3)
    displacement_max: float = quantity("Wire displacement, highest", "m", shown="mm", scale=1e3)


@dataclass(frozen=True)
class ContactForce:
    """Contact force low-passed at 20 Hz (EN 50317), after the run-in."""

    samples: int = quantity("Samples")
    mean: float = quantity("Mean force Fm", "N")
    sigma: float = quantity("Standard deviation", "N")
    sigma_share: float = quantity("Standard deviation over mean", "1")
    minimum: float = quantity("Smallest", "N")
    maximum: float = quantity("Largest", "N")
    statistical_minimum: float = quantity("Mean - 3 sigma", "N")
    statistical_maximum: float = quantity("Mean + 3 sigma", "N")
    loss_share: float = quantity("Time without contact", "1", shown="%", scale=100.0)
    losses: int = quantity("Losses of contact")
    loss_duration: float = quantity("Shortest loss that counts", "s", shown="ms", scale=1e3)
    shorter_losses: int = quantity("Shorter losses, not counted")
    raw_minimum: float = quantity("Smallest, unfiltered", "N")
    raw_maximum: float = quantity("Largest, unfiltered", "N")
    prediction_error: float | None = quantity("Force predicted for the next cycle - the one measured then, rms", "N")


@dataclass(frozen=True)
class Companion:
    """Contact force of a further pantograph of the train, low-passed at 20 Hz, over the same cycles as the first one's.

    Its losses are by the unfiltered force, as the others.
    """

    place: float = plain("m")
    mean: float = plain("N")
    sigma: float = plain("N")
    sigma_share: float = plain("1")
    minimum: float = plain("N")
    maximum: float = plain("N")
    statistical_minimum: float = plain("N")
    statistical_maximum: float = plain("N")
    loss_share: float = plain("1")
    losses: int = 0


@dataclass(frozen=True)
class Loss:
    """One loss of contact: when, where on the line and between which masts, how long, and the force then.

    `counted` is whether it is long enough to be in the statistics; the masts are None where the bag does not show them.
    """

    cycle: int
    cycles: int
    counted: bool
    time: float = plain("s")
    track_position: float = plain("m")
    mast_before: float | None = plain("m")
    mast_behind: float | None = plain("m")
    length: float = plain("s")
    lowest_force: float = plain("N")


@dataclass(frozen=True)
class Conservation:
    """Energy and momentum on both sides while the rig followed the catenary: sums (3.46, 3.47), and accumulated."""

    e_tr: float = quantity("Energy given to the rig, E_tr", "J", digits=6)
    e_cat: float = quantity("Energy given to the catenary, E_cat", "J", digits=6)
    delta_e: float = quantity("Energy error dE at the end", "J")
    delta_e_max: float = quantity("Energy error |dE|, largest", "J")
    work_tr: float = quantity("Accumulated work on the rig", "J", digits=6)
    work_cat: float = quantity("Accumulated work on the catenary", "J", digits=6)
    delta_work: float = quantity("Energy error dE by accumulated work at the end", "J")
    delta_work_max: float = quantity("Energy error |dE| by accumulated work, largest", "J")
    exchanged_energy: float = quantity("Exchanged energy, sum of Ts |F_tr v_tr|", "J", digits=6)
    delta_e_share: float | None = quantity("|dE| at the end over exchanged energy", shown="%", scale=100.0)
    delta_e_max_share: float | None = quantity("Largest |dE| over exchanged energy", shown="%", scale=100.0)
    delta_e_running_share: float | None = quantity(
        "Largest |dE(k)| over the energy exchanged up to k, after run-in", shown="%", scale=100.0
    )
    delta_work_max_share: float | None = quantity(
        "Largest |dE| by accumulated work over exchanged energy", shown="%", scale=100.0
    )
    delta_work_running_share: float | None = quantity(
        "The same at k over the energy exchanged up to k, after run-in", shown="%", scale=100.0
    )
    p_tr: float = quantity("Momentum given to the rig, p_tr", "N s", digits=6)
    p_cat: float = quantity("Momentum given to the catenary, p_cat", "N s", digits=6)
    delta_p: float = quantity("Momentum error dp at the end", "N s")
    delta_p_max: float = quantity("Momentum error |dp|, largest", "N s")
    impulse_tr: float = quantity("Accumulated impulse on the rig", "N s", digits=6)
    impulse_cat: float = quantity("Accumulated impulse on the catenary", "N s", digits=6)
    delta_impulse: float = quantity("Momentum error dp by accumulated impulse at the end", "N s")
    delta_impulse_max: float = quantity("Momentum error |dp| by accumulated impulse, largest", "N s")
    exchanged_momentum: float = quantity("Exchanged momentum, sum of Ts |F_tr|", "N s", digits=6)
    delta_p_share: float | None = quantity("|dp| at the end over exchanged momentum", shown="%", scale=100.0)
    delta_p_max_share: float | None = quantity("Largest |dp| over exchanged momentum", shown="%", scale=100.0)
    delta_impulse_max_share: float | None = quantity(
        "Largest |dp| by accumulated impulse over exchanged momentum", shown="%", scale=100.0
    )
    work_difference: float = quantity("E_tr by its sum - accumulated work on the rig", "J")


@dataclass(frozen=True)
class Agreement:
    """Largest differences between a node's own books and those recomputed from the bag, at the same cycles."""

    source: str
    compared: int
    differences: dict[str, float]
    share: float  # the worst of them over what was exchanged (over the mean force for the contact quality)


@dataclass(frozen=True)
class Correction:
    """The correction force F_cor and its bounds (3.49)."""

    rms: float = quantity("F_cor, rms", "N")
    mean: float = quantity("F_cor, mean", "N")
    largest: float = quantity("|F_cor|, largest", "N")
    at_bounds_share: float = quantity("Cycles at a bound", shown="%", scale=100.0)
    forced_share: float = quantity("Cycles whose bounds exclude zero", shown="%", scale=100.0)
    modes: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Solver:
    """The quadratic programs of the impedance controller (3.56)."""

    iterations_mean: float = quantity("Iterations, mean")
    iterations_p99: float = quantity("Iterations, 99th percentile")
    iterations_max: int = quantity("Iterations, most")
    fallbacks: int = quantity("Cycles answered by the shifted plan")
    status: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Catenary:
    """Droppers and slack-state iterations of the catenary model, after the run-in."""

    droppers: int = quantity("Droppers in the model's domain, most")
    slack_mean: float = quantity("Slack droppers, mean")
    slack_max: int = quantity("Slack droppers, most")
    slack_share: float = quantity("Cycles with a slack dropper", shown="%", scale=100.0)
    iterations_mean: float = quantity("Solves a step, mean")
    iterations_max: int = quantity("Solves a step, most")


@dataclass(frozen=True)
class Timing:
    """Turnaround of one node over all recorded batches (wall clock), and what it counted.

    The last four are by the cycle numbers of what the node received; None if the bag is of before they were counted.
    """

    node: str
    cycles: int
    over_budget: int
    late: int
    missing: int
    stale: int
    refused: int
    budget: float = plain("s")
    median: float = plain("s")
    p99: float = plain("s")
    largest: float = plain("s")
    messages_late: int | None = None
    messages_lost: int | None = None
    messages_doubled: int | None = None
    messages_swapped: int | None = None


@dataclass(frozen=True)
class ModeChange:
    """The rig changed to a mode at a time of the ride."""

    cycle: int
    mode: str
    time: float = plain("s")


@dataclass(frozen=True)
class Warned:
    """A diagnostic of level WARN or worse: first and last time of the ride (NaN: not known), and how often."""

    level: str
    name: str
    message: str
    count: int
    first: float = plain("s")
    last: float = plain("s")


@dataclass(frozen=True)
class Held:
    """What the controller believes of the rig beside what the rig has, both in `unit`; `has` is None if not known."""

    name: str
    parameter: str
    of_rig: str
    unit: str
    believed: float
    has: float | None
    differs: bool


@dataclass(frozen=True)
class Verdict:
    """One requirement: the value found, the range it has to lie in, and whether it does (None: not judged).

    `value`, `low` and `high` are in `unit`; None is a side without a limit. What is not binding is for information:
    the ride passes without it.
    """

    key: str
    name: str
    value: float | None
    low: float | None
    high: float | None
    unit: str
    ok: bool | None
    binding: bool = True
    source: str = ""

    @property
    def found(self) -> str:
        """The value in words."""
        if self.unit == TRUTH and self.value is not None:
            return "yes" if self.value else "no"
        return number(self.value, 3)

    @property
    def limit(self) -> str:
        """The range in words."""
        if self.unit == TRUTH:
            return "yes"
        low, high = (None if side is None else f"{side:.4g}" for side in (self.low, self.high))
        if low is None:
            return "no limit" if high is None else "0" if self.high == 0.0 else f"≤ {high}"
        if high is None:
            return f"≥ {low}"
        return low if low == high else f"{low} to {high}"


@dataclass(frozen=True)
class Series:
    """Time series behind the numbers, one entry a cycle; not part of report.json."""

    cycle: NDArray[np.int64]
    time: Floats
    w_tr: Floats
    w_cat: Floats
    v_tr: Floats
    v_cat: Floats
    f_tr: Floats
    f_raw: Floats
    f_filtered: Floats
    f_cor: Floats
    f_cor_lower: Floats
    f_cor_upper: Floats
    delta_e: Floats
    delta_p: Floats
    delta_work: Floats
    delta_impulse: Floats
    e_tr: Floats
    e_cat: Floats
    p_tr: Floats
    p_cat: Floats
    exchanged_energy: Floats
    exchanged_momentum: Floats
    work_tr: Floats
    work_cat: Floats
    impulse_tr: Floats
    impulse_cat: Floats
    track_position: Floats
    evaluated: NDArray[np.bool_]
    frequency: Floats
    density: Floats
    books: Mapping[str, Table]
    shapes: Table | None
    turnaround: Mapping[str, Floats]
    companion_force: Floats
    """(cycles, companions), N."""
    companion_place: Floats
    """(companions,), m from the pantograph on the rig, ahead is positive."""


@dataclass(frozen=True)
class Report:
    """All that was found about one ride; `series` feeds the figures."""

    ride: Ride
    verdicts: list[Verdict]
    streams: list[Stream]
    tracking: Tracking
    contact_force: ContactForce
    losses: list[Loss]
    companions: list[Companion]
    conservation: Conservation
    agreement: list[Agreement]
    correction: Correction
    solver: Solver
    catenary: Catenary
    timing: list[Timing]
    modes: list[ModeChange]
    warnings: list[Warned]
    notes: list[str]
    beliefs: list[Held]
    parameters: dict[str, dict[str, Any]]
    versions: dict[str, str]
    series: Series

    @property
    def ok(self) -> bool:
        """Tell whether no binding verdict fails."""
        return all(verdict.ok is not False for verdict in self.verdicts if verdict.binding)
