"""Trajectories for position tracking, sampled at the cycle: rest at both ends, and never beyond what is allowed."""

import math
import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from phil_base.clear_words import ClearError
from test_rig_sim.motion import Pace, at_rest, towards

Array = npt.NDArray[np.float64]

_NUMBER = re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$")
KINDS = ("sine", "chirp", "steps", "file")
LONGEST = 3600.0
"""s, every trajectory is sampled as a whole before it begins."""


class Shape(NamedTuple):
    """What the trajectory is to be."""

    kind: str  # one of KINDS
    center: float  # m
    amplitude: float  # m
    frequency: float  # Hz; steps: of the square wave
    end_frequency: float  # Hz, of a chirp
    duration: float  # s
    fade: float  # s, time in which sine and chirp come and go
    file: str  # CSV file with time (s) and position (m) in each line


class Ability(NamedTuple):
    """What drive and limits allow."""

    position: float  # m
    speed: float  # m/s
    acceleration: float  # m/s^2


def sample(shape: Shape, pace: Pace, period: float) -> Array:
    """Return the positions (n,) in m at t = 0, period, ...; the steps are motions of that pace.

    Sine and chirp begin and end at the center under a half-cosine window; a chirp's frequency rises linearly. A file
    is joined by a cubic spline whose speed is zero at both ends.

    Raises
    ------
    ValueError
        The text names the key: a file that cannot be read or whose times do not rise.
    """
    if shape.kind == "file":
        return _from_file(shape.file, period)
    count = max(1, round(shape.duration / period))
    t: Array = np.arange(count + 1, dtype=np.float64) * period
    if shape.kind == "steps":
        return _steps(shape, pace, t, period)
    end = shape.frequency if shape.kind == "sine" else shape.end_frequency
    phase = 2.0 * math.pi * (shape.frequency * t + 0.5 * (end - shape.frequency) / t[-1] * t**2)
    fade = min(shape.fade, 0.5 * float(t[-1]))
    near = np.minimum(np.minimum(t, t[-1] - t), fade)
    window = 0.5 * (1.0 - np.cos(math.pi * near / fade)) if fade > 0.0 else np.ones_like(t)
    found: Array = shape.center + shape.amplitude * window * np.sin(phase)
    found[-1] = shape.center
    return found


def _steps(shape: Shape, pace: Pace, t: Array, period: float) -> Array:
    found = [shape.center]
    speed = 0.0
    for time in t[:-1]:
        goal = shape.center + shape.amplitude * (1.0 if (time * shape.frequency) % 1.0 < 0.5 else -1.0)
        reference, speed = towards(goal, pace, found[-1], speed, period)
        found.append(reference)
    while not at_rest(shape.center, found[-1], speed):
        reference, speed = towards(shape.center, pace, found[-1], speed, period)
        found.append(reference)
    return np.array(found)


def _from_file(name: str, period: float) -> Array:
    if not name:
        raise ValueError("trajectory.file is empty: it has to name a CSV file of time (s) and position (m)")
    try:
        with Path(os.path.expanduser(name)).open(encoding="utf-8-sig") as lines:  # noqa: PTH111 - unknown users
            rows = [(i, line) for i, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")]
    except OSError as error:
        raise ValueError(f"trajectory.file = {name} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"trajectory.file = {name} cannot be read: it is no UTF-8 text") from None
    if rows and any(c.isalpha() and c not in "eE" for c in rows[0][1]):
        rows = rows[1:]
    table = np.array([_row(name, i, line) for i, line in rows], dtype=np.float64)
    if table.ndim != 2 or table.shape[1:] != (2,) or len(table) < 2 or not np.all(np.isfinite(table)):
        raise ValueError(f"trajectory.file = {name}: two or more lines of 'time, position' are needed")
    if not np.all(np.diff(table[:, 0]) > 0.0):
        raise ValueError(f"trajectory.file = {name}: the times do not rise from line to line")
    length = float(table[-1, 0] - table[0, 0])
    if length > LONGEST:
        raise ValueError(f"trajectory.file = {name}: lasts {length:g} s, at most {LONGEST:g} s are allowed")
    from scipy.interpolate import CubicSpline  # half a second to load, and few rides need it

    count = math.ceil(length / period - 1e-9)
    try:
        with np.errstate(all="ignore"):  # what overflows is no number, and refused
            spline = CubicSpline(table[:, 0] - table[0, 0], table[:, 1], bc_type="clamped")
            found = np.asarray(spline(np.minimum(np.arange(count + 1) * period, length)), dtype=np.float64)
    except ValueError:
        found = np.full(1, np.nan)
    if not np.all(np.isfinite(found)):
        raise ValueError(f"trajectory.file = {name}: times are too close, or positions too far, for a curve")
    return found


def _row(name: str, number: int, line: str) -> list[float]:
    words = [word.strip() for word in line.split(",")]
    if len(words) != 2 or not all(_NUMBER.match(word) for word in words):
        raise ClearError(f"trajectory.file = {name}: line {number}: '{line.strip()}' is not 'time, position'")
    return [float(word) for word in words]


def check(positions: Array, shape: Shape, ability: Ability, period: float) -> None:
    """Refuse a trajectory that drive or limits cannot follow from rest to rest.

    Raises
    ------
    ValueError
        The text names the keys, what they ask for and what there is.
    """
    keys = {
        "sine": "trajectory.amplitude, trajectory.frequency",
        "chirp": "trajectory.amplitude, trajectory.frequency, trajectory.end_frequency",
        "steps": "trajectory.amplitude, motion.speed, motion.acceleration",
        "file": "trajectory.file",
    }[shape.kind]
    named = f" in {shape.file}" if shape.kind == "file" else ""
    padded = np.concatenate([positions[:1], positions, positions[-1:]])
    speed = np.diff(padded) / period
    asked = (
        ("position", "m", float(np.abs(positions).max()), ability.position),
        ("speed", "m/s", float(np.abs(speed).max()), ability.speed),
        ("acceleration", "m/s^2", float(np.abs(np.diff(speed)).max()) / period, ability.acceleration),
    )
    for what, unit, most, allowed in asked:
        if not most <= allowed:  # nor what is no number
            raise ValueError(
                f"{keys}: the trajectory{named} asks for a {what} of {most:.3g} {unit}, allowed are {allowed:.3g}"
            )
