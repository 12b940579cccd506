"""One cycle of the rig: what becomes of a command, or of none, between t_k and t_(k+1). No ROS, no clock.

The node and the closed loop of `phil_loop` both ride by this: what differs between them is only where commands come
from and where states go.
"""

from typing import TYPE_CHECKING

from phil_base.enumerations import Mode
from test_rig_sim.operation import rules, supervisor_for
from test_rig_sim.rig import Rig, RigSample
from test_rig_sim.supervisor import Ramp, Rules

if TYPE_CHECKING:
    from test_rig_sim.parameters import Parameters

ENDLESS = -1
"""Last cycle of a ride without an end."""


def last_cycle_of(duration: float, cycle_time: float) -> int:
    """Give the last cycle of a ride of that duration (s), at least 0; `ENDLESS` for a duration of 0."""
    return max(1, round(duration / cycle_time)) - 1 if duration > 0.0 else ENDLESS


class RigCycle:
    """The simulated rig under its supervisor, cycle by cycle.

    ``found`` are rules in place of those that the parameters give. ``cycle`` is k, ``state`` the
    rig at t_k, ``mode`` what the drive did until then (`RigState.mode`), ``last_cycle`` where the ride ends, or where
    its landing begins.

    Raises
    ------
    ValueError
        The parameters give no stable inner loop, or no usable trajectory; the text names the keys.
    """

    def __init__(self, p: "Parameters", found: Rules | None = None) -> None:
        self.rig = Rig(p)
        self.rules = rules(p, self.rig.plant.loop) if found is None else found
        self.last_cycle = last_cycle_of(p.duration, p.cycle_time)
        self.restart(p)

    def restart(self, p: "Parameters") -> None:
        """Begin anew with cycle 0, at rest; an uplift force that was changed stays."""
        self.rig.reset()
        self.state: RigSample = self.rig.state
        self.supervisor = supervisor_for(p, self.rules, self.state.reference)
        self.lands = p.land_at_end
        self.cycle = 0
        self.mode = Mode.HOLD

    @property
    def resting(self) -> bool:
        """Whether the drive rests and nothing but a restart moves it."""
        return self.mode is Mode.STOPPED

    @property
    def last(self) -> bool:
        """Whether state k is the last one: the ride is over by time, or the drive came to rest before."""
        return (self.cycle == self.last_cycle and not self.lands) or self.mode is Mode.STOPPED

    @property
    def outcome(self) -> str:
        """How the ride ended: landed, retracted or through; empty as long as it goes on."""
        supervisor = self.supervisor
        if supervisor.mode is not Mode.STOPPED:
            return ""
        return "retracted" if supervisor.reason else "landed" if supervisor.landed else "through"

    def objection(self, u_tr: float, u_tr_next: float) -> str:
        """Say why the command (m) of this cycle is refused, and note it for a retract's reason; empty: it is not."""
        supervisor = self.supervisor
        return "" if supervisor.admissible(u_tr, u_tr_next) else supervisor.objection(u_tr, u_tr_next)

    def follow(self, u_tr: float, u_tr_next: float, old_plan: bool = False) -> RigSample:
        """Go to t_(k+1) with the command of cycle k (m), which was not refused; give the state there."""
        return self._move(self.supervisor.follow(u_tr, u_tr_next, old_plan))

    def bridge(self, refused: bool) -> RigSample:
        """Go to t_(k+1) without a command, because none came or the one that came was refused; give the state there."""
        return self._move(self.supervisor.bridge(refused))

    def _move(self, ramp: Ramp) -> RigSample:
        rig, supervisor = self.rig, self.supervisor
        mode = supervisor.mode
        if mode is not self.mode:
            # What an operator does with the pantograph's pressure: up after the touch, down to part.
            if self.mode is Mode.APPROACHING and mode is Mode.TRACKING:
                rig.lift_pantograph()
            elif mode is Mode.LANDING or mode is Mode.RETRACTING:
                rig.lower_pantograph()
        self.ramp = ramp
        rig.advance(ramp.start, ramp.end)
        self.mode = supervisor.mode
        self.state = state = rig.state
        supervisor.watch(state.w_tr, state.v_tr, state.f_tr, state.current, state.saturated == rig.plant.inner_steps)
        self.cycle += 1
        if self.lands and self.cycle == self.last_cycle:
            supervisor.land()
        return state
