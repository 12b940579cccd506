"""The writing half of a recording: a queue, a thread, and an MCAP file that survives the end of its writer.

The callback of a subscription only appends to the queue. The thread writes and closes the file's chunk several times a
second, so that a recording that is killed is readable up to its last chunk, without metadata and without a summary.
"""

from __future__ import annotations

import errno
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryFile
from time import monotonic, time_ns
from types import MappingProxyType
from typing import Any

from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter, Schema, write_schema

from energy_monitor.definitions import Definition

FLUSH_PERIOD = 0.25
"""s, at most this much of a ride is lost when the recorder is killed."""
POLL_PERIOD = 0.02
"""s between two looks at the queue; short enough to keep it small, long enough to cost nothing."""


_SIZE = struct.Struct("<I")

NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What the operating system says of a full disk, a quota that is used up, and a limit of the size of files."""


class ChunkIndex:
    """What is to stand of each chunk at the end of the file, until then in a file without a name.

    In memory it would grow by some 2 MB in an hour. It goes with the process, however that ends.
    """

    def __init__(self, folder: Path) -> None:
        """Begin an empty index; its file takes room on the disk of ``folder``."""
        self._file = TemporaryFile(dir=folder)  # noqa: SIM115 - open for as long as the bag
        self._count = 0

    def __len__(self) -> int:
        """Count the chunks."""
        return self._count

    def __iter__(self) -> Iterator[BytesIO]:
        """Give the records in their order, each ready to be written."""
        self._file.seek(0)
        for _ in range(self._count):
            (size,) = _SIZE.unpack(self._file.read(_SIZE.size))
            record = BytesIO()
            record.write(self._file.read(size))
            yield record

    def append(self, record: BytesIO) -> None:
        """Add the record of a chunk."""
        self._file.write(_SIZE.pack(record.tell()))
        self._file.write(record.getbuffer())
        self._count += 1

    def close(self) -> None:
        """Drop all."""
        self._file.close()


class SteadyMcap(McapWriter):
    """MCAP storage whose chunk can be closed before it is full, and whose memory does not grow with the bag."""

    def __init__(self, path: Path, compression: CompressionMode) -> None:
        """Create the file."""
        super().__init__(path, compression)
        self.chunks: ChunkIndex = ChunkIndex(path)  # type: ignore[assignment]

    def close(self, version: int, metadata: str) -> None:
        """Write the index and close the file."""
        super().close(version, metadata)
        self.chunks.close()

    def abort(self) -> None:
        """Close the file without an index."""
        with suppress(OSError):  # what is still in its buffer, on a full disk
            self.chunks.close()
        super().abort()

    def add_msgtype(self, connection: Connection) -> None:
        """Add a type; without a definition it has an empty schema, which readers pass over and an empty text is not."""
        if connection.msgdef.data:
            super().add_msgtype(connection)
            return
        self.schemas.append(Schema(len(self.schemas) + 1, connection.msgtype, "", ""))
        write_schema(self.chunk.bio, self.schemas[-1])

    def sync(self) -> None:
        """Hand everything that was written to the operating system."""
        if self.chunk.msgs:
            self.close_chunk()
        self.bio.flush()


class SteadyWriter(Writer):
    """Bag writer that can be told to leave a readable file behind at any time."""

    STORAGE_PLUGINS: Mapping[StoragePlugin, Any] = MappingProxyType({StoragePlugin.MCAP: SteadyMcap})

    def sync(self) -> None:
        """Close the chunk and flush the file."""
        if isinstance(self.storage, SteadyMcap):
            self.storage.sync()


@dataclass
class Channel:
    """A recorded topic and what came of it.

    ``lost`` counts the gaps in the numbers of its messages, ``counted`` is false if at times they told nothing.
    """

    topic: str
    kind: str
    definition: Definition
    offered: Sequence[Qos] = ()
    messages: int = 0
    bytes: int = 0
    lost: int = 0
    counted: bool = True
    connection: Connection | None = field(default=None, repr=False)


class BagSink:
    """Writes raw messages of any number of topics into a bag from a thread of its own."""

    def __init__(self, path: Path) -> None:
        """Create the bag's folder ``path``, which must not exist yet, and start writing.

        Raises
        ------
        rosbags.rosbag2.WriterError
            The folder exists.
        """
        self.path = path
        self.error: BaseException | None = None
        self.received = 0
        """Messages that came, written or still in the queue."""
        self._last = 0
        self._unsynced = False
        self._queue: deque[tuple[Channel, int, bytes | None]] = deque()
        self._ending = threading.Event()
        self._closing = threading.Lock()
        self._closed = False
        self._writer = SteadyWriter(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._thread = threading.Thread(target=self._work, name="bag", daemon=True)
        self._thread.start()

    def add(self, channel: Channel) -> Callable[[bytes], None]:
        """Enter a topic into the bag; gives the function that takes its raw messages (CDR)."""
        self._queue.append((channel, 0, None))
        append, now = self._queue.append, time_ns

        def take(data: bytes) -> None:
            self.received += 1
            append((channel, now(), data))

        return take

    def close(self) -> None:
        """Write what is in the queue, close the bag with index and metadata; once, whichever thread calls it.

        Raises
        ------
        OSError
            Writing failed, now or earlier; the bag holds what was written before.
        """
        with self._closing:
            if not self._closed:
                self._close()
                self._closed = True
        if self.error is not None:
            raise OSError(getattr(self.error, "errno", None), f"{self.path}: {self.error}") from self.error

    def _close(self) -> None:
        self._ending.set()
        self._thread.join()
        if self.error is None:
            try:
                self._writer.close()
            except Exception as error:
                self.error = error
        if self.error is None:
            return
        with suppress(OSError):  # closing writes what is still in its buffer
            self._writer.abort()
        with suppress(OSError):  # empty or half a file: worse than none
            self._writer.metapath.with_suffix(".yaml.tmp").unlink(missing_ok=True)

    def _work(self) -> None:
        flushed = monotonic()
        try:
            while True:
                ending = self._ending.wait(POLL_PERIOD)
                dirty = self._write_queue()
                now = monotonic()
                if ending:
                    self._writer.sync()
                    return
                if dirty and now - flushed >= FLUSH_PERIOD:
                    self._writer.sync()
                    self._unsynced = False
                    flushed = now
        except Exception as error:
            self.error = error

    def _write_queue(self) -> bool:
        """Write all that is in the queue now; tell whether anything is written but not yet flushed."""
        queue, write = self._queue, self._writer.write
        for _ in range(len(queue)):
            channel, stamp, data = queue.popleft()
            if data is None or channel.connection is None:
                channel.connection = self._connect(channel)
            if data is None:
                continue
            # The wall clock may be set back during a ride; a bag without an index must still be in order.
            self._last = stamp = max(self._last, stamp)
            write(channel.connection, stamp, data)
            channel.messages += 1
            channel.bytes += len(data)
            self._unsynced = True
        return self._unsynced

    def _connect(self, channel: Channel) -> Connection:
        return self._writer.add_connection(
            channel.topic,
            channel.kind,
            msgdef=channel.definition.text,
            rihs01=channel.definition.digest,
            offered_qos_profiles=channel.offered,
        )
