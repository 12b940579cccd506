"""Soft limits of the plant: what is limited and reported, and what trips the rig into its retract motion."""

import math
from typing import NamedTuple


class Limits(NamedTuple):
    """Soft limits (the reference is cut, or the excess is counted and reported) and trips (the rig retracts)."""

    position: float  # m, largest reference of either sign
    speed: float  # m/s, largest mean speed of the reference within a cycle
    force: float  # N, contact force that is reported
    current: float  # A, root mean square that the motor bears for ever; reported from nine tenths on
    reference_step: float  # m, change of the reference within a cycle that no sane command asks for: refused
    trip_position: float  # m
    trip_speed: float  # m/s
    trip_force: float  # N
    trip_saturation: int  # 1, successive cycles at the current limit
    thermal_time: float  # s, time constant of the winding: i^2 is averaged over it


class Measurement(NamedTuple):
    """What the drive shows at the end of a cycle."""

    w_tr: float  # m
    v_tr: float  # m/s
    f_tr: float  # N
    current: float  # A
    saturated: bool  # current at its limit during the whole cycle


class Guard:
    """Compares each cycle's measurement with the limits.

    The thermal model is the usual one of an amplifier (I2t): h' = (i^2 - h) / thermal_time, and the motor is too warm
    when sqrt(h) is beyond its continuous current. ``excesses`` counts the cycles beyond a soft limit.
    """

    def __init__(self, limits: Limits, period: float) -> None:
        self._limits = limits
        self._share = -math.expm1(-period / limits.thermal_time)
        self._saturated_in_a_row = 0
        self._heat = 0.0  # A^2
        self.excesses = dict.fromkeys(("position", "speed", "force", "current"), 0)

    @property
    def effective_current(self) -> float:
        """Root mean square of the current over the thermal time, in A."""
        return math.sqrt(self._heat)

    def check(self, m: Measurement) -> str:
        """Take the measurement of a cycle; return why the rig has to retract, or an empty text."""
        limits, excesses = self._limits, self.excesses
        if not (math.isfinite(m.w_tr) and math.isfinite(m.v_tr) and math.isfinite(m.f_tr) and math.isfinite(m.current)):
            return "a measurement is not finite"
        self._saturated_in_a_row = self._saturated_in_a_row + 1 if m.saturated else 0
        self._heat += self._share * (m.current**2 - self._heat)
        excesses["position"] += abs(m.w_tr) > limits.position
        excesses["speed"] += abs(m.v_tr) > limits.speed
        excesses["force"] += abs(m.f_tr) > limits.force
        excesses["current"] += self._heat > 0.81 * limits.current**2
        if abs(m.w_tr) > limits.trip_position:
            return f"position {m.w_tr:.3f} m beyond limits.trip_position = {limits.trip_position:g} m"
        if abs(m.v_tr) > limits.trip_speed:
            return f"speed {m.v_tr:.2f} m/s beyond limits.trip_speed = {limits.trip_speed:g} m/s"
        if abs(m.f_tr) > limits.trip_force:
            return f"contact force {m.f_tr:.0f} N beyond limits.trip_force = {limits.trip_force:g} N"
        if self._saturated_in_a_row >= limits.trip_saturation:
            return f"current at its limit for {self._saturated_in_a_row} successive cycles"
        if self._heat > limits.current**2:
            return f"effective current {self.effective_current:.1f} A beyond limits.current = {limits.current:g} A"
        return ""

    def warning(self) -> str:
        """Say which soft limits were exceeded, and for how many cycles; empty if none was."""
        found = [f"{name} for {count}" for name, count in self.excesses.items() if count]
        return f"beyond soft limits: {', '.join(found)} cycles" if found else ""
