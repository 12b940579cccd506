"""Bags of several files and in odd shapes give the numbers of the plain one, or one line that says what to do."""

from __future__ import annotations

import gzip
import os
import shutil
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from bag_variants import RIG, Row, rows_of, with_cycle, write_mcap, write_rows, write_split
from mcap.writer import CompressionType

from energy_monitor.bag import Bag, BagError, read_bag
from energy_monitor.report.alignment import align
from energy_monitor.report.write import default_folder

CYCLES = 160


@pytest.fixture(scope="module")
def rows(synthetic: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    return rows_of(synthetic(tmp_path_factory.mktemp("small") / "bag", cycles=CYCLES))


def parts(rows: list[Row], count: int) -> list[list[Row]]:
    return [rows[i * len(rows) // count : (i + 1) * len(rows) // count] for i in range(count)]


def whole(path: Path) -> Bag:
    """Read a bag and check that nothing of the ride is missing, out of order or remarked upon."""
    before = {name: os.stat(name) for name in path.parent.rglob("*")}
    bag = read_bag(path)
    after = {name: os.stat(name) for name in path.parent.rglob("*")}
    assert {name: stat.st_mtime_ns for name, stat in before.items()} == {n: s.st_mtime_ns for n, s in after.items()}
    for topic in (RIG, "/catenary_model/state", "/impedance_mpc/command"):
        np.testing.assert_array_equal(bag.tables[topic]["cycle"], np.arange(CYCLES))
    return bag


NAMES = {
    "rosbag2": [f"bag_{i}.mcap" for i in range(12)],
    "newer rosbag2": [f"{i}_bag_2026_01_01-12_00_{i:02d}.mcap" for i in range(12)],
    "against the order": [f"{'zyxwvutsrqpo'[i]}.mcap" for i in range(12)],
    "capitals": [f"BAG_{i}.MCAP" for i in range(3)],
}


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
def test_files_without_metadata_are_read_in_the_order_of_time(
    names: list[str], rows: list[Row], tmp_path: Path
) -> None:
    bag = whole(write_split(tmp_path / "bag", parts(rows, len(names)), names))
    assert bag.complete and not bag.notes and not len(bag.rides_of_files) > 1


METADATA = {
    "reversed": ["bag_2.mcap", "bag_1.mcap", "bag_0.mcap"],
    "absolute": ["/data/x/bag_0.mcap", "/data/x/bag_1.mcap", "/data/x/bag_2.mcap"],
    "with folder": ["bag/bag_0.mcap", "bag/bag_1.mcap", "bag/bag_2.mcap"],
    "of Windows": ["C:\\bag\\bag_0.mcap", "C:\\bag\\bag_1.mcap", "C:\\bag\\bag_2.mcap"],
    "renamed": ["x_0.mcap", "x_1.mcap", "x_2.mcap"],
    "one is not listed": ["bag_0.mcap", "bag_2.mcap"],
}


@pytest.mark.parametrize("listed", METADATA.values(), ids=METADATA)
def test_what_metadata_says_of_files(listed: list[str], rows: list[Row], tmp_path: Path) -> None:
    bag = whole(write_split(tmp_path / "bag", parts(rows, 3), [f"bag_{i}.mcap" for i in range(3)], listed))
    assert bag.complete and not bag.notes


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a: [",
        "[]",
        "rosbag2_bagfile_information: 3",
        "rosbag2_bagfile_information: {relative_file_paths: bag_0.mcap}",
        "\x00\xff",
    ],
)
def test_metadata_that_makes_no_sense_is_as_good_as_none(text: str, rows: list[Row], tmp_path: Path) -> None:
    write_split(tmp_path / "bag", parts(rows, 3), [f"bag_{i}.mcap" for i in range(3)])
    (tmp_path / "bag" / "metadata.yaml").write_bytes(text.encode("latin-1"))
    assert whole(tmp_path / "bag").complete


def test_files_that_are_missing_or_empty_are_named(rows: list[Row], tmp_path: Path) -> None:
    names = [f"bag_{i}.mcap" for i in range(3)]
    write_split(tmp_path / "bag", parts(rows, 3), names, names)
    (tmp_path / "bag" / "bag_1.mcap").unlink()
    bag = read_bag(tmp_path / "bag")
    assert not bag.complete and any("bag_1.mcap" in note and "not there" in note for note in bag.notes)
    assert align(bag).missing
    (tmp_path / "bag" / "bag_1.mcap").write_bytes(b"")
    (tmp_path / "bag" / "._bag_0.mcap").write_bytes(b"Mac OS X")
    bag = read_bag(tmp_path / "bag")
    assert not bag.complete and bag.notes == ["bag_1.mcap is empty: nothing was recorded in it."]


def test_a_file_in_the_middle_that_is_cut_off_is_named(rows: list[Row], tmp_path: Path) -> None:
    names = [f"bag_{i}.mcap" for i in range(3)]
    write_split(tmp_path / "bag", parts(rows, 3), names)
    file = tmp_path / "bag" / "bag_1.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    bag = read_bag(tmp_path / "bag")
    assert not bag.complete and "bag_1.mcap has no end" in bag.notes[0]
    assert "scripts/record.sh --recover" in bag.notes[0]
    assert bag.tables[RIG]["cycle"][-1] == CYCLES - 1


def test_messages_out_of_the_order_of_time_are_sorted(rows: list[Row], tmp_path: Path) -> None:
    late = list(rows)
    late.insert(len(rows) - 5, late.pop(200))
    whole(write_rows(tmp_path / "late", late))
    whole(write_mcap(tmp_path / "backwards.mcap", rows[::-1]))


@pytest.mark.parametrize("step", [-3600, 3600])
def test_a_wall_clock_that_jumps_does_not_disturb_the_order(step: int, rows: list[Row], tmp_path: Path) -> None:
    half = len(rows) // 2
    jumped = [(c, t + (step * 10**9 if i >= half else 0), d) for i, (c, t, d) in enumerate(rows)]
    aligned = align(whole(write_rows(tmp_path / "bag", jumped)))
    assert len(aligned.cycle) == CYCLES and aligned.ended


PACKED: dict[str, Callable[[bytes], bytes]] = {
    ".zstd": zstandard.compress,
    ".zst": lambda data: zstandard.compress(data[:9999]) + zstandard.compress(data[9999:]),
    ".lz4": lz4.frame.compress,
    ".gz": gzip.compress,
}


@pytest.mark.parametrize(("suffix", "sqlite"), [*((suffix, False) for suffix in PACKED), (".zstd", True)])
def test_compressed_files(suffix: str, sqlite: bool, rows: list[Row], tmp_path: Path) -> None:
    plain = next(write_rows(tmp_path / "plain", rows, sqlite=sqlite).glob("plain.*"))
    packed = tmp_path / "packed" / (plain.name + suffix)
    packed.parent.mkdir()
    packed.write_bytes(PACKED[suffix](plain.read_bytes()))
    assert whole(packed).storage == ("sqlite3" if sqlite else "mcap")
    shutil.copy(plain, packed.parent)  # decompressed beside it: one of them is taken
    assert len(whole(packed.parent).tables[RIG]) == CYCLES


@pytest.mark.parametrize("compression", list(CompressionType))
def test_compressed_chunks(compression: CompressionType, rows: list[Row], tmp_path: Path) -> None:
    whole(write_mcap(tmp_path / "a.mcap", rows, compression=compression))


def test_compressed_messages_need_no_metadata_to_be_known(rows: list[Row], tmp_path: Path) -> None:
    for sqlite in (False, True):
        bag = write_rows(tmp_path / f"bag{sqlite}", rows, sqlite=sqlite, compression="MESSAGE")
        whole(bag)
        (bag / "metadata.yaml").unlink()
        whole(bag)


@pytest.mark.parametrize("name", ["take#2", "what?", "50%20kmh", "a b;c&d", "Fahrt_ü", "%"])
def test_characters_of_a_path(name: str, rows: list[Row], tmp_path: Path) -> None:
    # Not written there: rosbags' own writer takes what follows the # for something else.
    shutil.copytree(write_rows(tmp_path / "plain", rows, sqlite=True), tmp_path / "above" / name)
    whole(tmp_path / "above" / name)


def test_what_a_crash_left_beside_sqlite_is_read_and_not_touched(rows: list[Row], tmp_path: Path) -> None:
    bag = write_rows(tmp_path / "bag", rows, sqlite=True)
    (bag / "metadata.yaml").unlink()
    file, copy = bag / "bag.db3", tmp_path / "crashed"
    copy.mkdir()
    with closing(sqlite3.connect(file)) as connection:
        last = connection.execute("SELECT * FROM messages ORDER BY id DESC LIMIT 400").fetchall()
        connection.execute("DELETE FROM messages WHERE id >= ?", (last[-1][0],))
        connection.commit()
        connection.execute("PRAGMA journal_mode=WAL")
        connection.executemany("INSERT INTO messages VALUES (?, ?, ?, ?)", last)
        connection.commit()
        for name in ("bag.db3", "bag.db3-wal"):
            shutil.copy(bag / name, copy)
    found = whole(copy)
    assert not found.complete
    assert sorted(entry.name for entry in copy.iterdir()) == ["bag.db3", "bag.db3-wal"]
    done = write_rows(tmp_path / "done", rows, sqlite=True)
    (done / "done.db3-journal").write_bytes(bytes(512))  # what journal_mode=PERSIST leaves of a log that is done with
    assert whole(done).complete


def test_a_folder_of_rides_and_what_has_to_be_unpacked_are_named(rows: list[Row], tmp_path: Path) -> None:
    for ride in ("ride_2", "ride_10"):
        (tmp_path / ride).mkdir()
        write_rows(tmp_path / ride / "bag", rows[:50])
    with pytest.raises(BagError, match=r"several bags \(ride_2/bag, ride_10/bag\), name one"):
        read_bag(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "ride.zip").write_bytes(b"PK\3\4")
    with pytest.raises(BagError, match=r"no bag here .*ride\.zip has to be unpacked"):
        read_bag(tmp_path / "empty")
    for magic, word in (
        (b"PK\3\4", "zip"),
        (b"BZh9", "bunzip2"),
        (b"\xfd7zXZ\0", "unxz"),
        (b"#ROSBAG V2.0\n", "ROS 1"),
    ):
        (tmp_path / "a.mcap").write_bytes(magic + bytes(100))
        with pytest.raises(BagError, match=word):
            read_bag(tmp_path / "a.mcap")


def test_files_of_two_rides_are_named_and_one_can_be_chosen(
    synthetic: Callable[..., Path], rows: list[Row], tmp_path: Path
) -> None:
    other = [(c, t + 10**12, d) for c, t, d in rows if t - rows[0][1] < 100 * 10**6]
    write_split(tmp_path / "bag", [*parts(rows, 2), other], ["a_0.mcap", "a_1.mcap", "b.mcap"])
    bag = read_bag(tmp_path / "bag")
    with pytest.raises(BagError, match=r"several rides: a_0\.mcap, a_1\.mcap \(cycles 0 to 159\); b\.mcap .*--ride N"):
        align(bag)
    assert len(align(bag, ride=1).cycle) == CYCLES
    assert len(align(bag, ride=2).cycle) == 100
    with pytest.raises(BagError, match=r"no ride 3 .*1: cycles 0 to 159, 2: cycles 0 to 99"):
        align(bag, ride=3)


def test_files_that_were_put_one_behind_the_other_are_read_to_the_end(rows: list[Row], tmp_path: Path) -> None:
    for index, part in enumerate(parts(rows, 2)):
        write_mcap(tmp_path / f"{index}.mcap", part)
    together = tmp_path / "bag" / "both.mcap"
    together.parent.mkdir()
    together.write_bytes(b"".join((tmp_path / f"{index}.mcap").read_bytes() for index in range(2)))
    assert not whole(together).notes


def test_messages_that_came_twice_are_counted_and_say_if_they_differ(rows: list[Row], tmp_path: Path) -> None:
    own = [row for row in rows if row[0].topic == RIG]
    again = [(own[50][0], own[50][1] + 1000, own[50][2])] * 3
    other = (own[0][0], own[0][1] - 2 * 10**9, with_cycle(own[9][2], 0))  # left from before the ride
    plain, mixed = (align(read_bag(write_mcap(tmp_path / f"{len(r)}.mcap", r))) for r in (rows, [other, *rows, *again]))
    for name in ("w_tr", "f_tr", "f_raw"):
        np.testing.assert_array_equal(mixed.rig[name], plain.rig[name])
    assert not plain.notes
    assert mixed.notes == [
        f"3 messages on {RIG} are left out: the bag holds the same message twice.",
        f"1 message on {RIG} is left out: the bag holds another one with other values for the same cycle (0), as of "
        "two publishers.",
    ]


def test_a_stray_state_behind_the_last_one_makes_the_ride_no_longer(rows: list[Row], tmp_path: Path) -> None:
    *_, before, last = [row for row in rows if row[0].topic == RIG]
    stray = (last[0], last[1] + 10**6, with_cycle(before[2], 700))
    aligned = align(read_bag(write_mcap(tmp_path / "a.mcap", [*rows, stray])))
    assert f"1 message on {RIG} is left out: the ride ended at cycle {CYCLES - 1}." in aligned.notes
    assert aligned.ended and aligned.expected == CYCLES and aligned.streams[0].missing == 0


def test_a_bag_that_is_named_by_where_one_stands_has_a_name(
    rows: list[Row], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_rows(tmp_path / "take 1.5", rows)
    monkeypatch.chdir(folder)
    assert default_folder(read_bag(".")) == tmp_path / "take 1.5_report"
    (folder / "take 1.5.mcap").rename(folder / "a.b.mcap")
    assert default_folder(read_bag("a.b.mcap")).name == "a.b_report"
