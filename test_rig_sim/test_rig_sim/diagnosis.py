"""What the rig says on /diagnostics; docs/diagnostics.md explains it."""

from __future__ import annotations

from phil_base.enumerations import Mode
from phil_node.diagnosis import ERROR, WARN, Diagnosis
from phil_node.timing import Timing
from test_rig_sim.pacing import CycleClock
from test_rig_sim.supervisor import Supervisor

PATIENCE = 5.0
"""Time in s for which waiting for listeners is nothing to warn of."""
RESET = (
    "see that catenary_model and impedance_mpc are active, call catenary_model/reset and impedance_mpc/reset if they "
    "were active before, then test_rig_sim/reset"
)


def diagnosis(supervisor: Supervisor, timing: Timing, pacing: CycleClock, phase: str) -> Diagnosis:
    """Give level and sentence: the mode, the reason of a retract, and what happened since cycle 0."""
    mode = supervisor.mode.name.lower()
    found = Diagnosis(message=f"{mode}, {phase}")
    happened = [
        *(["commands late"] if timing.late else []),
        *(timing.refusals if timing.refused else []),
        *(["commands cut to the soft limits"] if supervisor.limited else []),
        *(["ticks skipped"] if pacing.skipped else []),
    ]
    if supervisor.reason:
        found.level, found.message = ERROR, f"{mode}: {supervisor.reason}"
    elif supervisor.landed:
        found.message = "stopped: landed"
    elif happened:
        found.level = WARN
        found.message = f"{found.message}: {'; '.join(happened)}"
    if warning := supervisor.guard.warning():
        found.level = max(found.level, WARN)
        found.message = f"{found.message}; {warning}"
    return found


def missing_listeners(listeners: tuple[int, int], wanted: int, names: list[str], waited: float) -> str:
    """Say who listens and that it is not enough, when that has lasted; ``listeners`` are matched and known ones."""
    if waited < PATIENCE:
        return ""
    there = ", ".join(sorted(names)) or "nobody"
    return f"cycle 0 waits for listeners of test_rig_sim/state: {listeners[0]} of {wanted} are matched ({there})"


def missing_command(cycle: int, publishers: int) -> str:
    """Say that the command of a cycle does not come, and whose fault it is."""
    who = "impedance_mpc does not answer" if publishers else "nobody publishes impedance_mpc/command"
    return f"no command for cycle {cycle}: {who}"


def to_go_on(supervisor: Supervisor) -> str:
    """Say what brings the rig back into a ride after it has retracted; empty if nothing has to be done."""
    if not supervisor.reason:
        return ""
    return RESET if supervisor.mode is Mode.STOPPED else f"wait until the drive rests, then {RESET}"
