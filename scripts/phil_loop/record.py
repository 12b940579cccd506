"""What happened in a ride of the closed loop, as named columns; entry k belongs to cycle k, t_k = k Ts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from energy_monitor.contact_quality import ContactStatistics, contact_quality_of

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]


@dataclass(frozen=True)
class RigColumns:
    """What the rig shows at t_k: the fields of the message RigState, each (cycles,)."""

    mode: Whole
    """What the drive did between t_(k-1) and t_k, see :class:`phil_base.enumerations.Mode`."""
    w_tr: Floats
    """Displacement of the drive, m."""
    v_tr: Floats
    """Its velocity, m/s."""
    f_tr: Floats
    """Contact force as the observer has it, N."""
    f_raw: Floats
    """Contact force as the load cell gives it, N."""
    reference: Floats
    """Reference of the inner position loop, m."""
    current: Floats
    """Motor current, A."""
    work: Floats
    """Integral of f_tr v_tr since cycle 0, J."""
    impulse: Floats
    """Integral of f_tr since cycle 0, N s."""


@dataclass(frozen=True)
class TrueColumns:
    """What only a simulation knows of the rig at t_k, each (cycles,)."""

    f_contact: Floats
    """Contact force, N."""
    saturated: Whole
    """Inner steps of the cycle before with the demand at the current's limit, 1."""
    w_true: Floats
    """Absolute position of the contact point, m."""
    v_true: Floats
    """Its velocity, m/s."""
    true_work: Floats
    """Integral of contact force times velocity since cycle 0, J."""
    true_impulse: Floats
    """Integral of the contact force since cycle 0, N s."""


@dataclass(frozen=True)
class WireColumns:
    """What the catenary shows at t_k: the fields of the message CatenaryState but for the segment, each (cycles,)."""

    w_cat: Floats
    """Displacement of the contact wire at the pantograph, m."""
    v_cat: Floats
    """Its rate of change in the moving frame, m/s."""
    a_cat: Floats
    """Its second rate of change, m/s^2."""
    f_cat: Floats
    """Force on the wire at t_k, N."""
    track_position: Floats
    """Position of the pantograph along the line, m."""
    work: Floats
    """Work of f_cat on the wire since cycle 0, J."""
    impulse: Floats
    """Integral of f_cat since cycle 0, N s."""
    droppers: Whole
    """Droppers within the domain, 1."""
    slack_droppers: Whole
    """Of these, slack ones, 1."""
    iterations: Whole
    """Solves until the slack state was consistent, 1."""
    companion_place: Floats
    """Place of each further pantograph, ahead is positive, m, (cycles, companions) as the following."""
    companion_force: Floats
    """Its contact force, N."""
    companion_height: Floats
    """Displacement of the contact wire where it touches, m."""
    companion_loss: Floats
    """Time without contact since its uplift is up, s."""


@dataclass(frozen=True)
class CommandColumns:
    """The command of cycle k: the fields of the message ImpedanceCommand, each (cycles,)."""

    u_tr: Floats
    """Reference at t_k, m."""
    u_tr_next: Floats
    """Reference predicted for t_(k+1), m."""
    f_tr: Floats
    """Contact force that it was computed from, N."""
    f_predicted: Floats
    """Contact force predicted for t_(k+1), N."""
    f_cor: Floats
    """Correction force, N."""
    f_cat: Floats
    """Force on the catenary at t_(k+1), N."""
    f_cor_lower: Floats
    """Lower bound of the correction force, N."""
    f_cor_upper: Floats
    """Upper bound of the correction force, N."""
    correction: Whole
    """Case of the correction, see ImpedanceCommand.CORRECTION_*."""
    environment: Whole
    """What the drive is to follow, see ImpedanceCommand.ENVIRONMENT_*."""
    status: Whole
    """0 solved, 2 old plan."""
    iterations: Whole
    """Iterations of the quadratic program, 1."""
    fallbacks: Whole
    """Cycles answered by an old plan since cycle 0, 1."""
    w_env: Floats
    """Where the environment's contact point is at t_k, m."""
    v_env: Floats
    """Its velocity, m/s."""


@dataclass(frozen=True)
class RampColumns:
    """Reference that the drive got between t_k and t_(k+1), linear from start to end, each (cycles,).

    Of the last cycle of a ride that is through there is none: NaN.
    """

    start: Floats
    """m."""
    end: Floats
    """m."""


@dataclass(frozen=True)
class BookColumns:
    """The controller's books after the command of cycle k: the fields of ConservedQuantities, each (cycles,)."""

    e_tr: Floats
    """Energy given to the rig, sum of Ts F_tr v_tr (3.46), J."""
    e_cat: Floats
    """Energy given to the catenary, sum of Ts F_cat v_cat (3.46), J."""
    p_tr: Floats
    """Momentum given to the rig, sum of Ts F_tr (3.47), N s."""
    p_cat: Floats
    """Momentum given to the catenary, sum of Ts F_cat (3.47), N s."""
    work_tr: Floats
    """Work done on the rig while it followed, J."""
    work_cat: Floats
    """Work done on the wire while the rig followed, J."""
    impulse_tr: Floats
    """Impulse given to the rig while it followed, N s."""
    impulse_cat: Floats
    """Impulse given to the wire while the rig followed, N s."""
    exchanged_energy: Floats
    """Sum of Ts |F_tr v_tr|, J."""
    exchanged_momentum: Floats
    """Sum of Ts |F_tr|, N s."""

    @property
    def delta_e(self) -> Floats:
        """Energy error dE = e_tr - e_cat (3.46), J."""
        return self.e_tr - self.e_cat

    @property
    def delta_p(self) -> Floats:
        """Momentum error dp = p_tr - p_cat (3.47), N s."""
        return self.p_tr - self.p_cat

    @property
    def delta_work(self) -> Floats:
        """Energy error by the accumulated work, J."""
        return self.work_tr - self.work_cat

    @property
    def delta_impulse(self) -> Floats:
        """Momentum error by the accumulated impulse, N s."""
        return self.impulse_tr - self.impulse_cat


@dataclass(frozen=True)
class TimeColumns:
    """Time that each part took for cycle k, s, each (cycles,); it differs from ride to ride."""

    controller: Floats
    """From both states to the command."""
    catenary: Floats
    """Of the wire to t_(k+1)."""
    rig: Floats
    """Of supervisor and rig to t_(k+1); 0 in the last cycle of a ride that is through."""


@dataclass(frozen=True)
class Record:
    """What happened in a ride, cycle by cycle; equal to the bag of the same ride in lockstep to the last bit."""

    ts: float
    """Cycle time, s."""
    rig: RigColumns
    true: TrueColumns
    wire: WireColumns
    command: CommandColumns
    ramp: RampColumns
    books: BookColumns
    outcome: str
    """How it ended: through (its duration is over), landed, retracted, stopped (by an observer), or stuck (a node would
    refuse a number, and the ride would stand)."""
    reason: str
    """Why it retracted or is stuck; else empty."""
    settings: Mapping[str, Mapping[str, Any]] = field(repr=False)
    """All parameters, node to dotted name to value."""
    times: TimeColumns | None = field(default=None, compare=False, repr=False)
    """What the parts took, if that was asked for."""

    @property
    def cycles(self) -> int:
        """Number of cycles."""
        return int(self.rig.w_tr.size)

    @property
    def time(self) -> Floats:
        """t_k, s, (cycles,)."""
        return self.ts * np.arange(self.cycles, dtype=np.float64)

    def contact_statistics(self, run_in: float | None = None, true: bool = False) -> ContactStatistics:
        """Give the statistics of the contact force below 20 Hz after the run-in (s), as report and monitor do.

        Of the force that the rig shows, or of the true one. Run-in, filter and losses are as the parameters of
        energy_monitor say; ``run_in`` takes the place of its own.
        """
        p = self.settings["energy_monitor"]
        return contact_quality_of(
            self.true.f_contact if true else self.rig.f_tr,
            self.ts,
            p["contact.run_in"] if run_in is None else run_in,
            p["contact.loss_threshold"],
            p["contact.cutoff"],
            p["contact.order"],
            p["contact.loss_duration"],
        )
