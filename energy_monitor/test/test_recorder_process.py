"""The recorder as a process of its own against a real publisher, on a ROS domain of its own."""

import signal
import subprocess
import sys
import time
from importlib.util import find_spec

import pytest
from mcap.stream_reader import StreamReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(find_spec("rclpy") is None, reason="rclpy is not installed"),
]

PUBLISHER = """
import time
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64, String

rclpy.init()
node = rclpy.create_node("publisher")
latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
once = node.create_publisher(String, "once", latched)
once.publish(String(data="here"))
count = node.create_publisher(Int64, "count", QoSProfile(depth=32))
view = node.create_publisher(Int64, "view", QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
number = 0
while True:
    count.publish(Int64(data=number))
    if number % 10 == 0:
        view.publish(Int64(data=number))
    number += 1
    time.sleep(0.001)
"""


def wait(condition, process, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.02)


def record(*arguments):
    return subprocess.Popen(
        [sys.executable, "-m", "energy_monitor.record", *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


@pytest.fixture
def publisher():
    # A new one each time: the middleware of one that lost a reader by SIGKILL takes seconds to serve the next reader.
    process = subprocess.Popen([sys.executable, "-c", PUBLISHER])
    yield process
    process.kill()
    process.wait()


def numbers(raw):
    """CDR of Int64: four bytes of encapsulation, eight of data."""
    return [int.from_bytes(data[4:12], "little") for data in raw]


def test_a_killed_recording_is_readable(publisher, tmp_path):
    bag, ready = tmp_path / "ride", tmp_path / "ready"
    recorder = record("--out", bag, "--topics", "count", "once", "--ready-file", ready)
    wait(ready.exists, recorder)
    wait(lambda: (bag / "ride.mcap").stat().st_size > 30_000, recorder)
    recorder.send_signal(signal.SIGKILL)
    recorder.communicate()
    assert not (bag / "metadata.yaml").exists()
    topics, raw = {}, {}
    try:
        for item in StreamReader((bag / "ride.mcap").open("rb")).records:
            if type(item).__name__ == "Channel":
                topics[item.id] = item.topic
            elif type(item).__name__ == "Message":
                raw.setdefault(topics[item.channel_id], []).append(item.data)
    except Exception:
        assert raw
    found = numbers(raw["/count"])
    assert len(found) > 100
    assert found == list(range(found[0], found[0] + len(found)))
    assert len(raw["/once"]) == 1


def test_a_recording_that_is_asked_to_end_is_whole(publisher, tmp_path):
    bag, ready = tmp_path / "ride", tmp_path / "ready"
    recorder = record("--out", bag, "--all", "--expect-topics", "count", "view", "--ready-file", ready)
    wait(ready.exists, recorder)
    assert {"/count", "/once", "/view"} <= set(ready.read_text().split())
    time.sleep(0.5)
    # The ride ends first, so the recorder has to wait for silence only.
    publisher.send_signal(signal.SIGSTOP)
    try:
        recorder.send_signal(signal.SIGINT)
        text, _ = recorder.communicate(timeout=20)
    finally:
        publisher.send_signal(signal.SIGCONT)
    assert recorder.returncode == 0, text
    assert "/count  [std_msgs/msg/Int64]" in text
    with Reader(bag) as reader:
        by_topic = {connection.topic: connection for connection in reader.connections}
        found = numbers(data for _, _, data in reader.messages([by_topic["/count"]]))
        assert len(found) > 200
        assert found == list(range(found[0], found[0] + len(found)))
        assert by_topic["/once"].msgcount == 1
        assert by_topic["/once"].ext.offered_qos_profiles[0].durability is QosDurability.TRANSIENT_LOCAL
        assert by_topic["/view"].ext.offered_qos_profiles[0].reliability is QosReliability.BEST_EFFORT
        assert by_topic["/view"].msgcount > 10
        assert "int64 data" in by_topic["/count"].msgdef.data


def test_a_recording_of_nothing_ends_when_asked(tmp_path):
    bag = tmp_path / "ride"
    recorder = record("--out", bag, "--topics", "nobody", "--ready-file", tmp_path / "ready")
    wait(bag.exists, recorder)
    recorder.send_signal(signal.SIGTERM)
    text, _ = recorder.communicate(timeout=20)
    assert recorder.returncode == 0, text
    assert "/nobody  never published" in text
    assert not (tmp_path / "ready").exists()
    with Reader(bag) as reader:
        assert reader.connections == []


def test_a_recording_ends_after_its_duration_and_never_overwrites(publisher, tmp_path):
    bag = tmp_path / "ride"
    recorder = record("--out", bag, "--topics", "count", "--duration", "1.0")
    text, _ = recorder.communicate(timeout=20)
    assert recorder.returncode == 0, text
    with Reader(bag) as reader:
        assert reader.message_count > 100
    again = record("--out", bag)
    text, _ = again.communicate(timeout=20)
    assert again.returncode == 2
    assert "exists already" in text


def test_lost_messages_end_with_code_1_and_a_line(tmp_path):
    # The middleware loses nothing at will: what it would report is put in where the recording would run.
    code = f"""
import sys
from energy_monitor import record
from energy_monitor.definitions import Definition
from energy_monitor.recorder import Channel

def lossy(node, recorder, *rest):
    recorder.channels += [Channel("/a", "t", Definition("", ""), lost=3), Channel("/b", "t", Definition("", ""))]

record._record = lossy
sys.exit(record.main(["--out", {str(tmp_path / "ride")!r}]))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=30)
    assert done.returncode == 1, done.stderr
    assert done.stderr.splitlines()[-1] == "record: 3 messages were lost, the bag has gaps: /a 3"
