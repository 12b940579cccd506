"""Where the numbers in `controlled` come from: a random search over `Settings`, run once, offline.

    python -m catenary_model.boundary.control_design.tuning discretised --seed 1 --minutes 10

A candidate is designed for both wires of Table 3.1, both ends, three speeds and several meshes and steps. Its merit is
the worst of these cases, each measured by its reflected amplitude over what is aimed at: well under the goals, so that
other wires, speeds and meshes have room. `MARGIN` times the gain has to be stable as well, and on the coupled wires
with droppers frozen in several places nothing may decay more slowly than with the plain dashpot by more than `SLOWER`.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary_model.boundary.clamped import clamped
from catenary_model.boundary.control_design.design import SPACE, end_gain
from catenary_model.boundary.control_design.settings import Settings
from catenary_model.boundary.controlled import CONTINUOUS, DISCRETISED
from catenary_model.boundary.layer import AHEAD, BEHIND, Feedback, Layer
from catenary_model.boundary.matched_dashpot import matched_dashpot
from catenary_model.boundary.reflection import reflection
from catenary_model.boundary.springs import frozen
from catenary_model.boundary.stability import spectral_radius
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line
from catenary_model.moving_frame import CARRIER, CONTACT, Mesh, MovingFrame, assemble

Array = NDArray[np.float64]

NODES = 20
SPEEDS = (320.0 / 3.6, 0.0, 250.0 / 3.6)
MESHES = (
    (0.75, Layer(NODES, 0.001, 0.16, 0.53)),
    (1.0, Layer(NODES, 0.002)),
    (1.0, Layer(NODES, 0.001)),
    (0.5, Layer(NODES, 0.001)),
    (0.75, Layer(NODES, 0.002)),
    (0.5, Layer(NODES, 0.002)),
)
"""dx (m), and step with Newmark's parameters; the first is the real-time model's."""
LOW = np.concatenate((np.arange(0.5, 10.0, 0.5), np.arange(10.0, 30.1, 1.0)))
MIDDLE = np.arange(31.0, 61.0, 2.0)
TIMES, WORST, ABOVE, REST = 6.0, 0.004, 0.1, 0.3
"""Aims: rms from 0.5 to 30 Hz so many times below the plain dashpot's, worst there, worst from 31 to 60 Hz, worst
above, up to the highest frequency there is."""
SLOWER = 5e-5
"""Rise of the coupled spectral radius over the plain dashpot's that costs as much as missing an aim."""
MARGIN = 1.1
"""Factor on the gain that still has to be stable."""
POSITIONS = (0.0, 7.0, 30.0)


@dataclass(frozen=True)
class Case:
    """Speed, mesh and step, with what a clamped end returns there and the rms share that the dashpot does."""

    frame: MovingFrame
    layer: Layer
    frequency: Array
    clamped: dict[tuple[int, int], Array]
    plain: dict[tuple[int, int], float]


OPTIONS: dict[str, list[Any]] = {
    "input_nodes": [1, 2, 3, 6, 10],
    "state_nodes": [6, 8, 10, 12, 14, 17, 20],
    "horizon": [1, 2, 3, 5, 8],
    "moves": [1, 2, 5],
    "lowest": [0.05, 0.1, 0.3],
    "highest": [40.0, 50.0, 60.0, 70.0, 80.0, 100.0, 120.0],
    "harmonics": [40, 80, 120],
    "regularisation": [10.0**power for power in range(-11, -1)],
    "tilt": [0.0, 0.5, 1.0, 1.5],
    "above": [0.003, 0.01, 0.03, 0.1, 0.3, 1.0],
    "others": [0.0, 0.0003, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3],
    "velocity": [0.002, 0.005, 0.01, 0.02, 0.05, 0.1],
    "decay": [0.0, 0.01, 0.03, 0.1, 0.3, 1.0],
    "growth": [1.0, 2.0, 3.0],
    "effort": [10.0**power for power in range(-10, 3)],
}
"""What the search may choose from, by field of `Settings`."""


EVERYWHERE = tuple(itertools.product((CARRIER, CONTACT), (BEHIND, AHEAD)))
"""Wire and end."""


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def cases() -> list[Case]:
    """Prepare all cases, the hardest first."""
    found = []
    for (h, layer), speed in itertools.product(MESHES, SPEEDS):
        frequency = np.concatenate((LOW, MIDDLE, np.arange(65.0, 0.49 / layer.ts, 5.0)))
        returned = []
        for kind in (clamped, matched_dashpot):
            ended = assemble(Mesh(h, 4), CARRIER_3_1, CONTACT_3_1, speed)
            kind(ended, layer)
            bare = replace(layer, nodes=0)
            returned.append({at: np.abs(reflection(ended, None, *at, bare, frequency)) for at in EVERYWHERE})
        plain = {at: _rms((returned[1][at] / returned[0][at])[: LOW.size]) for at in EVERYWHERE}
        frame = assemble(Mesh(h, NODES + SPACE // 2), CARRIER_3_1, CONTACT_3_1, speed)
        matched_dashpot(frame, layer)
        found.append(Case(frame, layer, frequency, returned[0], plain))
    return found


def shares(case: Case, feedback: Feedback, wire: int, end: int) -> tuple[float, float, float, float]:
    """Return rms and worst below 30 Hz, worst to 60 Hz and worst above, normalised by a clamped end."""
    raw = np.abs(reflection(case.frame, feedback, wire, end, case.layer, case.frequency))
    r = raw / case.clamped[wire, end]
    low, middle = r[: LOW.size], r[LOW.size : LOW.size + MIDDLE.size]
    rest = r[LOW.size + MIDDLE.size :]
    return _rms(low), float(low.max()), float(middle.max()), float(rest.max())


def merit(settings: Settings, over: list[Case], enough: float = math.inf) -> float:
    """Return the worst of all cases over its aim, 1 is met; infinite if unstable; stops early above `enough`."""
    worst = 0.0
    for case in over:
        gains = []
        for wire in (CARRIER, CONTACT):
            parts = (case.frame.wire(wire), case.frame.mesh.h, case.frame.speed)
            gains.append(tuple(end_gain(*parts, end, case.layer, settings) for end in (BEHIND, AHEAD)))
        feedback = Feedback(((gains[0][0], gains[0][1]), (gains[1][0], gains[1][1])))
        for wire, end in EVERYWHERE:
            rms, low, middle, rest = shares(case, feedback, wire, end)
            worst = max(worst, TIMES * rms / case.plain[wire, end], low / WORST, middle / ABOVE, rest / REST)
            if worst > enough:
                return worst
        for times in (1.0, MARGIN):
            scaled = Feedback(tuple((times * b, times * a) for b, a in feedback.gain))  # type: ignore[arg-type]
            if any(spectral_radius(case.frame, scaled, case.layer, wires=(wire,)) >= 1.0 for wire in (0, 1)):
                return math.inf
        if (case.frame.mesh.h, case.layer) in MESHES[:2] and case.frame.speed > 0.0:
            worst = max(worst, slower(case, feedback) / SLOWER)
            if worst > enough:
                return worst
    return worst


def slower(case: Case, feedback: Feedback) -> float:
    """Return by how much the feedback raises the spectral radius of the coupled wires, droppers frozen."""
    rise = 0.0
    for zeta in POSITIONS:
        springs = frozen(Line(), case.frame.mesh, zeta, 2.0 * NODES * case.frame.mesh.h)
        plain, controlled = (spectral_radius(case.frame, f, case.layer, springs) for f in (None, feedback))
        rise = max(rise, controlled - plain)
    return rise


def changed(random: np.random.Generator, settings: Settings, fields: int) -> Settings:
    """Return settings with some fields drawn anew from OPTIONS."""
    names = random.choice(list(OPTIONS), fields, replace=False)
    drawn = {name: OPTIONS[name][int(random.integers(len(OPTIONS[name])))] for name in names}
    both = {"state_nodes": settings.state_nodes, "horizon": settings.horizon, **drawn}
    both["input_nodes"] = min(both.get("input_nodes", settings.input_nodes), both["state_nodes"])
    both["moves"] = min(both.get("moves", settings.moves), both["horizon"])
    return replace(settings, **both)


def main() -> None:
    """Search and print the best settings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dispersion", choices=("discretised", "continuous"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--meshes", type=int, default=len(MESHES), help="so many of MESHES, the first ones")
    given = parser.parse_args()
    random = np.random.default_rng(given.seed)
    over = [case for case in cases() if (case.frame.mesh.h, case.layer) in MESHES[: given.meshes]]
    shipped = CONTINUOUS if given.dispersion == "continuous" else DISCRETISED
    best: list[tuple[float, Settings]] = [(merit(shipped, over), shipped)]
    tried, until = 0, time.monotonic() + 60.0 * given.minutes
    while time.monotonic() < until:
        # now and then from anywhere, else near what is good
        fields = len(OPTIONS) if random.random() < 0.1 else int(random.integers(1, 5))
        settings = changed(random, best[int(random.integers(len(best)))][1], fields)
        if any(settings == known for _, known in best):
            continue
        reached = merit(settings, over, best[-1][0] if len(best) >= 6 else math.inf)
        tried += 1
        best = sorted([*best, (reached, settings)], key=lambda entry: entry[0])[:6]
    print(f"{tried} settings tried")
    for reached, settings in best:
        print(f"{reached:.3f} {settings}")


if __name__ == "__main__":
    main()
