"""What the recorder leaves can be read by other libraries with their defaults, also after it was killed."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from bag_variants import rows_of, write_mcap
from mcap.exceptions import McapError
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from energy_monitor import record, recover
from energy_monitor.bag import read_bag
from energy_monitor.bag_channel import BagError
from energy_monitor.definitions import Definition, definition_of
from energy_monitor.recorder import BagSink, Channel

HEADER = "std_msgs/msg/Header"


def header(number: int) -> bytes:
    store = get_typestore(Stores.ROS2_JAZZY)
    stamp = store.types["builtin_interfaces/msg/Time"](number, 0)
    return bytes(store.serialize_cdr(store.types[HEADER](stamp, "rig"), HEADER))


def read_by_others(bag: Path) -> dict[str, int]:
    """Count messages a topic by rosbags' AnyReader, which deserialises them too, and by mcap; both have to agree."""
    counts: dict[str, int] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
            if connection.msgdef.data:
                reader.deserialize(data, connection.msgtype)
    with next(bag.glob("*.mcap")).open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == sum(counts.values())
    return counts


def test_a_topic_without_a_definition_does_not_spoil_the_bag(tmp_path: Path) -> None:
    unknown = definition_of("nobody/msg/Nothing", "RIHS01_" + "ab" * 32)
    assert unknown.problem == "no definition of nobody/msg/Nothing is installed"
    sink = BagSink(tmp_path / "ride")
    kinds = {"/known": (HEADER, definition_of(HEADER)), "/odd": ("nobody/msg/Nothing", unknown)}
    for topic, (kind, definition) in kinds.items():
        take = sink.add(Channel(topic, kind, definition))
        for number in range(5):
            take(header(number))
    sink.close()
    assert read_by_others(tmp_path / "ride") == {"/known": 5, "/odd": 5}


def package(folder: Path, name: str, **files: str) -> None:
    place = folder / "share" / name / "msg"
    place.mkdir(parents=True)
    for message, text in files.items():
        (place / f"{message}.msg").write_text(text)


ODD = """
char letter
char[4] word
char A=65
byte b 7
string<=5 short "hi"
int32[<=3] few [1, 2]
float64 x 1.5   # m
string NAME='a # b'
Inner[<=2] inner
std_msgs/Header header
"""


def test_definitions_with_every_kind_of_field_are_read_by_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package(
        tmp_path, "odd", Odd=ODD, Inner="char c\n", Wide="wstring w\n", Broken="float64 [\n", Torn="nobody/Nothing x\n"
    )
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path}:{os.environ.get('AMENT_PREFIX_PATH', '')}")
    odd = definition_of("odd/msg/Odd")
    assert "uint8 letter" in odd.text and "uint8 c" in odd.text and not odd.problem
    assert "cannot be read by rosbags" in definition_of("odd/msg/Broken").problem
    assert definition_of("odd/msg/Torn").problem and not definition_of("odd/msg/Torn").text
    other = definition_of("odd/msg/Odd", "RIHS01_" + "cd" * 32)
    assert "not the one of its publisher" in other.problem and not other.text
    sink = BagSink(tmp_path / "ride")
    for number, kind in enumerate(("Odd", "Wide", "Broken", "Torn")):
        sink.add(Channel(f"/t{number}", f"odd/msg/{kind}", definition_of(f"odd/msg/{kind}")))
    sink.add(Channel("/known", HEADER, definition_of(HEADER)))(header(1))
    sink.close()
    assert read_by_others(tmp_path / "ride") == {"/known": 1}


def test_the_hash_of_char_is_that_of_ros() -> None:
    pytest.importorskip("std_msgs")
    from std_msgs.msg import Char

    hashed = Char._TYPE_HASH if hasattr(Char, "_TYPE_HASH") else definition_of("std_msgs/msg/Char").digest
    assert definition_of("std_msgs/msg/Char", str(hashed)).text.strip().endswith("uint8 data")


def test_a_bag_that_was_cut_off_is_written_anew_for_every_reader(
    synthetic: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = rows_of(synthetic(tmp_path / "whole", cycles=80))
    killed = tmp_path / "killed"
    killed.mkdir()
    file = write_mcap(killed / "ride.mcap", rows)
    content = file.read_bytes()[: file.stat().st_size * 6 // 10]
    file.write_bytes(content)
    with pytest.raises(FileNotFoundError):
        AnyReader([killed]).open()
    with file.open("rb") as stream, pytest.raises(McapError):
        list(make_reader(stream).iter_messages())
    assert record.main(["--recover", str(killed)]) == 0
    new = tmp_path / "killed_recovered"
    ours, theirs = read_bag(killed), read_bag(new)
    assert not ours.complete and theirs.complete and not theirs.notes
    counts = read_by_others(new)
    for topic, table in ours.tables.items():
        assert (theirs.tables[topic].log_time == table.log_time).all() and counts[topic] == len(table)
    assert str(new) in capsys.readouterr().out and file.read_bytes() == content
    assert record.main(["--recover", str(killed)]) == 2
    assert "exists already" in capsys.readouterr().err
    shutil.rmtree(new)
    file.write_bytes(content[:8])
    assert record.main(["--recover", str(killed)]) == 2
    assert "no message in it can be read" in capsys.readouterr().err and not new.exists()


def test_a_full_disk_has_its_own_exit_code_and_keeps_the_bag(tmp_path: Path) -> None:
    sink = BagSink(tmp_path / "ride")
    take = sink.add(Channel("/t", HEADER, definition_of(HEADER)))
    take(header(1))

    sink._writer.sync()
    sink._writer.storage.bio.close()
    sink._writer.storage.bio = open("/dev/full", "wb")  # noqa: SIM115 - the sink closes it
    failure = record.closed(sink)
    assert failure is not None and failure.errno == errno.ENOSPC and "ride" in str(failure)
    assert (tmp_path / "ride" / "ride.mcap").stat().st_size > 0
    assert not list((tmp_path / "ride").glob("metadata*"))


def test_no_room_for_the_bag_written_anew_is_one_line_and_leaves_nothing(
    ride_bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = recover._copy

    def without_room(source: Any, writer: Any, found: Any) -> None:
        copy(source, writer, found)
        writer.storage.bio.close()
        writer.storage.bio = open("/dev/full", "wb")  # noqa: SIM115 - the writer closes it

    monkeypatch.setattr(recover, "_copy", without_room)
    assert record.main(["--recover", str(ride_bag), "--out", str(tmp_path / "new")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "No space left on device" in said and not (tmp_path / "new").exists()


def test_line_ends_of_windows_are_not_handed_on(synthetic: Callable[..., Path], tmp_path: Path) -> None:
    rows = rows_of(synthetic(tmp_path / "whole", cycles=20))
    file = write_mcap(tmp_path / "a.mcap", rows, definition=lambda c: c.msgdef.data.replace("\n", "\r\n"))
    assert record.main(["--recover", str(file)]) == 0
    assert sum(read_by_others(tmp_path / "a_recovered").values()) == len(rows)


def test_another_idea_of_what_is_built_in_is_not_handed_on(
    synthetic: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A definition whose builtin_interfaces/msg/Time is not the one of ROS 2: its messages are kept, it is not."""
    rows = rows_of(synthetic(tmp_path / "whole", cycles=20))
    file = write_mcap(tmp_path / "a.mcap", rows, definition=lambda c: c.msgdef.data.replace("int32 sec", "int64 sec"))
    assert record.main(["--recover", str(file)]) == 0
    said = capsys.readouterr()
    assert "Traceback" not in said.err
    assert "without its definition" in said.out and "Time' is already present" in said.out
    with suppress(BagError):  # whatever of it fits; nothing else
        read_bag(tmp_path / "a.mcap")


def test_no_room_to_say_so_is_no_error() -> None:
    with open("/dev/full", "w", encoding="utf-8") as full:
        record.say("the disk is full", full)
        record.say("again", full)


def test_definition_says_what_is_wrong() -> None:
    assert definition_of(HEADER).problem == ""
    assert definition_of("nobody/msg/Nothing", "RIHS01_abc") == Definition(
        "", "RIHS01_abc", "no definition of nobody/msg/Nothing is installed"
    )
