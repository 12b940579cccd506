"""Answers of services whose client cannot hear them yet, or never: real clients over real DDS."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger

from phil_node import answers as module
from phil_node.answers import LOST, Answers

pytestmark = pytest.mark.integration

DEAF = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Wants answers kept for it: no server of ROS offers that, so the two never match."""


class Pair:
    """A node that serves, and one that asks."""

    def __init__(self) -> None:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        self.server, self.asker = rclpy.create_node("server"), rclpy.create_node("asker")
        self.executor = SingleThreadedExecutor()
        for node in (self.server, self.asker):
            self.executor.add_node(node)
        self.lost: list[str] = []
        self.served = 0
        service = self.server.create_service(Trigger, "go", self._serve)
        self.answers = Answers(self.server, self.lost.append)
        self.answers.take_over([service])

    def _serve(self, request: Any, response: Any) -> Any:
        self.served += 1
        response.success = True
        return response

    def until(self, condition: Callable[[], bool], seconds: float = 20.0) -> bool:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and not condition():
            self.executor.spin_once(timeout_sec=0.01)
        return condition()

    def close(self) -> None:
        self.executor.shutdown()
        for node in (self.server, self.asker):
            node.destroy_node()
        rclpy.try_shutdown()


@pytest.fixture
def pair() -> Iterator[Pair]:
    made = Pair()
    yield made
    made.close()


def test_who_hears_has_its_answer_at_once(pair: Pair) -> None:
    client = pair.asker.create_client(Trigger, "go")
    assert pair.until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    assert pair.until(future.done) and future.result().success
    assert len(pair.answers) == pair.answers.given_up == 0


def test_a_deaf_client_is_given_up_and_told_of(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LIMIT", 0.3)
    client = pair.asker.create_client(Trigger, "go", qos_profile=DEAF)
    # Not ready in its own eyes: it has no reader of answers that would match.
    assert pair.until(lambda: pair.server.count_clients("go") == 1)
    assert pair.until(lambda: bool(client.call_async(Trigger.Request())) and pair.served > 0)
    assert len(pair.answers) == pair.served
    assert pair.until(lambda: pair.answers.given_up == pair.served)
    assert set(pair.lost) == {"/go"} and len(pair.answers) == 0


def deaf_at_first(times: int) -> tuple[Callable[[], None], list[int]]:
    """Give what sends like rclpy to a client that hears from the ``times``-th time on, and its tries."""
    tries: list[int] = []

    def send() -> None:
        tries.append(len(tries))
        if len(tries) <= times:
            warnings.warn(f"{LOST} (timeout)", RuntimeWarning, stacklevel=1)

    return send, tries


def test_it_is_sent_again_until_it_is_heard_and_then_no_more(pair: Pair) -> None:
    send, tries = deaf_at_first(3)
    pair.answers.send("go", send)
    assert pair.until(lambda: len(pair.answers) == 0)
    pair.until(lambda: False, 0.2)
    assert len(tries) == 4 and pair.answers.given_up == 0


def test_not_more_wait_than_there_is_room_for(pair: Pair) -> None:
    """The oldest go first: a flood of requests that nobody can answer costs a bounded time and memory."""
    for number in range(module.MOST + 3):
        pair.answers.send(str(number), deaf_at_first(10**6)[0])
    assert len(pair.answers) == module.MOST
    assert pair.lost == ["0", "1", "2"]
