"""How a node's process works until its end: one turn of the executor, whatever ends it; the executor is made up."""

from importlib.util import find_spec

import pytest

if find_spec("rclpy") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

from rclpy.task import Future

from phil_node import process


class Node:
    """Node, executor and ending in one: after three looks of the timer something happens."""

    steady = None

    def __init__(self, happens):
        self.finished, self.failure, self.asked = Future(), None, False
        self.happens, self.looks, self.turns = happens, 0, 0

    def create_timer(self, period, callback, clock):
        assert 0.05 <= period <= 0.5
        self.look = callback

    def spin_until_future_complete(self, future, timeout_sec):
        self.turns += 1
        while not future.done():
            self.looks += 1
            if self.looks == 3:
                self.happens(self)
            if not future.done():
                self.look()
            assert self.looks < 10


@pytest.mark.parametrize(
    "happens",
    [
        lambda node: setattr(node, "asked", True),
        lambda node: setattr(node, "failure", RuntimeError()),
        lambda node: node.finished.set_result(None),
        lambda node: setattr(Context, "ok", False),
    ],
)
def test_a_node_works_in_one_turn_until_something_ends_it(monkeypatch, happens):
    monkeypatch.setattr(Context, "ok", True)
    monkeypatch.setattr(process.rclpy, "ok", lambda: Context.ok)
    node = Node(happens)
    process._spin([node], node, node)
    assert node.looks == 3 and node.turns == 1


class Context:
    ok = True


class Ended:
    """A node when its process ends."""

    def __init__(self, name: str, failure: BaseException | None = None, active: bool = False, over: bool = False):
        self.full_name, self.failure, self.active = name, failure, active
        self.finished = Future()
        if over:
            self.finished.set_result(None)


def test_of_nodes_in_one_process_the_one_that_ended_all_is_named(capsys):
    wrong = ZeroDivisionError("a cycle's mistake")
    assert process._outcome([Ended("/one", active=True), Ended("/two", wrong)]) == 1
    said = capsys.readouterr().err.splitlines()
    assert said[-1] == "/two failed, and with it all nodes of its process: ZeroDivisionError: a cycle's mistake"
    assert said[0] == "ZeroDivisionError: a cycle's mistake"  # with its places, if it has been raised
    assert process._outcome([Ended("/one", active=True), Ended("/two", over=True)]) == 1
    assert capsys.readouterr().err == "/two was shut down, and with it the other nodes of its process\n"
    assert process._outcome([Ended("/one", over=True), Ended("/two", over=True)]) == 0
    assert process._outcome([Ended("/one"), Ended("/two")]) == 0  # asked to end by a signal
    assert capsys.readouterr().err == ""
    with pytest.raises(ZeroDivisionError):
        process._outcome([Ended("/one", wrong)])
