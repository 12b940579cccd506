"""A recorder whose main thread hangs in a library ends when it is asked to, and the bag is there."""

import signal
import subprocess
import sys
import time
from importlib.util import find_spec

import pytest
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(find_spec("rclpy") is None, reason="rclpy is not installed"),
]

HANGING = """
import ctypes, sys, time
from pathlib import Path
from energy_monitor import record, watch
from energy_monitor.definitions import definition_of
from energy_monitor.recorder import Channel

watch.PATIENCE, watch.LAST = 0.5, 1.5
out, hold, where = Path(sys.argv[1]), sys.argv[2] == "hold", sys.argv[3]

def hang(*rest):
    # A library that waits for ever, with the interpreter's lock or without it.
    library = (ctypes.PyDLL if hold else ctypes.CDLL)(None)
    out.with_suffix(".hangs").touch()
    while True:
        library.sleep(1000)

def receive(node, recorder, sink, *rest):
    channel = Channel("/t", "std_msgs/msg/Header", definition_of("std_msgs/msg/Header"))
    recorder.channels.append(channel)
    take = sink.add(channel)
    for number in range(1000):
        take(number.to_bytes(16, "little"))
    time.sleep(0.6)  # twice as long as it takes to be written down
    if where == "taking":
        hang()
    node.destroy_node = hang

record._record = receive
sys.exit(record.main(["--out", str(out)]))
"""


def hang(tmp_path, *how):
    bag = tmp_path / "bag"
    process = subprocess.Popen(
        [sys.executable, "-c", HANGING, str(bag), *how],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    deadline = time.monotonic() + 20.0
    while not bag.with_suffix(".hangs").exists():
        assert process.poll() is None and time.monotonic() < deadline, process.communicate(timeout=1.0)
        time.sleep(0.02)
    began = time.monotonic()
    process.send_signal(signal.SIGTERM)
    text, _ = process.communicate(timeout=20.0)
    assert time.monotonic() - began < 8.0
    return bag, process.returncode, text


def test_one_that_hangs_in_a_library_closes_its_bag(tmp_path):
    bag, code, text = hang(tmp_path, "release", "taking")
    assert code == 1 and "receiving hangs" in text, text
    with Reader(bag) as reader:
        assert reader.message_count == 1000


def test_one_that_hangs_with_the_interpreter_s_lock_is_killed_and_what_was_written_stays(tmp_path):
    bag, code, text = hang(tmp_path, "hold", "taking")
    assert code == -signal.SIGKILL and "hangs: killed" in text, text
    found = []
    try:
        records = StreamReader((bag / "bag.mcap").open("rb")).records
        found.extend(record for record in records if type(record).__name__ == "Message")
    except Exception:
        assert found  # the file has no end
    assert len(found) == 1000 and not (bag / "metadata.yaml").exists()


def test_one_that_hangs_after_its_bag_is_closed_has_done_well(tmp_path):
    bag, code, text = hang(tmp_path, "release", "leaving")
    assert code == 0 and "1000 messages" in text, text
    with Reader(bag) as reader:
        assert reader.message_count == 1000
