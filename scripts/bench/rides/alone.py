"""Rides without ROS, in a fresh interpreter of each build: the closed loop as a library, and the direct coupling.

This file is handed to the interpreter of a build, also to one that knows neither it nor `phil_loop`: it imports what it
finds there. It prints one line of JSON.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from statistics import median
from time import perf_counter
from typing import Any

SPEED_KMH = 250.0
UPLIFT = 120.0
"""N, of the direct coupling."""
PARTS = ("catenary", "controller", "rig")


def of_library(seconds: float) -> dict[str, float]:
    """Ride by `phil_loop`: times real time, and what each part takes a cycle in s (median)."""
    from phil_loop import ClosedLoop, settings

    loop = ClosedLoop(settings(speed_kmh=SPEED_KMH))
    loop.ride(1.0)
    begun = perf_counter()
    loop.ride(seconds)
    found = {"factor": seconds / (perf_counter() - begun)}
    times = loop.ride(seconds, timed=True).times
    assert times is not None
    return found | {part: median(getattr(times, part)) for part in PARTS}


def of_before(seconds: float) -> dict[str, float]:
    """Ride by the loop of the benches of before, which had neither supervisor nor record."""
    from ride.settings import resolve

    made: Any = import_module("bench.closed_loop").ClosedLoop
    loop = made(resolve(None, {name: {"speed_kmh": SPEED_KMH} for name in ("catenary_model", "test_rig_sim")}))
    cycles = round(seconds / 0.002)
    for _ in loop.cycles(500):
        pass
    begun = perf_counter()
    times = list(loop.cycles(cycles))
    found = {"factor": seconds / (perf_counter() - begun)}
    return found | {part: 1e-9 * median(column) for part, column in zip(PARTS, zip(*times, strict=True), strict=True)}


def of_coupling(seconds: float) -> float:
    """Ride with a pantograph that is coupled within the step, without controller and rig: times real time."""
    from catenary_model.build import Config, build
    from catenary_model.pantograph import Pantograph
    from catenary_model.ride import ride
    from test_rig_sim.pantographs import PANTOGRAPHS

    chain = PANTOGRAPHS["three_mass"]()
    rider = Pantograph.of(chain.mass, chain.damping, chain.stiffness, UPLIFT)
    catenary = build(Config(speed=SPEED_KMH / 3.6))
    ride(catenary, rider, 1.0)
    begun = perf_counter()
    ride(catenary, rider, seconds)
    return seconds / (perf_counter() - begun)


def main() -> None:
    """Ride so many s, and say what it took."""
    seconds = float(sys.argv[1])
    try:
        found = of_library(seconds)
    except ModuleNotFoundError:
        found = of_before(seconds)
    print(json.dumps(found | {"coupling": of_coupling(seconds)}))


if __name__ == "__main__":
    main()
