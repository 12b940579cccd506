"""The writing half of the recorder, without ROS."""

import ctypes
import subprocess
import sys
import time
import tracemalloc

import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader, StoragePlugin, WriterError

from energy_monitor.definitions import Definition, definition_of, references
from energy_monitor.recorder import BagSink, Channel, SteadyWriter

HEADER = "std_msgs/msg/Header"


def messages_in(file):
    """Read whatever can be read, as far as it goes."""
    found = []
    try:
        found.extend(
            bytes(record.data) for record in StreamReader(file.open("rb")).records if type(record).__name__ == "Message"
        )
    except Exception as error:
        assert found, error
    return found


def test_what_goes_in_comes_out_in_order(tmp_path):
    sink = BagSink(tmp_path / "ride")
    channels = [Channel(f"/t{i}", HEADER, definition_of(HEADER)) for i in range(3)]
    takes = [sink.add(channel) for channel in channels]
    for k in range(3000):
        takes[k % 3](k.to_bytes(8, "little"))
    sink.close()
    assert sink.received == 3000
    assert [channel.messages for channel in channels] == [1000, 1000, 1000]
    with Reader(tmp_path / "ride") as reader:
        got = list(reader.messages())
        assert [int.from_bytes(data, "little") for _, _, data in got] == list(range(3000))
        stamps = [stamp for _, stamp, _ in got]
        assert stamps == sorted(stamps)
        assert reader.connections[0].digest == definition_of(HEADER).digest


def test_the_file_can_be_read_before_it_is_closed(tmp_path):
    # What a killed recorder leaves behind is the file as it is now: no summary, no metadata.
    sink = BagSink(tmp_path / "ride")
    take = sink.add(Channel("/t", HEADER, definition_of(HEADER)))
    deadline = time.monotonic() + 10.0
    sent, file = 0, tmp_path / "ride" / "ride.mcap"
    while file.stat().st_size < 1000:
        take(sent.to_bytes(8, "little"))
        sent += 1
        time.sleep(0.005)
        assert time.monotonic() < deadline, "nothing was flushed"
    assert not (tmp_path / "ride" / "metadata.yaml").exists()
    found = [int.from_bytes(data, "little") for data in messages_in(file)]
    assert found == list(range(len(found)))
    assert found
    sink.close()
    assert len(messages_in(file)) == sent


@pytest.mark.slow
def test_the_index_of_many_chunks_is_whole_and_takes_no_memory(tmp_path):
    writer = SteadyWriter(tmp_path / "ride", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.open()
    definition = definition_of(HEADER)
    connection = writer.add_connection("/t", HEADER, msgdef=definition.text, rihs01=definition.digest)
    tracemalloc.start()
    for k in range(3000):
        writer.write(connection, k, k.to_bytes(8, "little"))
        writer.sync()
        if k == 100:
            before = tracemalloc.get_traced_memory()[0]
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert grown < 20_000  # bytes, of 2900 chunks
    writer.close()
    assert sorted(file.name for file in (tmp_path / "ride").iterdir()) == ["metadata.yaml", "ride.mcap"]
    with (tmp_path / "ride" / "ride.mcap").open("rb") as stream:
        index = make_reader(stream).get_summary().chunk_indexes
    assert [chunk.message_start_time for chunk in index] == list(range(3000))
    with Reader(tmp_path / "ride") as reader:  # by the index
        assert [int.from_bytes(data, "little") for _, _, data in reader.messages()] == list(range(3000))


def test_topics_without_messages_are_in_the_bag(tmp_path):
    sink = BagSink(tmp_path / "ride")
    sink.add(Channel("/silent", HEADER, definition_of(HEADER)))
    sink.close()
    with Reader(tmp_path / "ride") as reader:
        assert [(c.topic, c.msgcount) for c in reader.connections] == [("/silent", 0)]


def test_a_bag_is_never_overwritten(tmp_path):
    with pytest.raises(WriterError, match="exists already"):
        BagSink(tmp_path)


def test_a_failure_of_the_writer_is_reported_and_keeps_the_bag(tmp_path):
    sink = BagSink(tmp_path / "ride")
    take = sink.add(Channel("/t", HEADER, definition_of(HEADER)))
    take(b"good")
    sink.add(Channel("/bad", HEADER, Definition("text", "")))  # no hash: the writer refuses it
    with pytest.raises(OSError, match="ride"):
        sink.close()
    assert sink.error is not None


def test_definitions_carry_every_part():
    found = definition_of(HEADER)
    assert found.digest.startswith("RIHS01_")
    assert "string frame_id" in found.text
    assert "MSG: builtin_interfaces/Time" in found.text
    assert found.text.count("=" * 80) == 1


def test_an_unknown_type_keeps_the_hash_of_its_publisher():
    found = definition_of("nobody/msg/Nothing", "RIHS01_abc")
    assert (found.text, found.digest) == ("", "RIHS01_abc")


def test_references_of_a_definition():
    text = """
# geometry_msgs/Pose in a comment
std_msgs/Header header
Header old            # the short form
float64[] a
string<=5 name "has a # sign"
uint8 RED = 1
Point[3] corners
geometry_msgs/Twist[<=4] twists
char c
"""
    assert list(references(text, "mine")) == [
        "std_msgs/msg/Header",
        "std_msgs/msg/Header",
        "mine/msg/Point",
        "geometry_msgs/msg/Twist",
    ]


HEAP = """
import ctypes, threading
from phil_base.memory import lean_heap

class Info(ctypes.Structure):  # mallinfo2(3)
    _fields_ = [(name, ctypes.c_size_t) for name in
                "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost".split()]

c = ctypes.CDLL(None)
c.mallinfo2.restype, c.malloc.restype, c.malloc.argtypes = Info, ctypes.c_void_p, [ctypes.c_size_t]
c.free.argtypes = [ctypes.c_void_p]
{call}
c.free(c.malloc(20 << 20))  # by its own rule glibc takes blocks up to that size from the heap from now on
before = c.mallinfo2().hblks
c.malloc(200 << 10)
mapped = c.mallinfo2().hblks - before
found = []
def elsewhere():
    found.append(c.malloc(1000))
thread = threading.Thread(target=elsewhere)
thread.start()
thread.join()
heap = [line.split()[0].split("-") for line in open("/proc/self/maps") if "[heap]" in line]
print(mapped, any(int(low, 16) <= found[0] < int(high, 16) for low, high in heap))
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallinfo2"), reason="the C library tells nothing of its heap")
def test_large_pieces_are_mapped_one_by_one_and_threads_share_one_heap():
    lines = [
        subprocess.run(
            [sys.executable, "-c", HEAP.replace("{call}", call)], capture_output=True, text=True, check=True
        ).stdout.split()
        for call in ("lean_heap()", "")
    ]
    assert lines == [["1", "True"], ["0", "False"]]
