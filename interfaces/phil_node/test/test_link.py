"""The link between nodes of the loop: each message once, whichever way it comes; who may link; peers that go."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")
messages = pytest.importorskip("phil_interfaces.msg", reason="the interfaces are not built, or not sourced")

from rclpy.serialization import serialize_message  # noqa: E402

from phil_node.cycle_thread import CycleThread  # noqa: E402
from phil_node.link import (  # noqa: E402
    BATCH,
    QUEUE,
    RECORD,
    WAITING,
    Inlet,
    Outlet,
    address,
    batches,
    messages_of,
)
from phil_node.once import REMEMBERED, Once  # noqa: E402
from phil_node.paths import CycleReceiver  # noqa: E402

NUMBERS = count()


def name() -> str:
    return address(os.getpid() % 1000, f"/test/{next(NUMBERS)}")


def until(done: Callable[[], bool], seconds: float = 5.0) -> bool:
    end = time.monotonic() + seconds
    while not done() and time.monotonic() < end:
        time.sleep(0.005)
    return done()


@cache
def state(cycle: int) -> bytes:
    """Give a state as the sender has it: written once for both ways (what rclpy writes between fields is left over)."""
    message = messages.RigState(cycle=cycle, f_tr=50.0 + cycle)
    message.header.frame_id = "rig"
    return bytes(serialize_message(message))


class Receiving:
    """A receiver in its thread, as a node has it."""

    def __init__(self, name: str) -> None:
        self.cycles: list[int] = []
        self.errors: list[BaseException] = []
        self.lock = threading.RLock()
        self.thread = CycleThread(self.lock, self.errors.append, lambda: self.receiver.look())
        self.receiver = CycleReceiver(
            messages.RigState, Inlet(name), self.thread, lambda message: self.cycles.append(message.cycle)
        )
        self.thread.start()

    def from_topic(self, data: bytes) -> None:
        with self.lock:
            self.receiver.from_topic(data)

    def close(self) -> None:
        self.thread.stop()
        self.receiver.close()
        assert not self.errors


@pytest.fixture
def linked() -> Iterator[tuple[Outlet, Receiving, str]]:
    where = name()
    outlet = Outlet(where)
    receiving = Receiving(where)
    assert until(lambda: receiving.receiver.linked)
    outlet.accept()
    assert len(outlet.peers) == 1
    yield outlet, receiving, where
    receiving.close()
    outlet.close()


def test_message_that_comes_both_ways_is_taken_once(linked: Any) -> None:
    """By the link first, by the topic first, and by the topic alone where the link lost it."""
    outlet, receiving, _ = linked
    for cycle in range(3):
        outlet.send(state(cycle))
    assert until(lambda: receiving.cycles == [0, 1, 2])
    for cycle in range(4):
        receiving.from_topic(state(cycle))
    assert receiving.cycles == [0, 1, 2, 3]
    outlet.send(state(3))
    outlet.send(state(4))
    assert until(lambda: receiving.cycles[-1] == 4)
    assert receiving.cycles == [0, 1, 2, 3, 4]


def test_what_is_sent_again_is_taken_again_and_a_stranger_is_heard(linked: Any) -> None:
    """A repeated state reaches the node twice, not four times; another one of its cycle is judged by the node."""
    outlet, receiving, _ = linked
    for _ in range(2):
        outlet.send(state(7))
    assert until(lambda: receiving.cycles == [7, 7])
    receiving.from_topic(state(7))
    stranger = messages.RigState(cycle=7, f_tr=-1.0)
    receiving.from_topic(bytes(serialize_message(stranger)))
    assert receiving.cycles == [7, 7, 7]


def test_sender_that_goes_is_linked_again_when_it_comes_back(linked: Any) -> None:
    """The name is free at once; the topic goes on meanwhile."""
    outlet, receiving, where = linked
    outlet.close()
    assert until(lambda: not receiving.receiver.linked)
    receiving.from_topic(state(1))
    again = Outlet(where)
    assert again.alone
    assert until(lambda: receiving.receiver.linked)
    again.accept()
    again.send(state(2))
    assert until(lambda: receiving.cycles == [1, 2])
    again.close()


def test_peer_that_is_held_up_gets_all_in_order_afterwards_and_costs_no_time() -> None:
    """What the kernel has no room for waits; a peer that reads meanwhile has each at once; who is gone is forgotten."""
    where = name()
    outlet, stopped, reading = Outlet(where), Inlet(where), Inlet(where)
    assert stopped.connect() and reading.connect()
    outlet.accept()
    sent = 2 * QUEUE // 2000
    for number in range(sent):
        data = number.to_bytes(4, "little") * 500
        outlet.send(data)
        assert reading.receive() == data
    got = []
    while len(got) < sent:
        while (data := stopped.receive()) is not None:
            got.append(int.from_bytes(data[:4], "little"))
        outlet.go_on()
    assert got == list(range(sent)) and outlet.dropped == 0
    stopped.close()
    outlet.send(b"gone")
    assert len(outlet.peers) == 1
    reading.close()
    outlet.close()


def test_peer_that_stands_loses_the_oldest_and_they_are_counted() -> None:
    where = name()
    outlet, stopped = Outlet(where), Inlet(where)
    assert stopped.connect()
    outlet.accept()
    data = bytes(20_000)
    sent = WAITING + 4 * QUEUE // len(data)
    for _ in range(sent):
        outlet.send(data)
    assert 0 < outlet.dropped <= 4 * QUEUE // len(data)
    stopped.close()
    outlet.send(data)
    assert not outlet.peers and outlet.dropped > 0
    outlet.close()


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 2**32 - 1), st.binary(max_size=40_000)), max_size=8))
def test_batches_hold_all_messages_in_their_order(messages: list[tuple[int, int, bytes]]) -> None:
    """Whatever their sizes: together again they are what went in, and no batch is much longer than it should be."""
    made = batches(messages)
    assert [message for batch in made for message in messages_of(batch)] == messages
    assert all(len(batch) <= BATCH + 40_000 + RECORD.size for batch in made)


@given(st.binary(min_size=1, max_size=300), st.integers(1, 300))
def test_batch_that_is_cut_off_is_refused(data: bytes, cut: int) -> None:
    (batch,) = batches([(1, 2, data)])
    with pytest.raises(ValueError, match="cut off"):
        messages_of(batch[: max(1, len(batch) - cut)])


def test_second_sender_of_a_topic_has_no_link() -> None:
    """It does not take the peers away from the first."""
    where = name()
    first, second = Outlet(where), Outlet(where)
    assert first.alone and not second.alone
    second.close()
    first.close()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can start a process of another user")
def test_process_of_another_user_is_not_linked() -> None:
    """The kernel tells whose process is at the other end."""
    where = name()
    outlet = Outlet(where)
    code = (
        "import os, socket, sys; os.setuid(65534); s = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET);"
        "s.connect(chr(0) + sys.argv[1]); print('in', flush=True); sys.exit(s.recv(9) != b'')"
    )
    child = subprocess.Popen([sys.executable, "-I", "-c", code, where[1:]], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None and child.stdout.readline() == "in\n"
    outlet.accept()
    assert not outlet.peers
    assert child.wait(10) == 0
    child.stdout.close()
    outlet.close()


@given(st.lists(st.tuples(st.integers(0, 3), st.booleans()), max_size=40))
def test_what_comes_both_ways_is_new_as_often_as_it_was_sent(arrivals: list[tuple[int, bool]]) -> None:
    """In any order: of a message that came n times by one way and m by the other, the larger number are new."""
    once, new = Once(), dict.fromkeys(range(4), 0)
    for number, by_link in arrivals:
        data = bytes([number])
        new[number] += once.from_link(data) if by_link else once.from_topic(data)
    for number, times in new.items():
        came = [by_link for each, by_link in arrivals if each == number]
        assert times == max(sum(came), len(came) - sum(came))


@pytest.mark.parametrize("first", [Once.from_link, Once.from_topic])
def test_so_many_are_remembered_and_no_more(first: Callable[[Once, bytes], bool]) -> None:
    """Those that came long ago are new again by the other way; all others came already."""
    once, other = Once(), Once.from_topic if first == Once.from_link else Once.from_link
    data = [number.to_bytes(4, "little") for number in range(REMEMBERED + 7)]
    assert all(first(once, each) for each in data)
    assert [other(once, each) for each in data] == [True] * 7 + [False] * REMEMBERED


def test_what_comes_one_way_takes_no_memory_with_time() -> None:
    """A topic of one message a second would grow for an hour and a half otherwise: 5000 entries are 0.7 MB."""
    once = Once()
    tracemalloc.start()
    try:
        once.from_link(b"first")
        before = tracemalloc.get_traced_memory()[0]
        assert all(once.from_link(number.to_bytes(4, "little")) for number in range(4000))
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 2000
