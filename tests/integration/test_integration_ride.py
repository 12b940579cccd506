"""The closed loop of four real processes, from the command to the bag and the report."""

from __future__ import annotations

import json
import os
import signal
import struct
from pathlib import Path

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import Reader

from catenary_model.line_file import load_line
from energy_monitor.bag import read_bag
from ride.shared_memory import litter, snapshot

pytestmark = pytest.mark.integration

CYCLES = 1500
CYCLE_TOPICS = ("/test_rig_sim/state", "/impedance_mpc/command", "/catenary_model/state")


def raw(bag: Path) -> dict[str, list[bytes]]:
    """Give the messages of the cycle topics as they were on the wire; repeated ones (start-up) once."""
    found: dict[str, dict[bytes, None]] = {topic: {} for topic in CYCLE_TOPICS}
    with Reader(bag) as reader:
        chosen = [c for c in reader.connections if c.topic in CYCLE_TOPICS]
        for connection, _, data in reader.messages(connections=chosen):
            found[connection.topic][bytes(data)] = None
    return {topic: list(messages) for topic, messages in found.items()}


def stamps(bag: Path) -> dict[str, np.ndarray]:
    """Give the header stamps of every topic in s; the header is the first field of all messages of a ride."""
    found: dict[str, list[float]] = {}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            seconds, rest = struct.unpack_from("<iI", data, 4)  # behind the four bytes of CDR's own header
            found.setdefault(connection.topic, []).append(seconds + 1e-9 * rest)
    return {topic: np.array(values) for topic, values in found.items()}


def test_all_stamps_of_a_ride_in_lockstep_are_its_time(lockstep_ride):
    found = stamps(lockstep_ride.out / "bag")
    assert {"/diagnostics", "/test_rig_sim/timing", "/test_rig_sim/joint_states", "/catenary_model/wire_shape"} <= set(
        found
    )
    for topic, values in found.items():
        assert values.min() >= 0.0 and values.max() <= 0.002 * CYCLES + 1e-9, topic
        assert (np.diff(values) >= 0.0).all() or topic == "/diagnostics", topic


def test_the_ride_succeeds_and_leaves_what_was_promised(lockstep_ride):
    assert lockstep_ride.code == 0, lockstep_ride.text
    for name in (
        "params.yaml",
        "line.yaml",
        "report.json",
        "report.html",
        "ride.png",
        "figures/displacement.png",
        "bag/metadata.yaml",
    ):
        assert (lockstep_ride.out / name).is_file(), name
    assert "report.html" in lockstep_ride.text


def test_every_cycle_is_in_the_bag_once_and_matched(lockstep_ride):
    bag = read_bag(lockstep_ride.out / "bag")
    expected = {"/test_rig_sim/state": CYCLES, "/impedance_mpc/command": CYCLES, "/catenary_model/state": CYCLES + 1}
    for topic, count in expected.items():
        cycles = bag.tables[topic]["cycle"]
        assert sorted(set(cycles.tolist())) == list(range(count)), topic
    rig = bag.tables["/test_rig_sim/state"]
    assert rig["last"].sum() == 1 and rig["last"][-1]


def test_the_numbers_are_those_of_a_ride(lockstep_ride):
    """Loose bounds: 3 s hold the soft start; the figures of a whole ride are in the report's verdicts."""
    report = json.loads((lockstep_ride.out / "report.json").read_text())
    text = json.dumps(report)
    assert "NaN" not in text
    bag = read_bag(lockstep_ride.out / "bag")
    rig, catenary = bag.tables["/test_rig_sim/state"], bag.tables["/catenary_model/state"]
    error = rig["w_tr"][1000:] - catenary["w_cat"][1000:CYCLES]
    assert abs(error).max() < 5e-3  # a tenth of the uplift: the drive follows the wire
    assert 60.0 < rig["f_tr"][1000:].mean() < 180.0  # about the pantograph's uplift force of 120 N
    assert catenary["track_position"][-1] - catenary["track_position"][0] == pytest.approx(250.0 / 3.6 * 3.0, rel=1e-9)


def test_the_parameter_file_holds_every_node(lockstep_ride):
    tree = yaml.safe_load((lockstep_ride.out / "params.yaml").read_text())
    assert set(tree) == {"catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim"}
    assert tree["test_rig_sim"]["ros__parameters"]["seed"] == 7


def test_the_line_is_kept_beside_the_bag(lockstep_ride):
    tree = yaml.safe_load((lockstep_ride.out / "params.yaml").read_text())
    name = tree["catenary_model"]["ros__parameters"]["line"]
    assert load_line(lockstep_ride.out / "line.yaml") == load_line(name)


def test_the_turnaround_of_every_cycle_is_in_the_bag(lockstep_ride):
    timing = read_bag(lockstep_ride.out / "bag").tables["/catenary_model/timing"]
    assert sum(len(batch) for batch in timing.entries("turnaround")) == CYCLES


def test_every_node_counts_what_it_receives_and_in_lockstep_nothing_is_late_lost_or_swapped(lockstep_ride):
    bag = read_bag(lockstep_ride.out / "bag")
    with Reader(lockstep_ride.out / "bag") as reader:
        chosen = [c for c in reader.connections if c.topic == "/diagnostics"]
        said = [bytes(data) for _, _, data in reader.messages(connections=chosen)]
    command, rig, wire = "impedance_mpc/command", "test_rig_sim/state", "catenary_model/state"
    inputs = {
        "catenary_model": {command},
        "impedance_mpc": {rig, wire},
        "energy_monitor": {rig, command, wire},
        "test_rig_sim": {command},
    }
    for name, topics in inputs.items():
        counts = bag.tables[f"/{name}/timing"]
        assert all(int(counts[f"messages_{kind}"][-1]) == 0 for kind in ("late", "lost", "swapped")), name
        last = next(message for message in reversed(said) if f"/{name}: cycle".encode() in message)
        assert {topic for topic in (command, rig, wire) if f"input {topic}".encode() in last} == topics, name


def test_every_node_says_what_the_system_has_granted_it(lockstep_ride):
    with Reader(lockstep_ride.out / "bag") as reader:
        chosen = [c for c in reader.connections if c.topic == "/diagnostics"]
        said = [bytes(data) for _, _, data in reader.messages(connections=chosen)]
    for name in ("catenary_model", "impedance_mpc", "energy_monitor", "test_rig_sim"):
        active = [message for message in said if name.encode() in message and b"timer slack" in message]
        assert active, name
        assert all(b"SCHED_FIFO" in message and b"memory" in message and b"kept" in message for message in active)


def test_nothing_is_left_running(lockstep_ride, leftovers):
    assert leftovers(lockstep_ride.out) == []


def test_the_same_seed_gives_the_same_ride_to_the_last_bit(lockstep_ride, ride):
    again = ride("--params", str(lockstep_ride.out / "params.yaml"), "--no-report")
    again.finish(240.0)
    assert again.code == 0, again.text
    first, second = raw(lockstep_ride.out / "bag"), raw(again.out / "bag")
    for topic in CYCLE_TOPICS:
        assert len(first[topic]) >= CYCLES
        assert first[topic] == second[topic], topic


def test_the_other_solver_makes_the_same_ride(lockstep_ride, ride):
    """Both solve the program of each cycle to rounding (1e-12 mm, N): the first 50 cycles agree to 1e-8 m and N.

    The loop does not damp what is left (bounds of the correction hang on a velocity near zero): with DAQP's own answers
    rounded otherwise a ride of 3 s differs by 0.08 mm at most, 0.016 mm rms. So 0.3 mm for the rest.
    """
    other = ride("--duration", "1", "--seed", "7", "--set", "impedance_mpc.solver=proxqp", "--no-report")
    other.finish(240.0)
    assert other.code == 0, other.text
    tables = [read_bag(out / "bag").tables["/impedance_mpc/command"] for out in (other.out, lockstep_ride.out)]
    (cycle, plans), (known, right) = [
        (table["cycle"].tolist(), {name: table[name] for name in ("u_tr", "f_cor", "f_cat")}) for table in tables
    ]
    assert cycle == list(range(500)) and known[:500] == cycle
    for name, values in plans.items():
        np.testing.assert_allclose(values[:50], right[name][:50], rtol=0.0, atol=1e-8, err_msg=name)
    np.testing.assert_allclose(plans["u_tr"], right["u_tr"][:500], rtol=0.0, atol=3e-4)
    assert not tables[0]["status"].any() and tables[0]["iterations"].any()  # ProxQP was asked, and never in vain


def test_a_ride_on_finite_differences(lockstep_ride, ride):
    """The same loop on the other discretisation: complete, and within a millimetre of the ride on elements.

    Both are within 0.2 mm rms of the reference on a full ride; 1 s here is the beginning of the soft start.
    """
    other = ride("--duration", "1", "--seed", "7", "--discretisation", "fd", "--no-report")
    other.finish(240.0)
    assert other.code == 0, other.text
    tree = yaml.safe_load((other.out / "params.yaml").read_text())
    assert tree["catenary_model"]["ros__parameters"]["discretisation"] == "fd"
    fd, fe = (read_bag(out / "bag").tables["/catenary_model/state"] for out in (other.out, lockstep_ride.out))
    assert sorted(set(fd["cycle"].tolist())) == list(range(501))
    once, again = (dict(zip(t["cycle"].tolist(), t["w_cat"].tolist(), strict=True)) for t in (fd, fe))
    apart = np.array([once[k] - again[k] for k in range(501)])
    assert 0.0 < np.abs(apart).max() < 1e-3
    assert max(once.values()) > 5e-3  # the pantograph has lifted the wire


@pytest.mark.alone
def test_ctrl_c_leaves_a_readable_bag_a_report_and_no_process(ride, leftovers):
    before = snapshot()
    going = ride("--duration", "0")
    going.wait_until_riding()
    os.killpg(going.process.pid, signal.SIGINT)
    going.finish()
    assert going.code == 130, going.text
    assert leftovers(going.out) == []
    bag = read_bag(going.out / "bag")
    cycles = bag.tables["/test_rig_sim/state"]["cycle"].tolist()
    assert bag.complete and sorted(set(cycles)) == list(range(len(set(cycles))))
    assert (going.out / "report.html").is_file()
    assert [name for name in litter(before) if "lttng" not in name] == []


def test_a_killed_node_fails_the_ride_and_is_named(ride, leftovers):
    going = ride("--duration", "0", "--no-report")
    going.wait_until_riding()
    lines = {pid: Path(f"/proc/{pid}/cmdline").read_bytes() for pid in leftovers(going.out)}
    os.kill(next(pid for pid, line in lines.items() if b"impedance_mpc.node" in line), signal.SIGKILL)
    going.finish()
    assert going.code == 1, going.text
    assert "impedance_mpc ended" in going.text
    assert leftovers(going.out) == []
    assert len(read_bag(going.out / "bag").tables["/test_rig_sim/state"]) > 0


def test_a_killed_run_script_takes_everything_with_it_and_the_bag_is_readable(ride, leftovers):
    going = ride("--duration", "0", "--no-report")
    going.wait_until_riding()
    going.process.kill()
    going.process.wait()
    for _ in range(100):
        if not leftovers(going.out):
            break
        signal.sigtimedwait([], 0.1)
    assert leftovers(going.out) == []
    assert len(read_bag(going.out / "bag").tables["/test_rig_sim/state"]) > 100


@pytest.mark.alone
def test_real_time_follows_the_clock(ride):
    # A machine with other work to do may hold the loop up for longer than a rig would bear: not what is tested here.
    held = "test_rig_sim.late_limit=1000"
    done = ride("--duration", "2", "--mode", "realtime", "--no-report", "--set", held)
    done.finish(240.0)
    assert done.code == 0, done.text
    bag = read_bag(done.out / "bag")
    rig = bag.tables["/test_rig_sim/state"]
    assert len(set(rig["cycle"].tolist())) == 1000
    ridden = rig["header.stamp.sec"].astype(float) + 1e-9 * rig["header.stamp.nanosec"]
    # The clock starts when cycle 0 was answered. From then on stamps are on the grid of Ts, to a microsecond, whatever
    # the machine's load; a node that was held up for long gives ticks up, so steps can be longer than one Ts.
    steps = np.diff(ridden[1:]) / 0.002
    assert np.abs(steps - np.round(steps)).max() < 1e-3
    assert steps.min() > 0.5
    # One clock for all: what comes before cycle 0 has the wall clock, too.
    for topic, values in stamps(done.out / "bag").items():
        before = 120.0 if topic == "/catenary_model/impedance_model" else 30.0
        assert ridden[0] - before < values.min() <= values.max() < ridden[-1] + 10.0, topic
    # Lockstep would be through in a fraction of this.
    assert (rig.log_time[-1] - rig.log_time[0]) * 1e-9 > 1.9


def test_a_node_by_itself_refuses_wrong_parameters(node_environment):
    import subprocess
    import sys

    for package, setting, words in (
        ("catenary_model", "spans:=400", ("spans", "400")),
        ("test_rig_sim", "nonsense:=1", ("nonsense", "unknown")),
        ("impedance_mpc", "prediction_horizon:=thirty", ("prediction_horizon", "thirty", "integer")),
    ):
        command = [sys.executable, "-m", f"{package}.node", "--ros-args", "-p", setting]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=node_environment)
        assert done.returncode == 2
        for word in words:
            assert word in done.stderr
        assert "Traceback" not in done.stderr
