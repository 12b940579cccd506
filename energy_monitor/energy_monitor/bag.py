"""A recorded ride as numpy columns, from any bag and without ROS or the built interfaces.

Reads what the recorder or `ros2 bag record` wrote: a directory with MCAP or sqlite3 files, a bare file, or one that
was cut off when its writer was killed. The message definitions are those inside the bag.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from energy_monitor.bag_channel import CDR, BagError, Channel, DefinitionError, Record, Source, left_out
from energy_monitor.bag_columns import Column, Columns, store_of, types_of
from energy_monitor.bag_order import FileRide, Part, in_order, joined, rides_of_files
from energy_monitor.bag_storage import file_batches, open_source

__all__ = ["RIDE_FIELDS", "Bag", "BagError", "Diagnostic", "Table", "read_bag"]

_STAMP = ("header.stamp.sec", "header.stamp.nanosec")

RIDE_FIELDS: Mapping[str, tuple[str, ...]] = {
    "RigState": (
        *_STAMP, "cycle", "mode", "last", "w_tr", "v_tr", "f_tr", "f_raw", "reference", "current", "work",
        "impulse", "late_commands",
    ),
    "CatenaryState": (
        *_STAMP, "cycle", "w_cat", "v_cat", "a_cat", "f_cat", "work", "impulse", "track_position", "speed", "droppers",
        "slack_droppers", "iterations",
    ),
    "ImpedanceCommand": (
        *_STAMP, "cycle", "u_tr", "u_tr_next", "f_tr", "f_predicted", "f_cor", "f_cat", "f_cor_lower", "f_cor_upper",
        "correction", "environment", "status", "iterations", "fallbacks",
    ),
    "ConservedQuantities": (
        "cycle", "e_tr", "e_cat", "delta_e", "p_tr", "p_cat", "delta_p", "exchanged_energy", "exchanged_momentum",
        "work_tr", "work_cat", "delta_work", "impulse_tr", "impulse_cat",
    ),
    "ContactQuality": (
        "cycle", "samples", "force", "mean", "sigma", "minimum", "maximum", "loss_share", "losses",
    ),
    "CycleTiming": ("cycle", "budget", "turnaround", "late", "missing", "stale", "refused"),
    "WireShape": (
        "cycle", "track_position", "x", "contact", "carrier", "dropper_x", "dropper_force", "mast_x",
    ),
    "ImpedanceModel": ("description", "n", "ts"),
}  # fmt: skip
"""Fields that the analysis uses, by message type; what a type holds beyond them is not decoded."""

_NEWER: Mapping[str, tuple[str, ...]] = {
    "CycleTiming": ("messages_late", "messages_lost", "messages_doubled", "messages_swapped"),
    "CatenaryState": ("companion_place", "companion_force"),
}
"""Fields that are read beside `RIDE_FIELDS` where a bag has them; those of before there were such fields lack them."""

_LISTS: Mapping[str, tuple[str, ...]] = {
    "CycleTiming": ("turnaround",),
    "CatenaryState": ("companion_place", "companion_force"),
    "WireShape": ("x", "contact", "carrier", "dropper_x", "dropper_force", "mast_x"),
    "ImpedanceModel": ("description",),
}
"""Those of the fields that are sequences or strings."""

_THIN: Mapping[str, tuple[str, ...]] = {"WireShape": ("x", "contact", "carrier", "dropper_force")}
"""Those of the sequences that are for pictures only."""

_PACKAGE = "phil_interfaces/msg/"
_NEEDED = ("RigState", "CatenaryState", "ImpedanceCommand")
"""Types without which there are no numbers."""
_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
_UNREADABLE = (SerdeError, ValueError, LookupError, TypeError, AttributeError, struct.error, OverflowError, MemoryError)
"""What a deserialiser says of a message that is damaged or of another type."""


class _UnusableTypeError(BagError):
    """A type that the numbers need cannot be used, in whichever file."""


@dataclass(frozen=True)
class Table:
    """All messages of one topic: `log_time` in ns (messages,), and a column for each field."""

    topic: str
    msgtype: str
    log_time: NDArray[np.int64]
    columns: Mapping[str, Column]

    def __len__(self) -> int:
        """Count the messages."""
        return len(self.log_time)

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a column of scalars; raises KeyError for an unknown field and TypeError for a list."""
        column = self.columns[name]
        if not isinstance(column, np.ndarray):
            raise TypeError(f"{name} has one entry of its own length a message: use entries({name!r})")
        return column

    def entries(self, name: str) -> list[Any]:
        """Return a column of strings or arrays, one entry a message."""
        return list(self.columns[name])

    def real(self, name: str) -> NDArray[np.float64]:
        """Return a column of scalars as float64: the column itself where it is that already, so not to be changed."""
        return self[name].astype(np.float64, copy=False)

    def take(self, rows: NDArray[Any]) -> Table:
        """Return the table with these rows (indices or mask) only; rows that follow each other are not copied."""
        index = np.arange(len(self))[rows]
        if len(index) and (np.diff(index) == 1).all():
            run = slice(int(index[0]), int(index[-1]) + 1)
            views: dict[str, Column] = {name: column[run] for name, column in self.columns.items()}
            return Table(self.topic, self.msgtype, self.log_time[run], views)
        columns: dict[str, Column] = {
            name: column[index] if isinstance(column, np.ndarray) else [column[i] for i in index]
            for name, column in self.columns.items()
        }
        return Table(self.topic, self.msgtype, self.log_time[index], columns)


@dataclass(frozen=True)
class Diagnostic:
    """One status from /diagnostics: when it was logged (ns), its level (0 to 3), the node, and its message.

    `hardware` is the status' hardware_id, `stamp` its header's stamp in ns.
    """

    log_time: int
    level: int
    name: str
    message: str
    values: Mapping[str, str]
    hardware: str = ""
    stamp: int = 0


@dataclass
class Bag:
    """A bag in memory: a table a topic, the diagnostics, `speakers` on that topic, and how whole the recording is.

    `speakers` has the numbers of the processes that spoke under each hardware_id, "" for one that gives none.
    `complete` is false when a file was cut off, damaged or missing. `notes` says what is to be said of it, `left_out`
    how many messages of a topic are not in its table, by reason. `rides_of_files` names the files of each ride where
    nothing but time and cycle numbers tells which files belong together; `namespace` is the only one that was read.
    """

    path: Path
    storage: str
    complete: bool
    topics: Mapping[str, str]
    tables: dict[str, Table] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: dict[tuple[str, str], int] = field(default_factory=dict)
    rides_of_files: list[FileRide] = field(default_factory=list)
    speakers: dict[str, set[str]] = field(default_factory=dict)
    namespace: str = ""

    def table(self, name: str, msgtype: str) -> Table:
        """Return the table whose topic ends in `name`, or else the only one of this message type.

        Raises BagError if there is none, or several in different namespaces.
        """
        found = self.find(name, msgtype)
        if found is not None:
            return found
        kinds = {topic: kind for topic, kind in self.topics.items() if f"/{topic}".endswith(f"/{name}")}
        damage = "" if self.complete else " ".join(self.notes)
        topics = [topic for topic, kind in kinds.items() if kind == f"{_PACKAGE}{msgtype}"]
        if topics and not any(topic.startswith(self.namespace) for topic in topics):
            spaces = ", ".join(topic.removesuffix(f"/{name}") or "/" for topic in topics)
            raise BagError(f"no {msgtype} in the namespace {self.namespace.rstrip('/')} of this bag; it has: {spaces}")
        for topic in topics:
            reasons = [f"{count} are left out, {why}" for (of, why), count in self.left_out.items() if of == topic]
            if reasons:
                raise BagError(f"{topic} has no message that can be used: {'; '.join(reasons)}")
            raise BagError(f"{topic} has no message: {damage or 'the recording ended before the ride began'}")
        for topic, kind in kinds.items():
            if kind != f"{_PACKAGE}{msgtype}":
                raise BagError(f"{topic} in this bag is of type {kind or 'unknown'}, not {_PACKAGE}{msgtype}")
        present = ", ".join(sorted(self.topics)) or "no topic at all"
        raise BagError(f"no {msgtype} in this bag (topic .../{name}); it has: {present}{damage and f'. {damage}'}")

    def find(self, name: str, msgtype: str) -> Table | None:
        """Return the table as `table` does, or None if there is none."""
        typed = self.of_type(msgtype)
        named = [table for table in typed if f"/{table.topic}".endswith(f"/{name}")]
        found = named or (typed if len(typed) == 1 and msgtype != "ConservedQuantities" else [])
        if len(found) > 1:
            topics = ", ".join(table.topic for table in found)
            spaces = [table.topic.removesuffix(f"/{name}") or "/" for table in found]
            raise BagError(
                f"several rides in this bag ({topics}): choose one by its namespace, --namespace {spaces[-1]}"
            )
        return found[0] if found else None

    def of_type(self, msgtype: str) -> list[Table]:
        """Return all tables of one message type that hold messages, sorted by topic."""
        return [table for _, table in sorted(self.tables.items()) if table.msgtype == msgtype and len(table) > 0]


def read_bag(
    path: str | Path,
    *,
    fields: Mapping[str, Sequence[str]] = RIDE_FIELDS,
    namespace: str | None = None,
) -> Bag:
    """Read a ride's topics into numpy columns, in the order of time.

    `fields` names the message types to read and which fields of each; `namespace` picks one ride where a bag
    holds several. Raises BagError, with one line that says what is wrong, if the path holds no readable bag.
    """
    try:
        source = open_source(Path(path))
        reading = _Reading(source, fields, None if namespace is None else "/" + namespace.strip("/") + "/")
        reading.read()
    except OSError as error:
        raise BagError(f"{error.filename or path}: {error.strerror or error}") from None
    rides = reading.rides()
    tables = reading.tables()
    topics = {topic: channel.msgtype for topic, channel in source.channels.items()}
    diagnostics = sorted(reading.diagnostics, key=lambda entry: entry.log_time)
    bag = Bag(source.path, source.storage, source.complete, topics, tables, diagnostics)
    bag.left_out = dict(source.left_out)
    bag.notes = list(source.notes)
    bag.notes += [left_out(count, topic, why) for (topic, why), count in bag.left_out.items()]
    bag.rides_of_files = rides
    bag.speakers = reading.speakers
    bag.namespace = reading.prefix
    return bag


class _Reading:
    """Messages sorted into parts by file and definition while a bag is read."""

    def __init__(self, source: Source, fields: Mapping[str, Sequence[str]], prefix: str | None) -> None:
        self._source = source
        self._fields = fields
        self.prefix = prefix or ""
        self._parts: dict[tuple[Path, Channel], Part] = {}
        self._stores: dict[Channel, Typestore | None] = {}
        self._unusable: set[Channel] = set()
        self.diagnostics: list[Diagnostic] = []
        self.speakers: dict[str, set[str]] = {}

    def read(self) -> None:
        """Read every file; one that is no bag is left out where others are."""
        failed: list[tuple[Path, BagError]] = []
        for file in self._source.files:
            try:
                self._read_file(file)
            except BagError as error:
                if len(self._source.files) == 1 or isinstance(error, _UnusableTypeError):
                    raise
                failed.append((file, error))
        if failed and len(failed) == len(self._source.files):
            raise failed[0][1]
        for _, refusal in failed:
            self._source.complete = False
            self._source.note(f"Left out: {refusal}.")

    def _wanted(self, channel: Channel) -> bool:
        if channel.msgtype == _DIAGNOSTICS:
            return True
        ours = channel.msgtype.startswith(_PACKAGE) and _short(channel.msgtype) in self._fields
        return ours and channel.topic.startswith(self.prefix)

    def _read_file(self, file: Path) -> None:
        # A channel is one object from the first of its messages to the last: looked up by that, it need not be hashed.
        known: dict[int, tuple[Channel, Part | None]] = {}
        for batch in file_batches(self._source, file, self._wanted):
            sorted_out: dict[int, list[int]] = {}
            for index, record in enumerate(batch):
                sorted_out.setdefault(id(record[0]), []).append(index)
            for number, rows in sorted_out.items():
                channel = batch[rows[0]][0]
                if number not in known:
                    known[number] = (channel, self._part(file, channel))
                records = [batch[row] for row in rows]
                self._take(channel, known[number][1], records, [self._place + row for row in rows])
            self._place += len(batch)

    def _take(self, channel: Channel, part: Part | None, records: Sequence[Record], places: Sequence[int]) -> None:
        if part is not None:
            part.add([record[1] for record in records], places, [record[2] for record in records])
        elif channel in self._unusable:
            return
        elif channel.message_encoding != CDR:
            encoding = channel.message_encoding or "nothing that is named"
            self._source.left_out[channel.topic, f"they are encoded as {encoding}, not as cdr"] += len(records)
        else:
            for _, log_time, payload in records:
                self._diagnose(channel, log_time, payload)

    _place = 0

    def _part(self, file: Path, channel: Channel) -> Part | None:
        if channel.message_encoding != CDR or channel.msgtype == _DIAGNOSTICS or channel in self._unusable:
            return None
        part = self._parts.get((file, channel))
        if part is None:
            short = _short(channel.msgtype)
            try:
                fields = (*self._fields[short], *self._newer(channel, short))
                columns = Columns(channel, fields, _LISTS.get(short, ()), _THIN.get(short, ()))
            except BagError as error:
                several = f"{file.name}: " if len(self._source.files) > 1 else ""
                if isinstance(error, DefinitionError) and short not in _NEEDED:
                    self._unusable.add(channel)
                    self._source.note(f"{channel.topic} is not in this report: {several}{error}.")
                    return None
                raise _UnusableTypeError(f"{several}{error}") from None
            part = self._parts[file, channel] = Part(channel, file, columns)
        return part

    def _newer(self, channel: Channel, short: str) -> list[str]:
        """Give the fields that only newer bags have, if this is one of them and all of a ride is asked for."""
        if self._fields is not RIDE_FIELDS or short not in _NEWER:
            return []
        known = {name for name, _ in types_of(channel)[channel.msgtype][1]}
        return [name for name in _NEWER[short] if name in known]

    def rides(self) -> list[FileRide]:
        """Group files by the rides they hold; those that metadata.yaml does not name and hold another are left out."""
        states: dict[str, list[Part]] = {}
        for part in self._parts.values():
            if _short(part.channel.msgtype) == "RigState" and "cycle" in part.columns.fields:
                states.setdefault(part.channel.topic, []).append(part)
        if len(self._source.files) < 2 or not states:
            return []
        rides = max((rides_of_files(parts) for parts in states.values()), key=len)
        if not self._source.listed:
            return rides
        for ride in rides:
            if self._source.unlisted.issuperset(ride.files):
                self._source.note(f"Left out, metadata.yaml does not name it and it holds another ride: {ride}.")
                self._parts = {key: part for key, part in self._parts.items() if key[0] not in ride.files}
        return []

    def tables(self) -> dict[str, Table]:
        """Give a table a topic; a second type on a topic is told by its name behind the topic's."""
        parts: dict[tuple[str, str], list[Part]] = {}
        for part in self._parts.values():
            parts.setdefault((part.channel.topic, part.channel.msgtype), []).append(part)
        names: dict[str, tuple[str, str]] = {}
        for topic, msgtype in parts:
            names[f"{topic} ({_short(msgtype)})" if topic in names else topic] = (topic, msgtype)
        found = {name: joined(parts[key]) for name, key in names.items()}
        for (topic, _), several in parts.items():
            for part in several:
                for why, count in part.columns.refused.items():
                    self._source.left_out[topic, why] += count
        return {
            name: Table(names[name][0], _short(names[name][1]), table.log_time, table.columns)
            for name, table in in_order(found).items()
            if len(table.log_time)
        }

    def _diagnose(self, channel: Channel, log_time: int, payload: bytes) -> None:
        if channel not in self._stores:
            try:
                self._stores[channel] = _typestore(channel)
            except BagError as error:
                self._stores[channel] = None
                self._source.note(f"Warnings on {channel.topic} are not in this report: {error}.")
        store = self._stores[channel]
        if store is None:
            return
        try:
            self.diagnostics += _statuses(store, log_time, payload, self.speakers)
        except _UNREADABLE:
            self._source.left_out[channel.topic, "they cannot be read"] += 1


def _short(msgtype: str) -> str:
    return msgtype.rsplit("/", 1)[-1]


def _typestore(channel: Channel) -> Typestore:
    if not channel.definition:  # a common type: the bag need not explain it
        return get_typestore(Stores.ROS2_JAZZY)
    return store_of(channel)


def _statuses(store: Typestore, log_time: int, payload: bytes, speakers: dict[str, set[str]]) -> list[Diagnostic]:
    """Deserialise a DiagnosticArray; a status of level OK is of no interest to a report."""
    message = store.deserialize_cdr(payload, _DIAGNOSTICS)
    found = []
    statuses: list[SimpleNamespace] = getattr(message, "status", [])
    stamp = getattr(message, "header").stamp  # noqa: B009 - the type is made at run time
    at = stamp.sec * 1_000_000_000 + stamp.nanosec
    for status in statuses:
        level = int(status.level[0]) if isinstance(status.level, bytes) else int(status.level)
        values = {entry.key: entry.value for entry in status.values}
        speakers.setdefault(status.hardware_id, set()).add(values.get("process", ""))
        if level > 0:
            found.append(Diagnostic(log_time, level, status.name, status.message, values, status.hardware_id, at))
    return found
