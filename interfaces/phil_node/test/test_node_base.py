"""What every node has from its base: a name of its own, one clock, and services that outlive their design."""

from __future__ import annotations

import inspect
import os
import sys
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from rclpy.lifecycle import TransitionCallbackReturn  # noqa: E402
from rclpy.lifecycle.node import LifecycleNodeMixin  # noqa: E402
from rclpy.serialization import deserialize_message  # noqa: E402
from std_msgs.msg import Header  # noqa: E402
from std_srvs.srv import SetBool, Trigger  # noqa: E402

from phil_node.base import PhilNode  # noqa: E402
from phil_node.executor import events_executor  # noqa: E402
from phil_node.link import Inlet, address, messages_of  # noqa: E402
from phil_node.qos import CYCLE, CYCLE_KEPT  # noqa: E402
from test_rig_sim.parameters import Parameters  # noqa: E402


class Light(PhilNode[Parameters]):
    """A node with everything that the base offers, and nothing to compute."""

    def __init__(self) -> None:
        super().__init__("test_rig_sim", Parameters)
        self.ticks = self.heard = 0
        self.serve(Trigger, "light/land", self._land)
        self.serve(SetBool, "~/set_correction", self._land)

    def build(self) -> None:
        self.every(0.001, self._tick)
        self.listen(Header, "light/word", CYCLE, self._hear)
        self.said = self.publish_on(Header, "light/said")
        self.kept = self.publish_on(Header, "light/kept", CYCLE_KEPT)

    def _tick(self) -> None:
        self.ticks += 1
        self.said.publish(Header())
        self.kept.publish(Header(frame_id=str(self.ticks)))

    def _hear(self, message: Any) -> None:
        self.heard += 1

    def _land(self, request: Any, response: Any) -> Any:
        response.success, response.message = self.active, "landed"
        return response


class Bench:
    """A light node and a client, on the executor of a ride."""

    def __init__(self, *arguments: str) -> None:
        rclpy.init(args=["--ros-args", "--log-level", "fatal", *arguments], domain_id=int(os.environ["ROS_DOMAIN_ID"]))
        self.node = Light()
        self.partner = rclpy.create_node("partner", use_global_arguments=False)
        self.executor = events_executor()
        self.executor.add_node(self.node)
        self.executor.add_node(self.partner)
        self.status: list[Any] = []
        self.partner.create_subscription(DiagnosticArray, "/diagnostics", self.status.append, 10)

    def until(self, done: Callable[[], bool], seconds: float = 10.0) -> bool:
        end = time.monotonic() + seconds
        while not done() and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.02)
        return done()

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.partner.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def bench() -> Iterator[Callable[..., Bench]]:
    made: list[Bench] = []

    def make(*arguments: str) -> Bench:
        made.append(Bench(*arguments))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.mark.slow
def test_requests_that_wait_while_the_design_goes_are_answered(bench: Callable[..., Bench]) -> None:
    """Clean-up and a rebuild with requests, messages and ticks in the queue: each is answered, none ends the node."""
    one = bench()
    clients = [
        one.partner.create_client(Trigger, "light/land"),
        one.partner.create_client(SetBool, "test_rig_sim/set_correction"),
    ]
    words = one.partner.create_publisher(Header, "light/word", CYCLE)
    for client in clients:
        assert one.until(client.service_is_ready)
    for rebuild in (False, True, False):
        assert one.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        assert one.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        ticks = one.node.ticks
        assert one.until(lambda ticks=ticks: one.node.ticks > ticks + 3 and words.get_subscription_count() == 1)
        assert one.node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
        futures = [client.call_async(client.srv_type.Request()) for client in clients for _ in range(3)]
        for _ in range(5):
            words.publish(Header())
        time.sleep(0.05)  # they are in the queue of the executor now
        if rebuild:
            one.node.changes.stale = True
            assert one.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        else:
            assert one.node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
        assert one.until(lambda futures=futures: all(future.done() for future in futures))
        answers = [future.result() for future in futures]
        if rebuild:
            assert all(answer.success for answer in answers)
            assert one.node.trigger_deactivate() == TransitionCallbackReturn.SUCCESS
            assert one.node.trigger_cleanup() == TransitionCallbackReturn.SUCCESS
        else:
            assert {(answer.success, answer.message) for answer in answers} == {
                (False, "test_rig_sim is not configured")
            }


@pytest.mark.slow
def test_who_follows_late_has_all_that_was_kept_and_what_comes_then(bench: Callable[..., Bench]) -> None:
    """Each once and in order, though it is published while the kept ones are handed over."""
    one = bench()
    assert one.node.trigger_configure() == TransitionCallbackReturn.SUCCESS
    assert one.node.trigger_activate() == TransitionCallbackReturn.SUCCESS
    assert one.until(lambda: one.node.ticks > 400)
    inlet = Inlet(address(one.node.context.get_domain_id(), "/light/kept", followed=True))
    assert inlet.connect()
    had, numbers, texts = one.node.ticks, [], []

    def read() -> bool:
        while data := inlet.receive():
            for _, number, message in messages_of(data):
                numbers.append(number)
                texts.append(deserialize_message(message, Header).frame_id)
        return len(numbers) > had + 200

    assert one.until(read)
    assert numbers == list(range(1, len(numbers) + 1))
    assert texts == [str(number) for number in numbers]
    assert one.node.kept.get_subscription_count() == 1
    inlet.close()


def test_a_fault_of_a_service_is_an_answer(bench: Callable[..., Bench]) -> None:
    one = bench()
    one.node.configured = True

    def broken(request: Any, response: Any) -> Any:
        raise ValueError("no such thing")

    one.node.serve(Trigger, "light/broken", broken)
    client = one.partner.create_client(Trigger, "light/broken")
    assert one.until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    assert one.until(future.done)
    assert (future.result().success, future.result().message) == (False, "no such thing")
    one.node.configured = False


def test_a_node_lives_without_the_clock_of_ros_and_says_so(bench: Callable[..., Bench]) -> None:
    """Under use_sim_time without /clock timers run, stamps are good, and the status tells what is missing."""
    one = bench("-p", "use_sim_time:=true", "-p", "mode:=realtime", "-r", "__ns:=/lab")
    one.node.trigger_configure()
    one.node.trigger_activate()
    assert one.node.get_clock().now().nanoseconds == 0
    assert one.until(lambda: one.node.ticks > 10 and bool(one.status))
    status = one.status[-1].status[0]
    values = {entry.key: entry.value for entry in status.values}
    assert (status.name, status.hardware_id) == ("/lab/test_rig_sim: cycle", "/lab/test_rig_sim")
    assert values["process"] == str(os.getpid())
    assert "nothing came on /clock" in values["clock"]
    assert abs(one.status[-1].header.stamp.sec - time.time()) < 10.0


def test_one_clock_for_all_that_belongs_to_no_cycle(bench: Callable[..., Bench]) -> None:
    """Lockstep: 0, then the newest t_k. Real time: the wall clock, then on from the newest t_k whatever it was."""
    one = bench()
    node, header = one.node, Header()
    header.stamp.sec, header.stamp.nanosec = 3, 500_000_000
    assert node.ride_time() == 0
    node.timing.add(0.001, header, 1750)
    assert node.ride_time() == 3_500_000_000
    node.timing.clear()
    node.parameters = SimpleNamespace(mode="realtime")  # type: ignore[assignment]
    assert abs(node.ride_time() - time.time_ns()) < 1e9
    node.timing.add(0.001, header, 1750)
    first = node.ride_time()
    time.sleep(0.01)
    assert 3_500_000_000 <= first < first + 10_000_000 <= node.ride_time() < 13_500_000_000


def test_the_transition_that_is_overridden_is_the_one_of_rclpy(bench: Callable[..., Bench]) -> None:
    """The override of a private method stands and falls with its name: this has to fail should rclpy rename it."""
    assert callable(getattr(LifecycleNodeMixin, "_LifecycleNodeMixin__change_state", None))
    node = bench().node
    assert node.trigger_activate() == TransitionCallbackReturn.FAILURE  # not configured: rclpy alone would raise
    assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS


def test_the_first_line_of_a_ride_does_not_look_through_all_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who logs is looked up by `inspect`, whose first look takes as long as 50 cycles: it is done before the ride."""
    looked: list[str] = []

    def resolve(path: str, *rest: Any, **more: Any) -> str:
        looked.append(path)
        return plain(path, *rest, **more)

    bench = Bench("--log-level", "warn")
    try:
        for known in (inspect.modulesbyfile, inspect._filesbymodname):  # type: ignore[attr-defined]
            known.clear()
        bench.node.trigger_configure()
        bench.node.trigger_activate()
        plain = os.path.realpath
        monkeypatch.setattr(os.path, "realpath", resolve)
        bench.node.log.warning("something is odd")
        monkeypatch.undo()
        assert 0 < len(looked) < 50, f"{len(looked)} of {len(sys.modules)} modules"
    finally:
        bench.close()
