"""sqlite3 files (rosbag2's older storage), also from a medium that cannot be written, and never changed."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from energy_monitor.bag_channel import BATCH, CDR, BagError, Channel, Record, Source, Wanted, type_name

_LEFT_BEHIND = ("-wal", "-journal")
_LATEST = 2**63 - 1


def sqlite_batches(source: Source, file: Path, wanted: Wanted, content: bytes | None = None) -> Iterator[list[Record]]:
    """Yield the records, in batches, of one sqlite3 file; `content` is what was in it where it is compressed."""
    known = False
    batch: list[Record] = []
    try:
        with _opened(source, file, content) as connection:
            channels = _channels(connection)
            known = True
            for channel in channels.values():
                source.channels.setdefault(channel.topic, channel)
            used = {identity: channel for identity, channel in channels.items() if wanted(channel)}
            marks = ",".join("?" * len(used))
            query = f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({marks}) ORDER BY id"
            for identity, log_time, payload in connection.execute(query, tuple(used)):
                if isinstance(payload, bytes) and isinstance(log_time, int) and 0 <= log_time <= _LATEST:
                    batch.append((used[identity], log_time, payload))
                    if len(batch) == BATCH:
                        yield batch
                        batch = []
                else:
                    source.left_out[used[identity].topic, "their entry is damaged"] += 1
    except (sqlite3.Error, ValueError, OverflowError) as error:
        if not known:
            hint = f": `sqlite3 {file} .recover` may save a part of it" if "malformed" in str(error) else ""
            raise BagError(f"{file}: not a bag that can be read ({error}){hint}") from None
        source.damaged(file, f"what follows the last message that could be read is left out ({error})")
    yield batch


@contextmanager
def _opened(source: Source, file: Path, content: bytes | None) -> Iterator[sqlite3.Connection]:
    """Open the file where it is, or a copy where sqlite would write beside it: to take in what a crash left there."""
    left = [log for log in (Path(f"{file}{suffix}") for suffix in _LEFT_BEHIND) if log.is_file() and _open_end(log)]
    if content is None and not left:
        with closing(sqlite3.connect(_address(file) + "&immutable=1", uri=True)) as connection:
            yield connection
        return
    with TemporaryDirectory(prefix="phil_bag_") as name:
        copy = Path(name) / "bag.db3"
        if content is None:
            shutil.copyfile(file, copy)
            for log in left:
                shutil.copyfile(log, f"{copy}{log.name[len(file.name) :]}")
            source.cut_off(file)
        else:
            copy.write_bytes(content)
        with closing(sqlite3.connect(copy)) as connection:
            yield connection


def _open_end(log: Path) -> bool:
    """Tell whether a log holds what is not in the file yet; the head of one that is done with is empty or zero."""
    with log.open("rb") as stream:
        return any(stream.read(8))


def _address(file: Path) -> str:
    """Give a URI in which the path's #, ?, % and the like mean themselves."""
    return file.absolute().as_uri() + "?mode=ro"


def _channels(connection: sqlite3.Connection) -> dict[int, Channel]:
    definitions: dict[str, tuple[str, str]] = {}
    if connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone():
        rows: list[Any] = connection.execute(
            "SELECT topic_type, encoded_message_definition, encoding FROM message_definitions"
        ).fetchall()
        definitions = {type_name(str(name)): (str(text or ""), str(encoding or "")) for name, text, encoding in rows}
    columns = {row[1] for row in connection.execute("PRAGMA table_info(topics)")}
    profiles = "offered_qos_profiles" if "offered_qos_profiles" in columns else "''"
    query = f"SELECT id, name, type, serialization_format, {profiles} FROM topics"
    return {
        identity: Channel(
            str(topic), type_name(str(kind)), *definitions.get(type_name(str(kind)), ("", "")), str(form or CDR),
            {"offered_qos_profiles": str(offered or "")},
        )
        for identity, topic, kind, form, offered in connection.execute(query)
    }  # fmt: skip
