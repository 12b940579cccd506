"""A recorded ride as numpy columns, from any bag and without ROS or the built interfaces.

Reads what the recorder or `ros2 bag record` wrote: a directory with MCAP or sqlite3 files, a bare file, or one that
was cut off when its writer was killed. The message definitions are those inside the bag.
"""

from __future__ import annotations

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

from .bag_columns import Column, Columns, types_of
from .bag_storage import BagError, Channel, open_source, records

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

_DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


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
        """Return a column of scalars as float64."""
        return self[name].astype(np.float64)

    def take(self, rows: NDArray[Any]) -> Table:
        """Return the table with these rows (indices or mask) only."""
        index = np.arange(len(self))[rows]
        columns: dict[str, Column] = {
            name: column[index] if isinstance(column, np.ndarray) else [column[i] for i in index]
            for name, column in self.columns.items()
        }
        return Table(self.topic, self.msgtype, self.log_time[index], columns)


@dataclass(frozen=True)
class Diagnostic:
    """One status from /diagnostics: when it was logged (ns), its level (0 to 3), the node, and its message."""

    log_time: int
    level: int
    name: str
    message: str
    values: Mapping[str, str]


@dataclass
class Bag:
    """A bag in memory: a table a topic, the diagnostics, and how whole the recording is.

    `complete` is false when a file was cut off; `counts` has the messages read a topic (of the types used).
    """

    path: Path
    storage: str
    complete: bool
    topics: Mapping[str, str]
    tables: dict[str, Table] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)

    def table(self, name: str, msgtype: str) -> Table:
        """Return the table whose topic ends in `name`, or else the only one of this message type.

        Raises BagError if there is none, or several in different namespaces.
        """
        found = self.find(name, msgtype)
        if found is None:
            present = ", ".join(sorted(self.topics)) or "no topic at all"
            raise BagError(f"no {msgtype} in this bag (topic .../{name}); it has: {present}")
        return found

    def find(self, name: str, msgtype: str) -> Table | None:
        """Return the table as `table` does, or None if there is none."""
        typed = self.of_type(msgtype)
        named = [table for table in typed if f"/{table.topic}".endswith(f"/{name}")]
        found = named or (typed if len(typed) == 1 and msgtype != "ConservedQuantities" else [])
        if len(found) > 1:
            topics = ", ".join(table.topic for table in found)
            raise BagError(f"several rides in this bag ({topics}): name one by its namespace")
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
    """Read a ride's topics into numpy columns.

    `fields` names the message types to read and which fields of each; `namespace` picks one ride where a bag
    holds several. Raises BagError, with one line that says what is wrong, if the path holds no readable bag.
    """
    source = open_source(Path(path))
    prefix = None if namespace is None else "/" + namespace.strip("/") + "/"

    def wanted(channel: Channel) -> bool:
        if channel.msgtype == _DIAGNOSTICS:
            return True
        ours = channel.msgtype.startswith("phil_interfaces/") and _short(channel.msgtype) in fields
        return ours and (prefix is None or channel.topic.startswith(prefix))

    columns: dict[str, Columns] = {}
    log_times: dict[str, list[int]] = {}
    diagnostics: list[Diagnostic] = []
    store: Typestore | None = None
    try:
        for channel, log_time, payload in records(source, wanted):
            if channel.msgtype == _DIAGNOSTICS:
                store = store or _typestore(channel)
                diagnostics += _statuses(store, log_time, payload)
                continue
            collector = columns.get(channel.topic)
            if collector is None:
                collector = Columns(channel, fields[_short(channel.msgtype)])
                columns[channel.topic] = collector
                log_times[channel.topic] = []
            collector.add(payload)
            log_times[channel.topic].append(log_time)
    except OSError as error:
        raise BagError(f"{path}: {error.strerror or error}") from None
    tables = {
        topic: Table(topic, _short(collector.channel.msgtype), np.array(log_times[topic], np.int64), collector.finish())
        for topic, collector in columns.items()
    }
    topics = {topic: channel.msgtype for topic, channel in source.channels.items()}
    return Bag(source.path, source.storage, source.complete, topics, tables, diagnostics)


def _short(msgtype: str) -> str:
    return msgtype.rsplit("/", 1)[-1]


def _typestore(channel: Channel) -> Typestore:
    store = get_typestore(Stores.EMPTY)
    store.register(types_of(channel))
    return store


def _statuses(store: Typestore, log_time: int, payload: bytes) -> list[Diagnostic]:
    """Deserialise a DiagnosticArray; a status of level OK is of no interest to a report."""
    try:
        message = store.deserialize_cdr(payload, _DIAGNOSTICS)
    except SerdeError as error:
        raise BagError(f"a message on /diagnostics cannot be read: {error}") from None
    found = []
    statuses: list[SimpleNamespace] = getattr(message, "status", [])
    for status in statuses:
        level = int(status.level[0]) if isinstance(status.level, bytes) else int(status.level)
        values = {entry.key: entry.value for entry in status.values}
        if level > 0:
            found.append(Diagnostic(log_time, level, status.name, status.message, values))
    return found
