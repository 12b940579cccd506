"""Descriptions of journeys in YAML.

A file holds one of four mappings:

    constant: {speed_kmh: 250.0}

    over_time:                        # speed in straight lines over time
      columns: [time_s, speed_kmh]
      points: [[0.0, 0.0], [40.0, 160.0], [100.0, 160.0], [130.0, 0.0]]

    over_place:                       # constant acceleration between two places
      columns: [position_m, speed_kmh]
      points: [[0.0, 80.0], [1500.0, 250.0]]

    start_cruise_brake:
      cruise_speed_kmh: 250.0
      acceleration_m_s2: 0.5
      braking_m_s2: 0.8
      distance_m: 20000.0             # or cruise_time_s
      start_speed_kmh: 0.0            # this and what follows may be left out
      end_speed_kmh: 0.0
      jerk_m_s3: 0.5                  # left out: the acceleration jumps

Times and places begin at 0, where the journey does, and rise. What cannot be travelled on the line is refused with one
line that names file, entry and what is allowed.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from catenary_model import travel
from catenary_model.line import Line
from catenary_model.travel import Travel, TravelError, Words
from phil_base.yaml_file import YamlError, read_yaml

_KMH = 3.6
_SPEED = "speed_kmh"
_ALONG = {"over_time": "time_s", "over_place": "position_m"}


def load_travel(path: str | Path, line: Line) -> Travel:
    """Read a journey on a line from a YAML file. Raises TravelError naming file, entry and allowed range."""
    try:
        return read_travel(read_yaml(path), line)
    except YamlError as error:
        raise TravelError(str(error)) from None
    except TravelError as error:
        raise TravelError(f"{path}: {error}") from None


def read_travel(content: Any, line: Line) -> Travel:
    """Make a journey on a line of what a YAML file holds. Raises TravelError naming entry and allowed range."""
    if not (isinstance(content, dict) and len(content) == 1):
        raise TravelError(f"a journey: allowed is a mapping with one of the entries {', '.join(_KINDS)}")
    ((kind, entries),) = content.items()
    if kind not in _KINDS:
        raise TravelError(f"{kind}: unknown entry; {_meant(kind, _KINDS)}allowed is one of {', '.join(_KINDS)}")
    return _KINDS[kind](kind, entries, travel.fastest_on(line))


def _constant(kind: str, entries: Any, most: float) -> Travel:
    numbers = _numbers(kind, entries, (_SPEED,))
    return travel.constant(numbers[_SPEED] / _KMH, most, _words(kind, cruise_speed=_SPEED))


def _over(kind: str, entries: Any, most: float) -> Travel:
    along = _ALONG[kind]
    _mapping(kind, entries, ("columns", "points"), ("columns", "points"))
    columns, points = entries["columns"], entries["points"]
    if columns not in ([along, _SPEED], [_SPEED, along]):
        raise TravelError(f"{kind}.columns = {columns}: allowed is [{along}, {_SPEED}]")
    if not isinstance(points, list):
        raise TravelError(f"{kind}.points: allowed is a list of [{', '.join(columns)}]")
    read: dict[str, list[float]] = {along: [], _SPEED: []}
    for i, point in enumerate(points):
        if not (isinstance(point, list) and len(point) == 2):
            raise TravelError(f"{kind}.points[{i}] = {point}: allowed is [{', '.join(columns)}]")
        for column, value in zip(columns, point, strict=True):
            read[column].append(_number(f"{kind}.points[{i}].{column}", value))
    speeds = [speed / _KMH for speed in read[_SPEED]]
    name = f"points[{{}}].{along}"
    words = _words(kind, points="points", time=name, place=name, speed=f"points[{{}}].{_SPEED}")
    return (travel.over_time if kind == "over_time" else travel.over_place)(read[along], speeds, most, words)


_GIVEN = {
    "cruise_speed_kmh": "cruise_speed",
    "acceleration_m_s2": "acceleration",
    "braking_m_s2": "braking",
    "distance_m": "distance",
    "cruise_time_s": "cruise_time",
    "start_speed_kmh": "start_speed",
    "end_speed_kmh": "end_speed",
    "jerk_m_s3": "jerk",
}
"""Entries of `start_cruise_brake`, and their names there."""


def _start_cruise_brake(kind: str, entries: Any, most: float) -> Travel:
    numbers = _numbers(kind, entries, _GIVEN, ("cruise_speed_kmh", "acceleration_m_s2", "braking_m_s2"))
    given: dict[str, Any] = {
        _GIVEN[key]: value / _KMH if key.endswith("_kmh") else value for key, value in numbers.items()
    }
    words = _words(kind, **{name: key for key, name in _GIVEN.items()})
    return travel.start_cruise_brake(given.pop("cruise_speed"), **given, most=most, words=words)


_KINDS: dict[str, Callable[[str, Any, float], Travel]] = {
    "constant": _constant,
    "over_time": _over,
    "over_place": _over,
    "start_cruise_brake": _start_cruise_brake,
}


def _words(kind: str, **names: str) -> Words:
    return Words(**{name: f"{kind}.{entry}" for name, entry in names.items()}, unit="km/h", per=_KMH)


def _mapping(kind: str, entries: Any, allowed: Sequence[str], needed: Sequence[str]) -> None:
    if not isinstance(entries, dict):
        raise TravelError(f"{kind}: allowed is a mapping of {', '.join(allowed)}")
    for key in entries:
        if key not in allowed:
            raise TravelError(f"{kind}.{key}: unknown entry; {_meant(key, allowed)}allowed are {', '.join(allowed)}")
    for key in needed:
        if key not in entries:
            raise TravelError(f"{kind}.{key} is missing; allowed are {', '.join(allowed)}")


def _numbers(
    kind: str, entries: Any, allowed: Sequence[str] | dict[str, str], needed: Sequence[str] = ()
) -> dict[str, float]:
    keys = tuple(allowed)
    _mapping(kind, entries, keys, needed or keys)
    return {key: _number(f"{kind}.{key}", value) for key, value in entries.items()}


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise TravelError(f"{name} = {value!r}: allowed is a finite number")
    return float(value)


def _meant(key: Any, allowed: Sequence[str] | dict[str, Any]) -> str:
    near = difflib.get_close_matches(str(key), list(allowed), 1)
    return f"did you mean {near[0]}? " if near else ""
