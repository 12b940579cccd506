"""Bytes at fixed offsets: what rclpy writes, the plan reads, and the other way round, for messages of the cycle."""

from __future__ import annotations

import copy
from array import array
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")
messages = pytest.importorskip("phil_interfaces.msg", reason="the interfaces are not built, or not sourced")

from rclpy.serialization import deserialize_message, serialize_message  # noqa: E402

from phil_base.guard import finite_rows  # noqa: E402
from phil_node.cdr import SEQUENCE, OpenWriter, Plan  # noqa: E402
from phil_node.stencil import Stencil  # noqa: E402

SEGMENT = tuple(f"segment_{name}" for name in ("displacement", "velocity", "acceleration", "force"))
BESIDE = tuple(f"companion_{name}" for name in ("place", "force", "height", "loss"))

KINDS = {
    messages.RigState: ("rig", {}),
    messages.ImpedanceCommand: ("rig", {}),
    messages.ConservedQuantities: ("rig", {}),
    messages.ContactQuality: ("rig", {}),
    messages.CatenaryState: (
        "train",
        dict.fromkeys(SEGMENT, 7) | dict.fromkeys(BESIDE, 2),
    ),
    messages.WireShape: (
        "train",
        {name: size for size, name in enumerate(("x", "contact", "carrier", "dropper_x", "dropper_force", "mast_x"))},
    ),
}
OPEN = OpenWriter(messages.WireShape, "train")
LIMITS = {"uint8": 2**8, "uint16": 2**16, "uint32": 2**32, "uint64": 2**64}


def filled(kind: Any, frame: str, sizes: dict[str, int], draw: Any) -> Any:
    message = kind()
    message.header.frame_id = frame
    message.header.stamp.sec = draw(st.integers(0, 2**31 - 1))
    message.header.stamp.nanosec = draw(st.integers(0, 10**9 - 1))
    for name, type_name in kind.get_fields_and_field_types().items():
        width = 32 if "float" in type_name else 64
        numbers = st.floats(width=width, allow_nan=False)
        if type_name in LIMITS:
            setattr(message, name, draw(st.integers(0, LIMITS[type_name] - 1)))
        elif type_name == "boolean":
            setattr(message, name, draw(st.booleans()))
        elif type_name in ("double", "float"):
            setattr(message, name, draw(numbers))
        elif sequence := SEQUENCE.fullmatch(type_name):
            size = sizes[name]
            values = draw(st.lists(numbers, min_size=size, max_size=size))
            setattr(message, name, array("f" if sequence[1] == "float" else "d", values))
    return message


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@given(data=st.data())
@pytest.mark.slow
def test_plan_and_rclpy_read_and_write_the_same(kind: Any, data: Any) -> None:
    """Exact: the same bytes out of the plan, and the same values out of rclpy's bytes."""
    frame, sizes = KINDS[kind]
    plan = Plan(kind, frame, sizes)
    message = filled(kind, frame, sizes, data.draw)
    encoded = serialize_message(message)
    assert plan.fits(encoded)
    seen, writer = plan.read(encoded), plan.writer()
    for name in kind.get_fields_and_field_types():
        if name == "header":
            stamp, wanted = seen.header.stamp, message.header.stamp
            assert (stamp.sec, stamp.nanosec, seen.header.frame_id) == (wanted.sec, wanted.nanosec, frame)
            writer.message.header.stamp = stamp
        elif name in plan.arrays:
            assert list(getattr(seen, name)) == list(getattr(message, name))
            getattr(writer.message, name)[:] = getattr(seen, name)
        else:
            assert getattr(seen, name) == getattr(message, name)
            setattr(writer.message, name, getattr(seen, name))
    written = writer.bytes()
    assert deserialize_message(written, kind) == message
    assert len(written) == len(encoded) == plan.size


@given(data=st.data(), sizes=st.lists(st.integers(0, 9), min_size=6, max_size=6))
@pytest.mark.slow
def test_arrays_of_changing_lengths_are_written_as_rclpy_does(data: Any, sizes: list[int]) -> None:
    """Exact: one writer, whatever the lengths of the message before."""
    kind, names = messages.WireShape, tuple(KINDS[messages.WireShape][1])
    message = filled(kind, "train", dict(zip(names, sizes, strict=True)), data.draw)
    writer = OPEN
    writer.message.header.stamp = message.header.stamp
    for name in kind.get_fields_and_field_types():
        if name != "header":
            setattr(writer.message, name, getattr(message, name))
    assert deserialize_message(writer.bytes(), kind) == message
    assert len(writer.bytes()) == len(serialize_message(message))


def test_what_follows_an_array_has_no_open_end() -> None:
    with pytest.raises(ValueError, match="CatenaryState"):
        OpenWriter(messages.CatenaryState)


@pytest.mark.parametrize("change", [{"frame": "rigs"}, {"sizes": 6}, {"cut": True}])
def test_message_that_is_laid_out_otherwise_is_read_by_rclpy_or_refused(change: dict[str, Any]) -> None:
    """Another frame or array is read all the same; a message that is cut off raises an error."""
    kind = messages.CatenaryState
    frame, sizes = KINDS[kind]
    plan = Plan(kind, frame, sizes)
    message = kind(cycle=5)
    message.header.frame_id = change.get("frame", frame)
    for name in sizes:
        setattr(message, name, array("d", [1.0] * change.get("sizes", 7)))
    encoded = serialize_message(message)
    if change.get("cut"):
        with pytest.raises(Exception):  # noqa: B017 - whatever rclpy raises
            plan.read(encoded[:30])
        return
    assert not plan.fits(encoded)
    assert plan.read(encoded) == message


@pytest.mark.parametrize("kind", [messages.ImpedanceModel, messages.CycleTiming], ids=lambda kind: kind.__name__)
def test_message_without_fixed_places_has_no_plan(kind: Any) -> None:
    """A text in the midst, a number behind an array: said when the plan is made."""
    with pytest.raises(ValueError, match="no fixed place"):
        Plan(kind)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
@given(data=st.data())
@pytest.mark.slow
def test_a_copy_of_a_written_message_has_its_content_and_a_life_of_its_own(kind: Any, data: Any) -> None:
    """A rig of one's own changes a message on its way out; the original is not to know."""
    frame, sizes = KINDS[kind]
    original = filled(kind, frame, sizes, data.draw)
    writer = OpenWriter(kind, frame) if kind is messages.WireShape else Plan(kind, frame, sizes).writer()
    for name in kind.get_fields_and_field_types():
        value = getattr(original, name)
        if isinstance(writer, OpenWriter) or name not in sizes:
            setattr(writer.message, name, value)
        else:
            getattr(writer.message, name)[:] = value
    copied = copy.deepcopy(writer.message)
    assert copied.writer.bytes() == writer.bytes()
    copied.cycle, copied.header.stamp.sec = original.cycle ^ 1, original.header.stamp.sec ^ 1
    assert deserialize_message(writer.bytes(), kind) == original
    assert deserialize_message(copied.writer.bytes(), kind).cycle == original.cycle ^ 1


def test_a_stencil_writes_what_rclpy_would_write_of_the_same_numbers():
    from geometry_msgs.msg import WrenchStamped
    from sensor_msgs.msg import JointState

    names = ["drive", "pantograph_head"]
    joints = JointState(name=names, position=[0.0, 0.0], velocity=[0.0, 0.0])
    joints.header.frame_id = "rig"
    stencil = Stencil(joints, "position", "velocity")
    for number in (1.5, -0.0, 1e-310):
        stencil.stamp(7, 999_999_999)
        stencil["position"][:] = number, 2.0
        stencil["velocity"][1] = -number
        read = stencil.message()
        assert (read.header.stamp.sec, read.header.stamp.nanosec, read.header.frame_id) == (7, 999_999_999, "rig")
        assert read.name == names and list(read.effort) == []
        assert [str(value) for value in read.position] == [str(number), "2.0"]
        assert [str(value) for value in read.velocity] == ["0.0", str(-number)]
    before = stencil.bytes()
    stencil["position"][0] = 3.0
    assert before != stencil.bytes()  # what was given is not changed by what is set later
    wrench = Stencil(WrenchStamped(), "wrench.force.z")
    wrench["wrench.force.z"][0] = 120.0
    read = wrench.message().wrench
    assert (read.force.x, read.force.y, read.force.z, read.torque.z) == (0.0, 0.0, 120.0, 0.0)
    with pytest.raises(ValueError, match="no number"):
        Stencil(JointState(), "name")


@pytest.mark.parametrize("beside", [0, 1, 5])
def test_first_arrays_that_are_alike_are_rows_of_one_and_the_same_as_the_fields(beside: int) -> None:
    """Those behind them are arrays of their own, as long as they are (five: as long as the first, so rows as well)."""
    sizes = dict.fromkeys(SEGMENT, 5) | dict.fromkeys(BESIDE, beside)
    plan = Plan(messages.CatenaryState, "train", sizes)
    message = plan.writer().message
    rows = len(message.rows)
    assert rows == (8 if beside == 5 else 4)
    message.rows[:] = np.arange(5.0 * rows).reshape(rows, 5)
    if rows == 4:
        for number, name in enumerate(BESIDE):
            getattr(message, name)[:] = 100.0 + number
    read = plan.read(message.writer.bytes())
    for number, name in enumerate(SEGMENT):
        assert getattr(message, name).tolist() == getattr(read, name).tolist() == read.rows[number].tolist()
        assert getattr(read, name).tolist() == [5.0 * number + k for k in range(5)]
    as_rclpy = deserialize_message(message.writer.bytes(), messages.CatenaryState)
    for name in BESIDE:
        assert getattr(read, name).tolist() == getattr(as_rclpy, name).tolist()
        assert len(getattr(read, name)) == beside
    into, other = np.zeros((4, 5)), np.zeros((4, 5))
    assert finite_rows(read, SEGMENT, into) and finite_rows(as_rclpy, SEGMENT, other)
    assert (into == other).all() and (into == message.rows[:4]).all()
    message.rows[2, 3] = np.inf
    data = message.writer.bytes()
    for wrong in (plan.read(data), deserialize_message(data, messages.CatenaryState)):
        assert not finite_rows(wrong, SEGMENT, into)
        assert not finite_rows(wrong, SEGMENT, np.zeros((4, 6)))
