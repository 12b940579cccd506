"""The node in this process with a partner that plays the controller: messages, gaps, duplicates, reset."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

rclpy = pytest.importorskip("rclpy")
messages = pytest.importorskip("phil_interfaces.msg")

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from catenary_model.line import Line  # noqa: E402
from catenary_model.line_file import dump_line, load_line  # noqa: E402
from catenary_model.model import Catenary  # noqa: E402
from catenary_model.node import CatenaryNode  # noqa: E402
from catenary_model.reduced import discretise  # noqa: E402
from phil_node.base import QUIET  # noqa: E402
from phil_node.qos import CYCLE, LATCHED, VIEW  # noqa: E402

TS_NS = 2_000_000


class Partner:
    """Publishes commands, collects what the node publishes."""

    def __init__(self) -> None:
        self.node = CatenaryNode()
        self.partner = rclpy.create_node("partner")
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.partner)
        self.states: list[Any] = []
        self.models: list[Any] = []
        self.shapes: list[Any] = []
        self.timings: list[Any] = []
        subscribe = self.partner.create_subscription
        subscribe(messages.CatenaryState, "catenary_model/state", self.states.append, CYCLE)
        subscribe(messages.ImpedanceModel, "catenary_model/impedance_model", self.models.append, LATCHED)
        subscribe(messages.WireShape, "catenary_model/wire_shape", self.shapes.append, VIEW)
        subscribe(messages.CycleTiming, "catenary_model/timing", self.timings.append, CYCLE)
        self.commands = self.partner.create_publisher(messages.ImpedanceCommand, "impedance_mpc/command", CYCLE)
        self.reset = self.partner.create_client(Trigger, "catenary_model/reset")

    def until(self, done: Callable[[], bool], seconds: float = 10.0) -> None:
        end = time.monotonic() + seconds
        while not done():
            assert time.monotonic() < end, "nothing came"
            self.executor.spin_once(timeout_sec=0.05)

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)

    def activate(self) -> None:
        assert self.node.trigger_configure().name == "SUCCESS"
        self.until(lambda: self.commands.get_subscription_count() == 1)
        self.until(lambda: self.node.count_subscribers("catenary_model/state") == 1)
        assert self.node.trigger_activate().name == "SUCCESS"
        self.until(lambda: bool(self.states))

    def command(self, cycle: int, force: float) -> None:
        message = messages.ImpedanceCommand()
        message.cycle, message.f_cat = cycle, force
        now = (cycle + 1000) * TS_NS
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 1_000_000_000)
        self.commands.publish(message)

    @property
    def cycles(self) -> list[int]:
        return [state.cycle for state in self.states]


@pytest.fixture
def partner() -> Iterator[Partner]:
    rclpy.init(args=["--ros-args", "--log-level", "fatal"], domain_id=int(os.environ["PHIL_TEST_DOMAIN_CATENARY"]))
    try:
        partner = Partner()
        yield partner
        partner.node.destroy_node()
        partner.partner.destroy_node()
        partner.executor.shutdown()
    finally:
        rclpy.try_shutdown()


def test_cycle_by_cycle(partner: Partner) -> None:
    partner.activate()
    assert partner.cycles[0] == 0
    model = Catenary(partner.node.parameters.config())
    for k in range(60):
        force = 100.0 + k
        partner.command(k, force)
        partner.until(lambda k=k: partner.states[-1].cycle == k + 1)  # type: ignore[misc]
        model.step(force)
        state = partner.states[-1]
        assert (state.w_cat, state.v_cat, state.a_cat, state.f_cat) == (model.w_cat, model.v_cat, model.a_cat, force)
        assert state.header.stamp.sec * 10**9 + state.header.stamp.nanosec == (k + 1001) * TS_NS
        assert state.header.frame_id == "train"
        np.testing.assert_array_equal(state.segment_displacement, model.segment_displacement)
        np.testing.assert_array_equal(state.segment_velocity, model.segment_velocity)
        np.testing.assert_array_equal(state.segment_acceleration, model.segment_acceleration)
        np.testing.assert_array_equal(state.segment_force, model.segment_force)
    assert state.droppers == model.droppers > 36
    assert state.speed == 250.0 / 3.6
    partner.until(lambda: bool(partner.models))
    reduced = partner.models[0]
    n = model.reduced.n
    assert (reduced.n, reduced.ts) == (n, 0.002)
    np.testing.assert_array_equal(np.reshape(reduced.damping, (n, n)), model.reduced.D)
    np.testing.assert_array_equal(reduced.input, model.reduced.b)
    assert f"{model.reduced.x[0]:g} to {model.reduced.x[-1]:g} m in {n // 2 - 1} Hermite" in reduced.description
    # what the controller steps with over the whole cycle has to be stable
    A, _, _ = discretise(model.reduced, reduced.ts, reduced.newmark_beta, reduced.newmark_gamma)
    assert np.abs(np.linalg.eigvals(A)).max() < 1.0
    partner.until(lambda: len(partner.shapes) == 4)
    assert [shape.cycle for shape in partner.shapes] == [0, 20, 40, 60]
    shape = partner.shapes[-1]
    view = model.wire_shape()
    np.testing.assert_array_equal(shape.x, view.x)
    np.testing.assert_array_equal(shape.contact, view.contact)
    np.testing.assert_array_equal(shape.carrier, view.carrier)
    np.testing.assert_array_equal(shape.dropper_force, view.dropper_force)
    assert len(shape.dropper_x) == len(shape.dropper_force) == model.droppers
    assert min(shape.carrier) > 0.3
    # Who sends a command again so late that the answer must have been lost gets it again; nothing else sends it now.
    shown = len(partner.states)
    partner.node._sent_at, partner.node._overdue = time.monotonic() + 60.0, -120.0
    partner.command(59, 159.0)
    partner.until(lambda: len(partner.states) > shown)
    assert partner.states[-1].cycle == 60


def test_gaps_duplicates_nonsense_and_reset(partner: Partner) -> None:
    partner.activate()
    model = Catenary(partner.node.parameters.config())
    partner.node._overdue = 60.0  # s, on a busy machine a second command may come late
    for k in (0, 1, 1, 5, 5, 2):  # 2 to 4 are missing, 1 and 5 come twice, 2 comes too late
        partner.command(k, 100.0 + k)
    partner.command(6, float("nan"))
    partner.until(lambda: partner.states[-1].cycle == 6)
    partner.spin(0.1)
    for force in (100.0, 101.0, 101.0, 101.0, 101.0, 105.0):
        model.step(force)
    assert partner.cycles == [0, 1, 2, 3, 4, 5, 6]
    assert partner.states[-1].w_cat == model.w_cat
    timing = partner.node.timing
    assert (timing.missing, timing.stale, timing.refused) == (3, 1, 1)
    # 2 came when its cycle had been bridged, behind 5; of 3 and 4 nothing came
    shown = partner.node.health.diagnosis().values
    kinds = ("late", "lost", "doubled", "swapped")
    assert [shown[f"messages {kind}"] for kind in kinds] == ["1", "2", "2", "1"]
    assert shown["input impedance_mpc/command"] == "late 1, lost 2, doubled 2, swapped 1"

    partner.spin(0.6)  # no command: the last state comes again
    assert partner.cycles[6:].count(6) >= 2

    partner.command(500, 1.0)  # too far ahead to be bridged: a stray
    partner.until(lambda: timing.refused == 2)
    found = partner.node.diagnose()
    assert found.level == b"\x01"
    assert "missing commands bridged" in found.message and found.values["bridged cycles"] == "3"
    assert "command 6 was refused: f_cat is not finite" in found.message
    assert "command 500 was refused: it is more than 100 cycles ahead of cycle 6" in found.message
    partner.command(6, 1.0)
    partner.until(lambda: partner.states[-1].cycle == 7)

    partner.command(500, 1.0)
    partner.command(501, 1.0)  # the commands go on there: the gap is real
    partner.until(lambda: timing.refused == 4)
    assert partner.states[-1].cycle == 7
    found = partner.node.diagnose()
    assert found.level == b"\x02"
    assert found.message.startswith("493 commands missing before cycle 500")
    partner.command(7, 1.0)
    partner.spin(0.1)
    assert partner.states[-1].cycle == 7

    partner.spin(QUIET)  # the base takes no reset before
    answer = partner.reset.call_async(Trigger.Request())
    partner.until(answer.done)
    assert answer.result().success
    partner.until(lambda: partner.states[-1].cycle == 0)
    partner.command(0, 100.0)
    partner.until(lambda: partner.states[-1].cycle == 1)
    assert partner.states[-1].w_cat == partner.states[1].w_cat
    assert partner.node.diagnose().level == b"\x00"
    shown = partner.node.health.diagnosis().values
    assert shown["input impedance_mpc/command"] == "late 0, lost 0, doubled 0, swapped 0"


def test_the_turnaround_of_the_last_cycles_is_sent_at_the_end(partner: Partner) -> None:
    partner.activate()
    partner.until(lambda: partner.node.count_subscribers("catenary_model/timing") == 1)
    for k in range(57):
        partner.command(k, 100.0)
        partner.until(lambda k=k: partner.states[-1].cycle == k + 1)  # type: ignore[misc]
    assert partner.node.trigger_deactivate().name == "SUCCESS"
    partner.until(lambda: len(partner.timings) == 2)
    assert [(timing.cycle, len(timing.turnaround)) for timing in partner.timings] == [(49, 50), (56, 7)]


def test_deactivated_node_starts_anew(partner: Partner) -> None:
    partner.activate()
    partner.command(0, 100.0)
    partner.until(lambda: partner.states[-1].cycle == 1)
    first = partner.states[-1].w_cat
    assert partner.node.trigger_deactivate().name == "SUCCESS"
    partner.command(1, 100.0)
    partner.spin(0.4)
    assert partner.states[-1].cycle == 1
    assert partner.node.trigger_activate().name == "SUCCESS"
    partner.until(lambda: partner.states[-1].cycle == 0)
    partner.command(0, 100.0)
    partner.until(lambda: partner.states[-1].cycle == 1)
    assert partner.states[-1].w_cat == first
    assert partner.node.trigger_deactivate().name == "SUCCESS"
    assert partner.node.trigger_cleanup().name == "SUCCESS"


@pytest.mark.slow
def test_an_unusable_line_is_refused_at_the_start(tmp_path: Path) -> None:
    """The process ends with code 2 and says parameter, file and entry."""
    mine = tmp_path / "mine.yaml"
    mine.write_text(dump_line(Line()).replace("gravity: 9.81", "gravity: 99.0"))
    command = [sys.executable, "-m", "catenary_model.node", "--ros-args", "-p", f"line:={mine}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert f"catenary_model: parameter 'line': {mine}: gravity = 99.0: allowed is" in done.stderr


def test_another_line_by_parameter(partner: Partner) -> None:
    """`ros2 param set` while the node is not active; a line that does not exist is refused with the reason."""
    node = partner.node
    refused = node.set_parameters([Parameter("line", value="no_such_line")])[0]
    assert not refused.successful
    assert "presets are" in refused.reason
    assert node.set_parameters([Parameter("line", value="alternating_spans")])[0].successful
    partner.activate()
    assert node.catenary.config.line == load_line("alternating_spans")
