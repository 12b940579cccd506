"""Bags of every kind, whole and cut off, come out as the same columns."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_typestore

from energy_monitor.bag import BagError, read_bag
from energy_monitor.bag_columns import Columns
from energy_monitor.bag_storage import Channel

Writer = Callable[..., Path]
CYCLES = 1500


@pytest.fixture(scope="module")
def file(ride_bag: Path) -> Path:
    return next(ride_bag.glob("*.mcap"))


def test_columns_hold_what_was_written(ride_bag: Path) -> None:
    bag = read_bag(ride_bag)
    rig = bag.table("test_rig_sim/state", "RigState")
    assert bag.complete and bag.storage == "mcap"
    assert len(rig) == CYCLES
    np.testing.assert_array_equal(rig["cycle"], np.arange(CYCLES))
    t = np.arange(CYCLES) * 0.002
    # Doubles are stored as they are: equal to the bit.
    np.testing.assert_array_equal(rig["f_tr"], 120.0 + 30.0 * np.sin(10.0 * np.pi * t))
    assert rig["last"].dtype == bool and rig["last"].sum() == 1
    assert rig["header.stamp.nanosec"][1] == 2_000_000
    assert np.all(np.diff(rig.log_time) == 1_000_000)


def test_sequences_of_changing_length(ride_bag: Path) -> None:
    shapes = read_bag(ride_bag).table("catenary_model/wire_shape", "WireShape")
    lengths = [len(entry) for entry in shapes.entries("dropper_x")]
    assert lengths[:4] == [18, 17, 18, 17]
    assert all(len(entry) == 121 for entry in shapes.entries("x"))
    assert shapes.entries("x")[-1][0] == -60.0
    assert [len(a) for a in shapes.entries("dropper_force")] == lengths


def test_strings(ride_bag: Path) -> None:
    model = read_bag(ride_bag).table("catenary_model/impedance_model", "ImpedanceModel")
    assert model.entries("description") == ["a test"]
    with pytest.raises(TypeError, match="entries"):
        model["description"]


def test_diagnostics_above_ok(ride_bag: Path) -> None:
    found = read_bag(ride_bag).diagnostics
    assert {entry.level for entry in found} == {1}
    assert found[0].message == "dE <b>differs</b> & more"
    assert found[0].values == {"late": "1"}


@pytest.mark.slow
def test_sqlite_gives_the_same(synthetic: Writer, ride_bag: Path, tmp_path: Path) -> None:
    ours, theirs = read_bag(synthetic(tmp_path / "bag", sqlite=True)), read_bag(ride_bag)
    assert ours.storage == "sqlite3" and ours.complete
    assert ours.tables.keys() == theirs.tables.keys()
    for topic, table in theirs.tables.items():
        for name, column in table.columns.items():
            if isinstance(column, np.ndarray):
                np.testing.assert_array_equal(ours.tables[topic].columns[name], column)


def test_bare_file_and_folder_above(file: Path, ride_bag: Path, tmp_path: Path) -> None:
    assert len(read_bag(file).table("test_rig_sim/state", "RigState")) == CYCLES
    shutil.copytree(ride_bag, tmp_path / "bag")
    (tmp_path / "figures").mkdir()
    assert read_bag(tmp_path).path == tmp_path / "bag"


def test_compressed_file(file: Path, tmp_path: Path) -> None:
    packed = tmp_path / "ride.mcap.zstd"
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    assert len(read_bag(packed).table("test_rig_sim/state", "RigState")) == CYCLES


def test_big_endian_and_other_frame_ids() -> None:
    # Messages of other byte order or string length in between do not disturb the rest.
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "geometry_msgs/msg/PointStamped"
    definition, _ = store.generate_msgdef(kind, ros_version=2)
    stamp, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    point, whole = store.types["geometry_msgs/msg/Point"], store.types[kind]
    columns = Columns(Channel("/p", kind, definition, "ros2msg"), ("header.stamp.sec", "header.frame_id", "point.y"))
    frames = ["rig", "train", "", "rig"]
    for i in range(40):
        message = whole(header(stamp(i, 0), frames[i % 4]), point(0.0, 0.1 * i, 0.0))
        columns.add([bytes(store.serialize_cdr(message, kind, little_endian=i % 3 > 0))])
    found = columns.finish()
    np.testing.assert_array_equal(found["header.stamp.sec"], np.arange(40))
    np.testing.assert_array_equal(found["point.y"], 0.1 * np.arange(40))
    assert found["header.frame_id"] == frames * 10


def test_cut_compressed_chunk(synthetic: Writer, tmp_path: Path) -> None:
    file = next(synthetic(tmp_path / "bag", compressed=True).glob("*.mcap"))
    assert len(read_bag(file).table("test_rig_sim/state", "RigState")) == CYCLES
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    rig = read_bag(file).table("test_rig_sim/state", "RigState")
    np.testing.assert_array_equal(rig["cycle"], np.arange(len(rig)))
    assert 0 < len(rig) < CYCLES


@settings(max_examples=25, deadline=None)
@example(share=1e-6)
@given(share=st.floats(0.0, 1.0))
@pytest.mark.slow
def test_cut_anywhere_gives_the_beginning(share: float, file: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    # A file that is cut at any byte gives a gapless beginning of the ride, or says in one line that it is empty.
    data = file.read_bytes()
    size = int(share * (len(data) - 1))
    cut = tmp_path_factory.mktemp("cut") / "bag.mcap"
    cut.write_bytes(data[:size])
    if size < 8:
        with pytest.raises(BagError, match="empty"):
            read_bag(cut)
        return
    bag = read_bag(cut)
    assert not bag.complete
    rig = bag.find("test_rig_sim/state", "RigState")
    if rig is not None:
        np.testing.assert_array_equal(rig["cycle"], np.arange(len(rig)))
        assert len(rig) >= int(0.95 * share * CYCLES) - 15


def test_folder_without_metadata_is_read(file: Path, tmp_path: Path) -> None:
    shutil.copy(file, tmp_path / "a.mcap")
    assert len(read_bag(tmp_path).table("test_rig_sim/state", "RigState")) == CYCLES


def test_namespace(synthetic: Writer, tmp_path: Path) -> None:
    bag = read_bag(synthetic(tmp_path / "bag", cycles=60, namespace="/lab/left"))
    assert bag.table("test_rig_sim/state", "RigState").topic == "/lab/left/test_rig_sim/state"
    assert bag.diagnostics
    assert not read_bag(tmp_path / "bag", namespace="lab/right").tables
    assert read_bag(tmp_path / "bag", namespace="/lab/left/").tables


def test_missing_topic_is_named(synthetic: Writer, tmp_path: Path) -> None:
    bag = read_bag(synthetic(tmp_path / "bag", cycles=60, without=("impedance_mpc/command",)))
    with pytest.raises(
        BagError, match=r"no ImpedanceCommand in this bag .*impedance_mpc/command.*it has: .*RigState|/test_rig"
    ):
        bag.table("impedance_mpc/command", "ImpedanceCommand")


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no such file"), (b"", "empty|not a bag"), (b"hello, this is no bag at all", "not a")],
)
def test_what_is_no_bag(content: bytes | None, message: str, tmp_path: Path) -> None:
    for name in ("a.mcap", "a.db3", "a.txt"):
        path = tmp_path / name
        if content is not None:
            path.write_bytes(content)
        with pytest.raises(BagError, match=message) as caught:
            read_bag(path)
        assert "\n" not in str(caught.value)


def test_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no bag here"):
        read_bag(tmp_path)


def test_unknown_field(ride_bag: Path) -> None:
    with pytest.raises(BagError, match=r"RigState .*no field w_other"):
        read_bag(ride_bag, fields={"RigState": ("cycle", "w_other")})
