"""Modes of the rig as a pure state machine: what reference the drive follows in each cycle, and why.

An operator chooses an operating mode (`select`), lands (`land`) or stops (`retract`); each cycle brings a command
(`follow`) or none that can be used (`bridge`), and a measurement (`watch`). "follow" and "bridge" below are cycles
while impedance is selected; with hold or position selected both only let time go on.

Following stands for TRACKING, BRIDGING and HOLDING; free for following, HOLD, POSITION and APPROACHING.

| mode                       | event                                 | next mode   | reference                        |
|----------------------------|---------------------------------------|-------------|----------------------------------|
| HOLD                       | follow, head and drive touch          | TRACKING    | command, gently at first         |
| HOLD                       | follow, head and drive are apart      | APPROACHING | down, slowly                     |
| APPROACHING                | follow, they touch now                | TRACKING    | command, gently at first         |
| APPROACHING                | lowest position reached               | RETRACTING  |                                  |
| following                  | follow                                | TRACKING    | command                          |
| following                  | bridge: first, or with new prediction | BRIDGING    | to the newest prediction         |
| following                  | bridge: any other                     | HOLDING     | stays                            |
| following, HOLD, APPROACHING | late_limit bridges in a row         | RETRACTING  |                                  |
| following                  | late_limit commands of old plans in a row | RETRACTING |                              |
| free, impedance selected   | two commands for one cycle that differ | RETRACTING |                                 |
| free                       | hold selected                         | HOLD        | brakes, stays                    |
| free                       | position selected                     | POSITION    | to the trajectory's start, on it |
| POSITION                   | impedance selected, trajectory over   | HOLD        | brakes, stays                    |
| free                       | land                                  | LANDING     | up, slowly                       |
| LANDING                    | clear of the head by the gap          | STOPPED     | stays                            |
| LANDING                    | highest position reached in contact   | RETRACTING  |                                  |
| free, LANDING              | limit tripped, emergency stop         | RETRACTING  | brakes, then to the safe place   |
| RETRACTING                 | drive rests there, or should by now   | STOPPED     | stays                            |
| any                        | end of the ride                       | STOPPED     | stays                            |

Nothing leaves RETRACTING but to STOPPED, and nothing leaves STOPPED but a new Supervisor (reset by an operator).
"""

import math
from typing import NamedTuple

from phil_base.enumerations import FOLLOWING, Mode
from test_rig_sim.limits import Guard, Limits, Measurement
from test_rig_sim.motion import Pace, Response, at_rest, clip, creep, gentle, towards
from test_rig_sim.retract import SETTLING, Retract, arrived, brake_step, obeys, retract_step
from test_rig_sim.touch import Departure, Feeler, Touch, descend
from test_rig_sim.trajectory import Array

__all__ = ["FOLLOWING", "OPERATIONS", "Mode", "Ramp", "Rules", "Supervisor"]

OPERATIONS = ("hold", "position", "impedance")


class Rules(NamedTuple):
    """All that the supervisor is told once."""

    period: float  # s
    late_limit: int  # 1, successive cycles without a usable command
    limits: Limits
    retract: Retract
    touch: Touch
    pace: Pace  # of hold's braking and of the way to a trajectory's start
    entry_cycles: int  # 1, cycles for which commands are watched that follow a motion of the drive's own
    entry_acceleration: float  # m/s^2, largest that they may ask for
    response: Response
    trajectory: Array  # (n,) m, of the operating mode position


class Ramp(NamedTuple):
    """Reference of one cycle: linear from start to end, in m."""

    start: float
    end: float


class Supervisor:
    """Decides the mode and the reference of each cycle; `reason` says in words why the rig retracted.

    Begins in HOLD, at rest at ``reference`` (m), with an operating mode of OPERATIONS; ``touching`` tells whether it
    begins in contact with the head. ``limited`` counts cycles whose command was cut to the soft limits.
    """

    def __init__(
        self, rules: Rules, operation: str = "impedance", reference: float = 0.0, touching: bool = True
    ) -> None:
        self._rules = rules
        self._period = rules.period
        self.guard = Guard(rules.limits, rules.period)
        self.mode = Mode.HOLD
        self.reason = ""
        self.unusable_in_a_row = 0
        self.limited = 0
        self.landed = False
        self._refused_in_a_row = 0
        self._planned_in_a_row = 0
        self._objections: dict[str, tuple[str, int]] = {}
        self._reference = reference
        self._speed = 0.0
        self._prediction: float | None = None
        self._entry = 0
        self._feeler = Feeler(rules.touch, touching)
        self._departure = Departure(rules.touch)
        self._measured = (reference, 0.0)
        self._sample = -1
        self._braking = False
        self._settling = 0.0
        self._operation = operation
        self.select(operation)

    @property
    def moving(self) -> bool:
        """Whether an operator or a command can still decide what the rig does."""
        return self.mode not in (Mode.RETRACTING, Mode.STOPPED)

    @property
    def touching(self) -> bool:
        """Whether head and drive touch, as far as the contact force tells."""
        return self._feeler.touching

    @property
    def needs_commands(self) -> bool:
        """Whether the drive waits for commands: impedance is selected and nothing else is going on."""
        return self._operation == "impedance" and self.moving and self.mode is not Mode.LANDING

    # The operator ----------------------------------------------------------------------------------------------

    def select(self, operation: str) -> None:
        """Choose the operating mode, one of OPERATIONS; a rig that lands, retracts or rests does not heed it."""
        if operation not in OPERATIONS:
            raise ValueError(f"operating mode '{operation}' is none of {', '.join(OPERATIONS)}")
        before, self._operation = self._operation, operation
        if not self.moving or self.mode is Mode.LANDING:
            return
        if operation == "position":
            if before != operation or self.mode is not Mode.POSITION:
                self._go_own_way(Mode.POSITION)
                self._sample = -1
        elif operation == "hold" or self.mode is Mode.POSITION:
            self._go_own_way(Mode.HOLD)
        self.unusable_in_a_row = self._refused_in_a_row = self._planned_in_a_row = 0

    def land(self) -> bool:
        """Begin the soft landing; False if the rig already retracts or rests."""
        if not self.moving:
            return False
        if self.mode is not Mode.LANDING:
            self._go_own_way(Mode.LANDING)
        return True

    def retract(self, reason: str) -> None:
        """Start the retract motion; the first reason stays, and a rig that retracts or rests goes on doing so."""
        if self.moving:
            self._go_own_way(Mode.RETRACTING)
            self.reason = reason
            self._braking = True

    def finish(self) -> None:
        """End the ride: the drive rests where it is."""
        self.mode = Mode.STOPPED

    # The cycle -------------------------------------------------------------------------------------------------

    def admissible(self, u_tr: float, u_tr_next: float) -> bool:
        """Tell whether a command (m) may be followed: finite, and no leap that nobody can have meant."""
        if not (math.isfinite(u_tr) and math.isfinite(u_tr_next)):
            return False
        limits = self._rules.limits
        if max(abs(u_tr), abs(u_tr_next)) > limits.trip_position:
            return False
        # While the drive goes its own way the controller knows where it is: its command has to start there, too.
        return max(abs(u_tr_next - u_tr), abs(u_tr - self._reference)) <= limits.reference_step

    def objection(self, u_tr: float, u_tr_next: float) -> str:
        """Say in words why a command (m) is not `admissible`; what was said is part of a retract's reason."""
        limits = self._rules.limits
        if not (math.isfinite(u_tr) and math.isfinite(u_tr_next)):
            kind, text = "number", "the command is not a finite number"
        elif (largest := max(abs(u_tr), abs(u_tr_next))) > limits.trip_position:
            kind, most = "position", limits.trip_position
            text = f"the command asks for a position of {largest * 1e3:.4g} mm, at most {most * 1e3:g} mm trips"
            text += _unit(largest, most)
        else:
            step, start = abs(u_tr_next - u_tr), abs(u_tr - self._reference)
            kind, leap, most = "leap", max(step, start), limits.reference_step
            where = "within a cycle" if step >= start else "away from where the drive is"
            text = (
                f"the command leaps by {leap * 1e3:.4g} mm {where}, at most {most * 1e3:g} mm (limits.reference_step)"
            )
            text += _unit(leap, most)
        said, count = self._objections.get(kind, (text, 0))
        self._objections[kind] = (said, count + 1)
        return text

    def contradict(self, cycle: int, u_tr: float, first: float) -> None:
        """Take a second command (m) for a cycle that has had another one: nobody can tell whose is to be followed."""
        if self.needs_commands:
            self.retract(
                f"two commands for cycle {cycle} differ: {first * 1e3:.4g} mm and {u_tr * 1e3:.4g} mm; "
                "does a second publisher send commands?"
            )

    def follow(self, u_tr: float, u_tr_next: float, old_plan: bool = False) -> Ramp:
        """Return the reference of a cycle whose command (m) came in time.

        One of an ``old_plan`` (the controller's solver failed) is as good as a prediction: for `late_limit` cycles.
        """
        if not self.needs_commands:
            return self._go_on()
        self._planned_in_a_row = self._planned_in_a_row + 1 if old_plan else 0
        if self._planned_in_a_row >= self._rules.late_limit:
            self.retract(
                f"{self._planned_in_a_row} successive commands are from an old plan: the controller's solver fails"
            )
            return self._go_on()
        self.unusable_in_a_row = self._refused_in_a_row = 0
        if self._objections:
            self._objections.clear()
        if self.mode not in FOLLOWING:
            if not self.touching:
                if self.mode is Mode.HOLD:
                    self.mode = Mode.APPROACHING
                return self._go_on()
            self._entry = self._rules.entry_cycles
        self.mode = Mode.TRACKING
        self._prediction = None
        return self._to(u_tr, u_tr_next)

    def predict(self, u_tr_next: float) -> None:
        """Take the prediction (m) of a command that came too late for its own cycle: the next bridge's goal."""
        self._prediction = u_tr_next

    def bridge(self, refused: bool = False) -> Ramp:
        """Return the reference of a cycle without a usable command: to the newest prediction, hold, then retract.

        The command was late, or it came in time and was refused, which only the retract's reason tells apart.

        The command of the cycle before, if it came in time, already ended at its prediction u_tr(k+1): the
        reference then stays there. If it came late, the reference goes to what it predicts.
        """
        if not self.needs_commands:
            return self._go_on()
        self.unusable_in_a_row += 1
        self._refused_in_a_row += refused
        count, refusals = self.unusable_in_a_row, self._refused_in_a_row
        if count >= self._rules.late_limit:
            counts = f"{count - refusals} late, {refusals} refused"
            if refusals and self._objections:
                counts += ": " + "; ".join(f"{text}, {times} times" for text, times in self._objections.values())
            self.retract(f"{count} successive cycles without a usable command ({counts})")
            return self._go_on()
        if self.mode not in FOLLOWING:
            return self._go_on()
        start = self._reference
        if self._prediction is not None:
            self.mode = Mode.BRIDGING
            end, self._prediction = self._prediction, None
            return self._to(start, end)
        self.mode = Mode.BRIDGING if count == 1 else Mode.HOLDING
        self._speed = 0.0
        return Ramp(start, start)

    def watch(self, w_tr: float, v_tr: float, f_tr: float, current: float, saturated: bool) -> None:
        """Take the rig's state (m, m/s, N, A, current at its limit); retract if a soft limit trips."""
        self._measured = (w_tr, v_tr)
        self._feeler.feel(f_tr)
        why = self.guard.check(Measurement(w_tr, v_tr, f_tr, current, saturated))
        if why:
            self.retract(why)

    # The drive's own motions -----------------------------------------------------------------------------------

    def _to(self, start: float, end: float) -> Ramp:
        """Cut a command's ramp to the soft limits of position and speed (as far as one cycle goes).

        For a while after a motion of the drive's own also to a gentle acceleration, so that commands which do not
        begin where the drive is make no bump. What was cut is shown to the controller as the reference.
        """
        limits, rules = self._rules.limits, self._rules
        reach, before = limits.speed * self._period, self._reference
        # A drive beyond its soft limit may come back as slowly as it likes, but go no further.
        low = min(max(-limits.position, before - reach), before)
        high = max(min(limits.position, before + reach), before)
        self.limited += not (low <= min(start, end) and max(start, end) <= high)
        start, end = clip(start, low, high), clip(end, low, high)
        w, v = self._measured
        if self._entry > 0 and math.isfinite(w) and math.isfinite(v):
            self._entry -= 1
            most, period = rules.entry_acceleration, self._period
            start = clip(start, *gentle(rules.response, w, v, most))
            low, high = gentle(rules.response, w + v * period, v, most)
            # A drive that accelerates all the time has by the end of the cycle got this much further.
            further = most * period * (rules.response.lead + 0.5 * period)
            end = clip(end, low - further, high + further)
        ramp = Ramp(start, end)
        self._speed = (ramp.end - ramp.start) / self._period
        self._reference = ramp.end
        return ramp

    def _go_own_way(self, mode: Mode) -> None:
        """Leave the commands (or another motion of its own) without a bump: from the drive's present state.

        A command's slope is no speed that the drive has, so the motion begins with the measured one; and a reference
        that the drive does not follow is brought to where the drive needs no more than the retract's braking.
        """
        rules = self._rules
        before, self.mode = self.mode, mode
        self._prediction = None
        own = before not in FOLLOWING
        if own and mode is not Mode.RETRACTING:
            return
        w, v = self._measured
        if math.isfinite(w) and math.isfinite(v):
            most = rules.limits.trip_speed
            reference = clip(self._reference, *gentle(rules.response, w, v, rules.retract.braking))
            self._speed = self._speed if own and reference == self._reference else clip(v, -most, most)
            self._reference = reference
        elif not own:
            self._speed = clip(self._speed, -rules.retract.speed, rules.retract.speed)

    def _go_on(self) -> Ramp:
        """Move along the mode's own motion."""
        rules, period, start = self._rules, self._period, self._reference
        reference, speed = start, 0.0
        if self.mode is Mode.RETRACTING:
            reference, speed = self._retract_on()
        elif self.mode is Mode.POSITION:
            reference, speed = self._position_on()
        elif self.mode is Mode.APPROACHING:
            reference, speed = descend(rules.touch, start, self._speed, period)
            if reference <= rules.touch.lowest:
                self._speed = speed
                self.retract(f"no contact down to touch.lowest = {rules.touch.lowest:g} m")
                return self._go_on()
        elif self.mode is Mode.LANDING:
            reference, speed = self._departure.step(self.touching, start, self._speed, period)
            if self._departure.over:
                self.mode, self.landed = Mode.STOPPED, True
            elif reference >= rules.touch.highest:
                self._speed = speed
                self.retract(f"still in contact at touch.highest = {rules.touch.highest:g} m")
                return self._go_on()
        elif self.mode is not Mode.STOPPED:
            speed = creep(0.0, rules.pace.acceleration, self._speed, period)
            reference = start + speed * period
        self._reference, self._speed = reference, speed
        return Ramp(start, reference)

    def _retract_on(self) -> tuple[float, float]:
        retract, reference, speed = self._rules.retract, self._reference, self._speed
        self._braking = self._braking and speed != 0.0
        step = brake_step if self._braking else retract_step
        reference, speed = step(retract, reference, speed, self._period)
        if not self._braking and arrived(retract, reference, speed):
            self._settling += self._period
            if obeys(retract, *self._measured):
                self.mode = Mode.STOPPED
            elif self._settling > SETTLING:
                self.mode = Mode.STOPPED
                self.reason += "; the drive does not come to rest: take its power away"
            return retract.position, 0.0
        return reference, speed

    def _position_on(self) -> tuple[float, float]:
        """Go to the trajectory's start and rest there, then follow it, then hold."""
        samples, reference, speed = self._rules.trajectory, self._reference, self._speed
        if self._sample < 0:
            if not at_rest(float(samples[0]), reference, speed):
                return towards(float(samples[0]), self._rules.pace, reference, speed, self._period)
            self._sample = 0
        self._sample += 1
        if self._sample >= len(samples):
            self.mode = Mode.HOLD
            speed = creep(0.0, self._rules.pace.acceleration, speed, self._period)
            return reference + speed * self._period, speed
        position = float(samples[self._sample])
        return position, (position - reference) / self._period


def _unit(value: float, most: float) -> str:
    """Ask for the unit where a length is so far beyond what is possible that it can hardly be one in m."""
    return "; are its inputs in m?" if value > 20.0 * most else ""
