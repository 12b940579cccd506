"""The mean contact force that rides of studies are set to: EN 50367's upper limit for AC lines."""

from __future__ import annotations

from functools import cache

from energy_monitor import limits


@cache
def target(speed: float) -> float:
    """Return the upper limit of the mean force at this speed (km/h) by EN 50367, AC lines, N. Raises ValueError."""
    for rule in limits.load()["en50367_ac"].rules:
        if rule.quantity == "mean":
            found = rule.range_at(float(speed))
            if found is not None and found.high is not None:
                return found.high.at(float(speed), 0.0)
    raise ValueError(f"EN 50367 has no limit of the mean force at {speed} km/h")
