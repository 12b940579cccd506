"""Nodes in one process: what one sends the others take once, in order, as it was written, and in one thread."""

from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")
messages = pytest.importorskip("phil_interfaces.msg", reason="the interfaces are not built, or not sourced")

from phil_node import collector  # noqa: E402
from phil_node.box import Box  # noqa: E402
from phil_node.cdr import Plan, Reader  # noqa: E402
from phil_node.composition import Composition, Member  # noqa: E402
from phil_node.exchange import PORTION, HandedCycles, HandedFollower  # noqa: E402
from phil_node.qos import CYCLE_KEPT  # noqa: E402

SEGMENT = ("segment_displacement", "segment_velocity", "segment_acceleration", "segment_force")


class Part:
    """A node as far as a composition sees it: its lock, its member, and what went wrong in it."""

    def __init__(self, composition: Composition) -> None:
        self.errors: list[BaseException] = []
        self.lock = threading.RLock()
        self.member: Member = composition.member(self.lock, self.errors.append, self.look)
        self.receivers: list[HandedCycles | HandedFollower] = []
        self.linked: list[bool] = []

    def look(self) -> None:
        for receiver in self.receivers:
            receiver.look()

    def hear(
        self, kind: Any, name: str, callback: Callable[[Any], None], way: type[HandedCycles | HandedFollower]
    ) -> HandedCycles | HandedFollower:
        self.receivers.append(way(kind, name, self.member, callback, self.linked.append))
        return self.receivers[-1]


@pytest.fixture
def composition() -> Iterator[Composition]:
    made = Composition(None)  # type: ignore[arg-type]  # nothing is published
    yield made
    for member in made.members:
        member.stop()


def until(done: Callable[[], bool], seconds: float = 10.0) -> bool:
    end = time.monotonic() + seconds
    while not done() and time.monotonic() < end:
        time.sleep(0.002)
    return done()


def wire_state() -> Any:
    """Give the message of a wire's state as its node fills it, with arrays of three entries."""
    return Plan(messages.CatenaryState, "train", dict.fromkeys(SEGMENT, 3)).writer().message


def send(box: Box, message: Any, cycle: int) -> bytes:
    message.cycle = cycle
    message.w_cat = 0.1 * cycle
    message.header.stamp.sec, message.header.stamp.nanosec = cycle, 7
    for name in SEGMENT:
        getattr(message, name)[:] = cycle + np.arange(3.0) / 3.0
    data = message.writer.bytes()
    box.send(data)
    return bytes(data)


def test_what_is_received_is_what_would_be_read_of_the_bytes_and_stays_so_when_the_sender_goes_on(composition):
    part = Part(composition)
    got: list[Any] = []
    box = composition.exchange.open("/wire", messages.CatenaryState, 0)
    part.hear(messages.CatenaryState, "/wire", got.append, HandedCycles).look()
    part.member.start()
    message = wire_state()
    sent = [send(box, message, cycle) for cycle in range(40)]  # one message, filled anew each time
    assert until(lambda: len(got) == 40)
    for data, received in zip(sent, got, strict=True):
        expected = Reader(messages.CatenaryState).read(data)
        assert received.header.stamp.sec == expected.header.stamp.sec and received.header.frame_id == "train"
        for name, kind in messages.CatenaryState.get_fields_and_field_types().items():
            if name == "header":
                continue
            ours, theirs = getattr(received, name), getattr(expected, name)
            assert np.array_equal(np.asarray(ours), np.asarray(theirs)), (name, kind)
    with pytest.raises(ValueError, match="read-only"):
        got[-1].segment_force[0] = 1.0


def test_a_sender_is_not_called_back_while_it_sends_and_the_order_is_that_of_sending(composition):
    """Two nodes that answer each other: no call within a call, whatever comes of it."""
    first, second = Part(composition), Part(composition)
    there = composition.exchange.open("/there", messages.CatenaryState, 0)
    back = composition.exchange.open("/back", messages.CatenaryState, 0)
    outgoing, answers = wire_state(), wire_state()
    taken: list[int] = []
    inside = [0]

    def answer(message: Any) -> None:
        send(back, answers, message.cycle)

    def take(message: Any) -> None:
        inside[0] += 1
        assert inside[0] == 1
        taken.append(message.cycle)
        if message.cycle < 2000:
            send(there, outgoing, message.cycle + 1)
        inside[0] -= 1

    second.hear(messages.CatenaryState, "/there", answer, HandedCycles).look()
    first.hear(messages.CatenaryState, "/back", take, HandedCycles).look()
    for part in (first, second):
        part.member.start()
    send(there, outgoing, 0)
    assert until(lambda: len(taken) == 2001)
    assert taken == list(range(2001))
    assert not first.errors and not second.errors


def test_all_is_done_by_one_thread_with_the_lock_of_the_node_that_is_called(composition):
    part = Part(composition)
    threads: list[str] = []

    def take(message: Any) -> None:
        assert part.lock._is_owned()  # type: ignore[attr-defined]
        threads.append(threading.current_thread().name)

    box = composition.exchange.open("/wire", messages.CatenaryState, 0)
    part.hear(messages.CatenaryState, "/wire", take, HandedCycles).look()
    timer = part.member.timer(0.001, lambda: take(None))
    part.member.start()
    timer.reset()
    send(box, wire_state(), 0)
    assert until(lambda: len(threads) > 3)
    assert set(threads) == {"cycle"} and not part.errors


def test_who_follows_gets_all_and_what_was_kept_and_who_waits_gets_what_comes_from_now_on(composition):
    early, late = Part(composition), Part(composition)
    box = composition.exchange.open("/wire", messages.CatenaryState, CYCLE_KEPT.depth)
    got: dict[str, list[int]] = {"peer": [], "follower": []}
    early.member.start()
    message = wire_state()
    for cycle in range(3):
        send(box, message, cycle)
    assert until(lambda: len(box.kept or ()) == 3)
    peer = late.hear(messages.CatenaryState, "/wire", lambda m: got["peer"].append(m.cycle), HandedCycles)
    follower = late.hear(messages.CatenaryState, "/wire", lambda m: got["follower"].append(m.cycle), HandedFollower)
    for receiver in (peer, follower):
        receiver.look()
    follower.drain()
    assert got == {"peer": [], "follower": [0, 1, 2]} and late.linked == [True, True]
    late.member.start()
    for cycle in range(3, 3 + 3 * PORTION):
        send(box, message, cycle)
    assert until(lambda: len(got["follower"]) == 3 + 3 * PORTION)
    assert got["follower"] == list(range(3 + 3 * PORTION)) and got["peer"] == got["follower"][3:]


def test_a_node_that_is_not_running_takes_nothing_and_one_that_left_is_not_linked(composition):
    on, off = Part(composition), Part(composition)
    box = composition.exchange.open("/wire", messages.CatenaryState, 0)
    got: list[str] = []
    for part, name in ((on, "on"), (off, "off")):
        part.hear(messages.CatenaryState, "/wire", lambda message, name=name: got.append(name), HandedCycles).look()
    on.member.start()
    message = wire_state()
    send(box, message, 0)
    assert until(lambda: got == ["on"])
    on.receivers[0].close()
    assert not on.receivers[0].linked and on.linked == [True, False] and len(box.peers) == 1
    box.close()
    assert off.linked == [True, False] and not box.peers


def test_the_same_bytes_by_the_topic_are_taken_once_and_a_stranger_is_heard(composition):
    part = Part(composition)
    got: list[int] = []
    box = composition.exchange.open("/wire", messages.CatenaryState, 0)
    receiver = part.hear(messages.CatenaryState, "/wire", lambda m: got.append(m.cycle), HandedCycles)
    receiver.look()
    part.member.start()
    message = wire_state()
    data = send(box, message, 1)
    assert until(lambda: got == [1])
    with part.lock:
        receiver.from_topic(data)
    assert got == [1]
    message.cycle = 9
    with part.lock:
        receiver.from_topic(message.writer.bytes())
    assert got == [1, 9]


def test_what_goes_wrong_in_one_node_is_told_to_that_node_and_ends_the_thread(composition):
    good, bad = Part(composition), Part(composition)
    got: list[int] = []

    def fail(message: Any) -> None:
        raise ZeroDivisionError("a node's own mistake")

    box = composition.exchange.open("/wire", messages.CatenaryState, 0)
    good.hear(messages.CatenaryState, "/wire", lambda m: got.append(m.cycle), HandedCycles).look()
    bad.hear(messages.CatenaryState, "/wire", fail, HandedCycles).look()
    for part in (good, bad):
        part.member.start()
    send(box, wire_state(), 0)
    assert until(lambda: bool(bad.errors))
    assert isinstance(bad.errors[0], ZeroDivisionError) and not good.errors and got == [0]
    send(box, wire_state(), 1)
    time.sleep(0.05)
    assert got == [0]


def test_a_timer_of_a_node_that_stopped_is_silent_while_the_others_go_on(composition):
    one, other = Part(composition), Part(composition)
    calls = {"one": 0, "other": 0}

    def count(name: str) -> Callable[[], None]:
        def call() -> None:
            calls[name] += 1

        return call

    timers = [one.member.timer(0.002, count("one")), other.member.timer(0.002, count("other"))]
    for part, timer in zip((one, other), timers, strict=True):
        part.member.start()
        timer.reset()
    assert until(lambda: min(calls.values()) > 2)
    one.member.stop()
    silent = calls["one"]
    before = calls["other"]
    assert until(lambda: calls["other"] > before + 3)
    assert calls["one"] == silent


def test_the_collector_works_again_when_the_last_node_lets_it(monkeypatch):
    # Another test's node may still be active in this process: here nobody holds the collector at first.
    monkeypatch.setattr(collector, "_HELD_BY", weakref.WeakSet())
    gc.enable()
    first, second = Holder(), Holder()
    collector.hold(first)
    collector.hold(second)
    collector.release(first)
    assert not gc.isenabled()
    collector.release(second)
    assert gc.isenabled()


class Holder:
    """Something that can be held weakly."""
