"""What the measured wake-ups mean for a ride at 500 Hz."""

from __future__ import annotations

from collections.abc import Sequence

from doctor.finding import CHANGE, NOTE, OK, Finding
from doctor.wake_up import WakeUps

CYCLE = 0.002
"""Cycle time at 500 Hz, s."""
USED = 0.0006
"""What a cycle takes from the rig's state to the command when nobody disturbs, s."""
IN_A_ROW = 3
"""Wake-ups one after the other in a cycle: rig, catenary, controller."""
P999 = (CYCLE - USED) / IN_A_ROW
"""Largest p99.9 of one wake-up, s: three such in a row, and one cycle in a thousand is late."""
EASY = 0.25 * P999
"""p99.9 below which 1 kHz is no trouble either, s."""
GAP = 50 * CYCLE
"""Lateness in s after which the rig retracts (50 cycles of late_limit without a command)."""


def judged(parts: Sequence[WakeUps], counts: bool, advice: str) -> Finding:
    """Judge one class by its worst CPU.

    Args:
        parts: wake-ups of each CPU
        counts: this is the class that a ride gets here; the other is for comparison
        advice: what to type if it is not good enough
    """
    worst = max(parts, key=lambda part: part.figures()["p99.9"])
    largest = max(part.figures()["max"] for part in parts)
    p999 = worst.figures()["p99.9"]
    name = f"wake-up, {worst.scheduling}"
    value = f"p99.9 {p999 * 1e3:.3f} ms on CPU {worst.cpu}, largest {largest * 1e3:.3f} ms"
    if not counts:
        return Finding(name, value, OK, "for comparison: a ride here is not in this class")
    if largest >= GAP:
        return Finding(name, value, CHANGE, f"a gap of {GAP:g} s makes the rig retract", advice)
    if p999 > P999:
        why = f"above {P999 * 1e3:.3f} ms more than one cycle in a thousand is late ({IN_A_ROW} wake-ups in a row)"
        return Finding(name, value, CHANGE, why, advice)
    if p999 > EASY or largest > CYCLE:
        why = f"late commands now and then at 500 Hz, and often at 1 kHz (easy: p99.9 below {EASY * 1e3:.3f} ms)"
        return Finding(name, value, NOTE, why, advice)
    return Finding(name, value)
