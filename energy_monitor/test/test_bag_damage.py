"""A bag that is damaged, or explains itself badly, gives numbers or one line: never a traceback."""

from __future__ import annotations

import random
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bag_variants import RIG, Row, rows_of, with_cycle, write_mcap, write_rows, write_split
from mcap.writer import CompressionType
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from energy_monitor.bag import BagError, read_bag
from energy_monitor.report.alignment import align
from energy_monitor.report.cli import main

CYCLES = 80
SEPARATOR = "=" * 80


@pytest.fixture(scope="module")
def rows(synthetic: Callable[..., Path], tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    return rows_of(synthetic(tmp_path_factory.mktemp("small") / "bag", cycles=CYCLES))


@pytest.mark.parametrize(
    ("one", "other"),
    [("float64 w_tr", "float64 temperature\nfloat64 w_tr"), ("float64 f_raw", "float32 f_raw")],
    ids=["added", "narrowed"],
)
def test_each_message_is_decoded_by_the_definition_of_its_own_file(
    one: str, other: str, rows: list[Row], tmp_path: Path
) -> None:
    connection = next(row[0] for row in rows if row[0].topic == RIG)
    kind, old = connection.msgtype, connection.msgdef.data
    assert one in old
    before, after = get_typestore(Stores.EMPTY), get_typestore(Stores.EMPTY)
    before.register(get_types_from_msg(old, kind))
    after.register(get_types_from_msg(old.replace(one, other, 1), kind))
    text = SimpleNamespace(data=old.replace(one, other, 1))
    changed = SimpleNamespace(topic=RIG, msgtype=kind, msgdef=text, digest=after.hash_rihs01(kind))

    def again(row: Row) -> Row:
        if row[0].topic != RIG:
            return row
        message = before.deserialize_cdr(row[2], kind)
        values = {name: getattr(message, name, 21.5) for name, _ in after.fielddefs[kind][1]}
        return changed, row[1], bytes(after.serialize_cdr(after.types[kind](**values), kind))

    half = len(rows) // 2
    mixed = write_split(
        tmp_path / "mixed", [rows[:half], [again(row) for row in rows[half:]]], ["bag_0.mcap", "bag_1.mcap"]
    )
    ours, theirs = read_bag(mixed), read_bag(write_mcap(tmp_path / "plain.mcap", rows))
    for name in ("cycle", "w_tr", "f_tr", "work"):
        np.testing.assert_array_equal(ours.tables[RIG][name], theirs.tables[RIG][name])
    np.testing.assert_allclose(ours.tables[RIG].real("f_raw"), theirs.tables[RIG].real("f_raw"), rtol=1e-7)


def test_messages_that_do_not_fit_their_definition_are_left_out_and_counted(rows: list[Row], tmp_path: Path) -> None:
    damaged = list(rows)
    own = [index for index, row in enumerate(rows) if row[0].topic == RIG]
    for index, payload in ((own[10], rows[own[10]][2][:-20]), (own[20], rows[own[20]][2] + bytes(30)), (own[30], b"")):
        damaged[index] = (rows[index][0], rows[index][1], payload)
    damaged[own[40]] = (*rows[own[40]][:2], b"\0\7\0\0" + rows[own[40]][2][4:])
    bag = read_bag(write_mcap(tmp_path / "a.mcap", damaged))
    assert sorted(set(range(CYCLES)) - set(bag.tables[RIG]["cycle"].tolist())) == [10, 20, 30, 40]
    said = " ".join(bag.notes)
    for reason in ("shorter than their definition", "longer than their definition", "empty", "0x0007"):
        assert f"1 message on {RIG} is left out" in said and reason in said


def test_a_type_that_is_not_explained_is_named(rows: list[Row], tmp_path: Path) -> None:
    for topic in (RIG, "/diagnostics"):
        file = write_mcap(
            tmp_path / f"{topic.replace('/', '_')}.mcap",
            rows,
            definition=lambda c, topic=topic: c.msgdef.data.split(SEPARATOR)[0] if c.topic == topic else c.msgdef.data,
        )
        if topic == RIG:
            with pytest.raises(BagError, match="definition of phil_interfaces/msg/RigState lacks std_msgs/msg/Header"):
                read_bag(file)
        else:
            bag = read_bag(file)
            assert "DiagnosticArray lacks std_msgs/msg/Header" in bag.notes[0] and len(align(bag).cycle) == CYCLES
    with pytest.raises(BagError, match="no message definition for phil_interfaces/msg/"):
        read_bag(write_mcap(tmp_path / "none.mcap", rows, definition=lambda _: ""))
    with pytest.raises(BagError, match="cannot be parsed"):
        read_bag(write_mcap(tmp_path / "other.mcap", rows, definition=lambda _: "%%%"))
    listed = write_mcap(
        tmp_path / "list.mcap", rows, definition=lambda c: c.msgdef.data.replace("float64 w_tr", "float64[] w_tr")
    )
    with pytest.raises(BagError, match=r"RigState\.w_tr in this bag is not a number"):
        read_bag(listed)


def test_a_type_that_the_numbers_do_without_is_left_out_where_it_is_not_explained(
    rows: list[Row], tmp_path: Path
) -> None:
    model = "/catenary_model/impedance_model"
    bag = read_bag(write_mcap(tmp_path / "a.mcap", rows, definition=lambda c: c.msgdef.data * (c.topic != model)))
    assert len(align(bag).cycle) == CYCLES and model not in bag.tables
    assert len(bag.notes) == 1 and f"{model} is not in this report: the bag holds no message definition" in bag.notes[0]


def test_older_names_of_types_and_line_ends_of_windows_are_understood(rows: list[Row], tmp_path: Path) -> None:
    older = [(SimpleNamespace(**{**c._asdict(), "msgtype": c.msgtype.replace("/msg/", "/")}), t, d) for c, t, d in rows]
    file = write_mcap(tmp_path / "a.mcap", older, definition=lambda c: c.msgdef.data.replace("\n", "\r\n"))
    bag = read_bag(file)
    assert len(align(bag).cycle) == CYCLES and not bag.notes


def test_what_is_of_another_type_or_namespace_is_not_said_to_lack_messages(rows: list[Row], tmp_path: Path) -> None:
    file = write_mcap(tmp_path / "a.mcap", rows)
    with pytest.raises(BagError, match=r"no RigState in the namespace /left of this bag; it has: /$"):
        align(read_bag(file, namespace="left"))
    foreign = [
        (SimpleNamespace(**{**c._asdict(), "msgtype": c.msgtype.replace("phil", "my")}), t, d) for c, t, d in rows
    ]
    with pytest.raises(BagError, match=f"{RIG} in this bag is of type my_interfaces/msg/RigState, not phil_"):
        align(read_bag(write_mcap(tmp_path / "b.mcap", foreign)))


def test_topics_without_usable_messages_say_why(rows: list[Row], tmp_path: Path) -> None:
    with pytest.raises(BagError, match=f"{RIG} has no message: the recording ended before the ride began"):
        align(read_bag(write_mcap(tmp_path / "a.mcap", rows, silent=[RIG])))
    file = write_mcap(tmp_path / "b.mcap", rows, encoding=lambda c: "json" if c.topic == RIG else "cdr")
    with pytest.raises(BagError, match=rf"{RIG} has no message that can be used: .*encoded as json, not as cdr"):
        align(read_bag(file))


def test_two_rides_side_by_side_are_named_with_the_way_to_choose(
    synthetic: Callable[..., Path], rows: list[Row], tmp_path: Path
) -> None:
    spaces = [
        [(SimpleNamespace(**{**row[0]._asdict(), "topic": f"/{name}{row[0].topic}"}), *row[1:]) for row in rows]
        for name in ("left", "right")
    ]
    file = write_mcap(tmp_path / "a.mcap", sorted([*spaces[0], *spaces[1]], key=lambda row: row[1]))
    with pytest.raises(BagError, match=r"several rides in this bag .*--namespace /right"):
        align(read_bag(file))
    assert len(align(read_bag(file, namespace="left")).cycle) == CYCLES


def test_damage_takes_only_what_it_hit(rows: list[Row], tmp_path: Path) -> None:
    plain = write_mcap(tmp_path / "plain.mcap", rows, compression=CompressionType.NONE)
    data = bytearray(plain.read_bytes())
    begin = len(data) // 2
    data[begin : begin + 20] = bytes(20)
    plain.write_bytes(data)
    bag = read_bag(plain)
    assert not bag.complete and "plain.mcap is damaged" in bag.notes[0] and "checksum" in bag.notes[0]
    assert CYCLES // 2 < len(bag.tables[RIG]) < CYCLES and bag.tables[RIG]["cycle"][-1] == CYCLES - 1
    packed = write_rows(tmp_path / "packed", rows, compression="MESSAGE") / "packed.mcap"
    data = bytearray(packed.read_bytes())
    place = data.find(b"\x28\xb5\x2f\xfd", len(data) // 2)
    data[place + 5 : place + 25] = b"\xff" * 20
    packed.write_bytes(data)
    assert any("1 message on" in note and "cannot be decompressed" in note for note in read_bag(packed).notes)


@pytest.mark.parametrize("content", [b"", b"not zstd\n", b"\x28\xb5\x2f\xfd" + b"\xff" * 50])
def test_what_is_no_compressed_file_is_one_line(
    content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.mcap.zstd", "a.db3.zstd"):
        (tmp_path / name).write_bytes(content)
        assert main([str(tmp_path / name), "--no-html"]) == 2
        error = capsys.readouterr().err
        assert error.startswith("analyze: ") and error.count("\n") == 1 and name in error


def mutated(data: bytes, chance: random.Random) -> bytes:
    content, size = bytearray(data), len(data)
    at, length = chance.randrange(size), chance.choice([1, 8, 100, 5000])
    kind = chance.randrange(6)
    if kind == 0:
        for _ in range(chance.choice([1, 3, 30])):
            content[chance.randrange(size)] ^= 1 << chance.randrange(8)
    elif kind == 1:
        del content[at:]
    elif kind == 2:
        del content[at : at + length]
    elif kind == 3:
        content[at:at] = content[at : at + length]
    elif kind == 4:
        content[at : at + length] = chance.randbytes(len(content[at : at + length]))
    else:
        for _ in range(5):
            content[chance.randrange(min(size, 20_000))] = chance.randrange(256)
    return bytes(content)


@pytest.mark.slow
def test_any_damage_gives_numbers_or_one_line(
    rows: list[Row], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    chance = random.Random(20)
    rig = [index for index, row in enumerate(rows) if row[0].topic == RIG]
    stray = list(rows)
    stray.insert(rig[60], (rows[rig[60]][0], rows[rig[60]][1], with_cycle(rows[rig[60]][2], 7)))
    sources = [
        write_rows(tmp_path / "plain", stray),
        write_rows(tmp_path / "sqlite", rows, sqlite=True),
        write_rows(tmp_path / "messages", rows, compression="MESSAGE"),
        write_rows(tmp_path / "file", rows, compression="FILE"),
        write_split(tmp_path / "split", [rows[:200], rows[200:]], ["b_0.mcap", "b_1.mcap"], ["b_0.mcap", "b_1.mcap"]),
    ]
    codes = set()
    for _ in range(12):
        work = tmp_path / "work"
        shutil.copytree(chance.choice(sources), work)
        file = chance.choice(sorted(work.iterdir()))
        file.write_bytes(mutated(file.read_bytes(), chance))
        before = sorted(work.iterdir())
        code = main([str(work), "--no-html", "--run-in", "0.02", "--json", str(tmp_path / "r.json")])
        error = capsys.readouterr().err
        assert code in (0, 1) if not error else (code == 2 and error.startswith("analyze: ") and error.count("\n") == 1)
        assert sorted(work.iterdir()) == before
        codes.add(code)
        shutil.rmtree(work)
    assert 2 in codes and codes & {0, 1}
