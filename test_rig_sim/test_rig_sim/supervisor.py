"""Modes of the rig as a pure state machine: what reference the drive follows in each cycle, and why.

    HOLD --command--> TRACKING --none--> BRIDGING --none--> HOLDING --late_limit--> RETRACTING --arrived--> STOPPED
                         ^------------------command------------------'                 ^
    HOLD, TRACKING, BRIDGING, HOLDING --limit tripped, emergency stop-----------------'

Nothing leaves RETRACTING or STOPPED but a new Supervisor (reset by an operator).
"""

import math
from enum import IntEnum
from typing import NamedTuple

from test_rig_sim.retract import Retract, arrived, retract_step


class Mode(IntEnum):
    """Modes of the message RigState."""

    HOLD = 0
    TRACKING = 1
    BRIDGING = 2
    HOLDING = 3
    RETRACTING = 4
    STOPPED = 5


class Limits(NamedTuple):
    """When commands are refused and when the rig retracts."""

    late_limit: int  # 1, successive cycles without a usable command
    position: float  # m, largest reference of either sign
    reference_step: float  # m, largest change of the reference within a cycle
    trip_position: float  # m
    trip_speed: float  # m/s
    trip_force: float  # N
    trip_saturation: int  # 1, successive cycles at the current limit


class Ramp(NamedTuple):
    """Reference of one cycle: linear from start to end, in m."""

    start: float
    end: float


class Supervisor:
    """Decides the mode and the reference of each cycle; `reason` says in words why the rig retracted."""

    def __init__(self, limits: Limits, retract: Retract, period: float) -> None:
        self._limits = limits
        self._retract = retract
        self._period = period
        self.mode = Mode.HOLD
        self.reason = ""
        self.unusable_in_a_row = 0
        self._refused_in_a_row = 0
        self._reference = 0.0
        self._speed = 0.0
        self._prediction: float | None = None
        self._saturated_in_a_row = 0

    @property
    def moving(self) -> bool:
        """Whether the rig still follows anybody's commands."""
        return self.mode not in (Mode.RETRACTING, Mode.STOPPED)

    def admissible(self, u_tr: float, u_tr_next: float) -> bool:
        """Tell whether a command may be followed: finite, within the positions and the step allowed (m)."""
        if not (math.isfinite(u_tr) and math.isfinite(u_tr_next)):
            return False
        limits = self._limits
        within = max(abs(u_tr), abs(u_tr_next)) <= limits.position
        return within and max(abs(u_tr_next - u_tr), abs(u_tr - self._reference)) <= limits.reference_step

    def follow(self, u_tr: float, u_tr_next: float) -> Ramp:
        """Return the reference of a cycle whose command (m) came in time."""
        if not self.moving:
            return self._go_on()
        self.mode = Mode.TRACKING
        self.unusable_in_a_row = self._refused_in_a_row = 0
        self._prediction = None
        self._speed = (u_tr_next - u_tr) / self._period
        self._reference = u_tr_next
        return Ramp(u_tr, u_tr_next)

    def predict(self, u_tr_next: float) -> None:
        """Take the prediction (m) of a command that came too late for its own cycle: the next bridge's goal."""
        self._prediction = u_tr_next

    def bridge(self, refused: bool = False) -> Ramp:
        """Return the reference of a cycle without a usable command: to the newest prediction, hold, then retract.

        The command was late, or it came in time and was refused, which only the retract's reason tells apart.

        The command of the cycle before, if it came in time, already ended at its prediction u_tr(k+1): the
        reference then stays there. If it came late, the reference goes to what it predicts.
        """
        if not self.moving:
            return self._go_on()
        self.unusable_in_a_row += 1
        self._refused_in_a_row += refused
        count, refusals = self.unusable_in_a_row, self._refused_in_a_row
        if count >= self._limits.late_limit:
            counts = f"{count - refusals} late, {refusals} refused"
            self.retract(f"{count} successive cycles without a usable command ({counts})")
            return self._go_on()
        start = self._reference
        if self._prediction is not None:
            self._reference = self._prediction
        elif self.unusable_in_a_row > 1:
            self.mode = Mode.HOLDING
            self._speed = 0.0
            return Ramp(start, start)
        self._prediction = None
        self.mode = Mode.BRIDGING
        self._speed = (self._reference - start) / self._period
        return Ramp(start, self._reference)

    def watch(self, w_tr: float, v_tr: float, f_tr: float, saturated: bool) -> None:
        """Compare the rig's state (m, m/s, N, current at its limit) with the soft limits; retract if one trips."""
        self._saturated_in_a_row = self._saturated_in_a_row + 1 if saturated else 0
        limits = self._limits
        if not (math.isfinite(w_tr) and math.isfinite(v_tr) and math.isfinite(f_tr)):
            self.retract("a measurement is not finite")
        elif abs(w_tr) > limits.trip_position:
            self.retract(f"position {w_tr:.3f} m beyond limits.trip_position = {limits.trip_position:g} m")
        elif abs(v_tr) > limits.trip_speed:
            self.retract(f"speed {v_tr:.2f} m/s beyond limits.trip_speed = {limits.trip_speed:g} m/s")
        elif abs(f_tr) > limits.trip_force:
            self.retract(f"contact force {f_tr:.0f} N beyond limits.trip_force = {limits.trip_force:g} N")
        elif self._saturated_in_a_row >= limits.trip_saturation:
            self.retract(f"current at its limit for {self._saturated_in_a_row} successive cycles")

    def retract(self, reason: str) -> None:
        """Start the retract motion; the first reason stays, and a rig that retracts or rests goes on doing so."""
        if self.moving:
            self.mode = Mode.RETRACTING
            self.reason = reason
            # A bridge's or a wild command's slope is no speed that the drive has.
            self._speed = min(max(self._speed, -self._retract.speed), self._retract.speed)

    def finish(self) -> None:
        """End the ride: the drive rests where it is."""
        self.mode = Mode.STOPPED

    def _go_on(self) -> Ramp:
        start = self._reference
        if self.mode is Mode.RETRACTING:
            self._reference, self._speed = retract_step(self._retract, start, self._speed, self._period)
            if arrived(self._retract, self._reference, self._speed):
                self._reference = self._retract.position
                self.mode = Mode.STOPPED
        return Ramp(start, self._reference)
