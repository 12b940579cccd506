"""The closed loop as a library rides as the nodes do: equal to the bag of a ride in lockstep to the last bit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from phil_loop import ClosedLoop, Moment, resolve

pytestmark = pytest.mark.integration

COLUMNS = {
    "/test_rig_sim/state": "rig",
    "/catenary_model/state": "wire",
    "/impedance_mpc/command": "command",
    "/impedance_mpc/conserved_quantities": "books",
}
OF_A_RIDE = {"header", "cycle", "late_commands", "speed", "__msgtype__"}
"""What is no number of a cycle of the loop: stamp, counters of the transport, a constant."""


def messages(bag: Path) -> dict[str, dict[int, Any]]:
    """Give each topic's messages by cycle; what was sent again (start-up) is the same message."""
    found: dict[str, dict[int, Any]] = {topic: {} for topic in COLUMNS}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages(connections=[c for c in reader.connections if c.topic in COLUMNS]):
            message = reader.deserialize(data, connection.msgtype)
            found[connection.topic].setdefault(message.cycle, message)
    return found


class Segments:
    """Keeps what the catenary shows of the segment."""

    def __init__(self) -> None:
        self.kept: list[np.ndarray] = []

    def __call__(self, moment: Moment) -> None:
        self.kept.append(np.stack(moment.wire[:4]))


def compare(out: Path, parameters: Path) -> set[int]:
    """Ride what a bag was recorded of, and compare every field of every message; give the modes that came up."""
    segments = Segments()
    record = ClosedLoop(resolve(parameters, {}), observers=[segments]).ride()
    segment = dict(
        zip(
            ("segment_displacement", "segment_velocity", "segment_acceleration", "segment_force"),
            np.stack(segments.kept, axis=1),
            strict=True,
        )
    )
    bag = messages(out / "bag")
    # The rig's last state ends the ride; the wire goes one cycle further, with the last command.
    assert sorted(bag["/test_rig_sim/state"]) == list(range(record.cycles))
    assert sorted(bag["/impedance_mpc/command"]) == list(range(record.cycles))
    assert sorted(bag["/catenary_model/state"]) == list(range(record.cycles + 1))
    assert sorted(bag["/impedance_mpc/conserved_quantities"]) == list(range(0, record.cycles, 10))
    compared = set()
    for topic, name in COLUMNS.items():
        columns = getattr(record, name)
        for cycle, message in bag[topic].items():
            if cycle == record.cycles:
                continue
            for field in set(message.__dataclass_fields__) - OF_A_RIDE:
                value = getattr(message, field)
                if field == "last":
                    assert value == (cycle == record.cycles - 1)
                elif field in segment:
                    np.testing.assert_array_equal(value, segment[field][cycle], f"{topic} {field} of cycle {cycle}")
                elif not field.isupper():
                    np.testing.assert_array_equal(
                        value, getattr(columns, field)[cycle], f"{topic} {field} of cycle {cycle}"
                    )
                compared.add((name, field))
    assert len(compared) > 50
    return set(record.rig.mode.tolist())


HOLD, TRACKING, STOPPED, APPROACHING, LANDING = 0, 1, 5, 7, 8


def test_a_ride_of_the_loop_equals_the_bag_of_the_same_ride_to_the_last_bit(lockstep_ride):
    assert lockstep_ride.code == 0, lockstep_ride.text
    assert compare(lockstep_ride.out, lockstep_ride.out / "params.yaml") == {HOLD, TRACKING}


@pytest.mark.parametrize(
    "arguments",
    [
        ("--discretisation", "fd", "--speed-kmh", "200"),
        (
            *("--pantograph", "three_mass", "--set", "impedance_mpc.control=integrated"),
            *("--set", "catenary_model.pantographs=three_mass:84:120, en50318:-40:110"),
        ),
    ],
)
def test_so_does_one_that_approaches_tracks_and_lands(ride, arguments):
    soft = ("--set", "test_rig_sim.start=apart", "--set", "test_rig_sim.land_at_end=true")
    done = ride("--duration", "3", "--no-report", *soft, *arguments)
    text = done.finish(240.0)
    assert done.code == 0, text
    assert compare(done.out, done.out / "params.yaml") >= {HOLD, APPROACHING, TRACKING, LANDING, STOPPED}
