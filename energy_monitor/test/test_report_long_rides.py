"""What is done to rides too long to be drawn or kept as they are: the picture stays, memory does not grow."""

import mmap

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from energy_monitor import bag_mcap
from energy_monitor.bag import Table
from energy_monitor.bag_channel import BATCH, Channel, Source
from energy_monitor.bag_columns import Columns
from energy_monitor.bag_storage import file_batches
from energy_monitor.recorder import SteadyWriter, StoragePlugin
from energy_monitor.report.outline import highest, lowest, outline, pieces

STORE = get_typestore(Stores.ROS2_JAZZY)


@given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=200), st.integers(1, 50))
def test_an_outline_holds_the_extremes_of_every_piece_and_no_more(values, most):
    values = np.array(values)
    time = np.arange(len(values), dtype=float)
    size = pieces(len(values), most)
    at, line = outline(time, values, size)
    assert len(at) == len(line) and set(line) <= set(values) and (np.diff(at) >= 0.0).all()
    assert len(lowest(values, size)) == len(highest(values, size)) == len(time[::size]) <= most
    for number, begin in enumerate(range(0, len(values), size)):
        piece = values[begin : begin + size]
        assert (lowest(values, size)[number], highest(values, size)[number]) == (piece.min(), piece.max())


def test_a_short_series_is_drawn_as_it_is():
    time, values = np.arange(1000.0), np.arange(1000.0)
    assert outline(time, values, pieces(1000))[1] is values


@pytest.mark.parametrize("count, stride", [(10, 1), (11, 2), (20, 2), (21, 4), (100, 16)])
def test_fields_that_are_only_drawn_are_thinned_evenly(monkeypatch, count, stride):
    monkeypatch.setattr(Columns, "THIN", 10)
    monkeypatch.setattr(Columns, "BATCH", 7)
    shapes = Columns(
        Channel("/w", "t/msg/W", "float64[] x\nfloat64[] masts\n", "ros2msg"), ("x", "masts"), None, ("x",)
    )
    for i in range(count):
        shapes.add([_two_lists([i, 0.5], [i, 1.5, 2.5])])
    found = shapes.finish()
    assert [entry.tolist() for entry in found["masts"]] == [[i, 1.5, 2.5] for i in range(count)]
    assert [entry.tolist() for entry in found["x"]] == [[] if i % stride else [i, 0.5] for i in range(count)]


def _two_lists(*lists):
    """Lay lists of doubles out as CDR does: length, filling to 8 bytes, values."""
    body = b""
    for values in lists:
        body += len(values).to_bytes(4, "little")
        body += bytes(-len(body) % 8) + np.array(values, "<f8").tobytes()
    return b"\0\1\0\0" + body


def test_rows_that_follow_each_other_are_views_and_others_are_not():
    table = Table("/t", "T", np.arange(10), {"cycle": np.arange(10), "text": list("abcdefghij")})
    run, apart = table.take(np.arange(2, 8)), table.take(np.array([1, 3, 5]))
    assert np.shares_memory(run["cycle"], table["cycle"]) and run.entries("text") == list("cdefgh")
    assert not np.shares_memory(apart["cycle"], table["cycle"]) and apart["cycle"].tolist() == [1, 3, 5]
    assert len(table.take(np.zeros(10, bool))) == 0


def test_pages_that_were_read_are_given_back_and_all_messages_come(tmp_path, monkeypatch):
    monkeypatch.setattr(bag_mcap, "_RELEASED", 1 << 14)
    writer = SteadyWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    writer.open()
    connection = writer.add_connection("/t", "std_msgs/msg/Header", typestore=STORE)
    count = 2 * BATCH + 11  # batches that are full, and one that is not
    for k in range(count):
        writer.write(connection, k, b"\0\1\0\0" + k.to_bytes(8, "little") * 10)
        if k % 100 == 0:
            writer.sync()
    writer.close()
    given_back = []

    class Spied(mmap.mmap):
        def madvise(self, advice, start, length):
            given_back.append((start, length))
            super().madvise(advice, start, length)

    monkeypatch.setattr(mmap, "mmap", Spied)
    file = tmp_path / "bag" / "bag.mcap"
    found = [record for batch in file_batches(Source(file, (file,), "mcap"), file, lambda _: True) for record in batch]
    assert [int.from_bytes(data[4:12], "little") for _, _, data in found] == list(range(count))
    assert [at for _, at, _ in found] == list(range(count))
    ends = [0, *(start + length for start, length in given_back)]
    assert [start for start, _ in given_back] == ends[:-1] and ends[-1] > file.stat().st_size // 2
