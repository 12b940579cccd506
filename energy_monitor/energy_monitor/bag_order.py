"""Messages of one topic from several files and channels, brought into one order.

The order is that of the log time, whatever the order of files and of messages in them. Only where that makes cycle
numbers fall back and the order in the files does not, as after a wall clock that was set back in mid-ride, the order
in the files counts.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from energy_monitor.bag_channel import BagError, Channel
from energy_monitor.bag_columns import Column, Columns

STEP_BACK = 64
"""Cycles that a file may begin before the end of the one before it and still belong to the same ride."""
_EDGE = 9
"""Messages at the ends of a file of which the median is taken: a stray one must not count."""

Integers = NDArray[np.int64]


@dataclass
class Part:
    """Messages of one definition in one file: log times in ns, and numbers in the order of reading."""

    channel: Channel
    file: Path
    columns: Columns
    log_times: array[int] = field(default_factory=lambda: array("q"))
    places: array[int] = field(default_factory=lambda: array("q"))

    def add(self, log_times: Sequence[int], places: Sequence[int], payloads: Sequence[bytes]) -> None:
        """Take messages."""
        self.columns.add(payloads)
        self.log_times.extend(log_times)
        self.places.extend(places)


@dataclass(frozen=True)
class Joined:
    """All messages of one topic in the order of the files: log time in ns, place, columns."""

    log_time: Integers
    place: Integers
    columns: dict[str, Column]

    def ordered(self, by_place: bool) -> Joined:
        """Return the messages in the order of log time (places where it is equal), or of places alone."""
        if not by_place and (self.log_time[1:] >= self.log_time[:-1]).all() and self._placed:
            return self
        if by_place and self._placed:
            return self
        order = np.argsort(self.place) if by_place else np.lexsort((self.place, self.log_time))
        columns: dict[str, Column] = {
            name: column[order] if isinstance(column, np.ndarray) else [column[i] for i in order]
            for name, column in self.columns.items()
        }
        return Joined(self.log_time[order], self.place[order], columns)

    @property
    def _placed(self) -> bool:
        return bool((self.place[1:] >= self.place[:-1]).all())

    def falls(self, by_place: bool) -> int:
        """Count how often the cycle number falls back in that order."""
        cycle = self.columns.get("cycle")
        if not isinstance(cycle, np.ndarray):
            return 0
        order = np.argsort(self.place) if by_place else np.lexsort((self.place, self.log_time))
        ordered = cycle[order]
        return int((ordered[1:] < ordered[:-1]).sum())


def joined(parts: Sequence[Part]) -> Joined:
    """Join the parts of one topic, whose definitions may differ in type and number of fields; what all have is kept.

    Raises BagError if a field is a number in one and a list in the other.
    """
    times: list[Integers] = []
    places: list[Integers] = []
    found: list[dict[str, Column]] = []
    for part in parts:
        columns = part.columns.finish()
        kept = part.columns.kept
        if not len(kept):
            continue
        whole = len(kept) == len(part.log_times)
        for found_there, into in ((part.log_times, times), (part.places, places)):
            everything = np.frombuffer(found_there, np.int64)
            into.append(everything if whole else everything[kept])
        found.append(columns)
    if len(found) < 2:
        empty = np.zeros(0, np.int64)
        return Joined(times[0], places[0], found[0]) if found else Joined(empty, empty, {})
    common = [name for name in found[0] if all(name in entry for entry in found)]
    columns = {name: _concatenated(parts[0].channel, name, [entry[name] for entry in found]) for name in common}
    return Joined(np.concatenate(times), np.concatenate(places), columns)


def in_order(tables: Mapping[str, Joined]) -> dict[str, Joined]:
    """Bring every topic into the one order that fits the cycle numbers of all."""
    by_time, by_place = (sum(table.falls(place) for table in tables.values()) for place in (False, True))
    return {name: table.ordered(by_place < by_time) for name, table in tables.items()}


@dataclass
class FileRide:
    """Files that hold one ride: its first and last cycle and log time (ns)."""

    files: list[Path]
    cycles: tuple[int, int]
    times: tuple[int, int]

    def __str__(self) -> str:
        """Name the files and the cycles."""
        return f"{', '.join(file.name for file in self.files)} (cycles {self.cycles[0]} to {self.cycles[1]})"


def rides_of_files(parts: Sequence[Part]) -> list[FileRide]:
    """Group the files of one topic of states by the rides that they hold, by the time when they begin.

    A file belongs to the ride whose cycles it continues, or shares where both were recorded at the same time.
    """
    spans = []
    for part in parts:
        cycle = part.columns.finish()["cycle"]
        if not len(cycle):
            continue
        assert isinstance(cycle, np.ndarray)
        time = np.frombuffer(part.log_times, np.int64)[part.columns.kept]
        order = np.argsort(time, kind="stable")
        time, cycle = time[order], cycle[order].astype(np.int64)
        spans.append((int(time[0]), int(time[-1]), part.file, time, cycle))
    spans.sort(key=lambda span: span[:2])
    rides: list[FileRide] = []
    curves: list[tuple[Integers, Integers]] = []
    for begin, end, file, time, cycle in spans:
        edges = np.median(cycle[:_EDGE]), np.median(cycle[-_EDGE:])
        half = min(_EDGE, len(cycle)) // 2
        first, last = max(0, int(edges[0]) - half), int(edges[1]) + half
        for index, ride in enumerate(rides):
            if _continues(ride, curves[index], begin, first):
                ride.files += [file] if file not in ride.files else []
                ride.cycles = (min(ride.cycles[0], first), max(ride.cycles[1], last))
                ride.times = (ride.times[0], max(ride.times[1], end))
                curves[index] = (time, cycle)
                break
        else:
            rides.append(FileRide([file], (first, last), (begin, end)))
            curves.append((time, cycle))
    return rides


def _continues(ride: FileRide, before: tuple[Integers, Integers], begin: int, first: int) -> bool:
    time, cycle = before
    if begin >= ride.times[1]:
        return bool(first > np.median(cycle[-_EDGE:]) - STEP_BACK)
    at = int(np.searchsorted(time, begin))
    there = int(np.median(cycle[max(0, min(at, len(cycle)) - _EDGE) : at + _EDGE]))
    return abs(first - there) <= STEP_BACK


def _concatenated(channel: Channel, name: str, columns: Sequence[Column]) -> Column:
    arrays = [column for column in columns if isinstance(column, np.ndarray)]
    if len(arrays) == len(columns):
        return np.concatenate(arrays)
    if arrays:
        raise BagError(f"{channel.topic}: {name} is a number in one part of the bag and a list in another")
    return [entry for column in columns for entry in column]
