"""Lost messages by the numbers that publishers give them: the law, and what the middleware says of real ones."""

import time
from importlib.util import find_spec

import pytest
from hypothesis import given
from hypothesis import strategies as st

from energy_monitor.definitions import Definition
from energy_monitor.losses import NUMBER, Numbers
from energy_monitor.record import complaint, summary
from energy_monitor.recorder import Channel

A, B = b"a", b"b"


def watched(*publishers):
    """Numbers, a function that has messages with such numbers come, and those that were handed on."""
    numbers, taken = Numbers(frozenset(publishers)), []
    take = numbers.watch(taken.append)

    def come(*several):
        for number in several:
            take(number, {NUMBER: number})

    return numbers, come, taken


@given(st.sets(st.integers(1, 200), min_size=1), st.lists(st.integers(0, 200), max_size=5))
def test_of_one_publisher_every_gap_between_first_and_last_is_a_loss(arrived, looks):
    numbers, come, taken = watched(A)
    lost = 0
    for number in sorted(arrived):
        come(number)
        if number in looks:
            lost += numbers.settle(frozenset({A}))
    lost += numbers.settle(frozenset())  # the ride is over: who published has gone
    assert lost == max(arrived) - min(arrived) + 1 - len(arrived)
    assert numbers.counted and taken == sorted(arrived)


@given(st.lists(st.booleans(), min_size=2, max_size=100), st.integers(1, 50), st.integers(1, 50))
def test_of_several_publishers_nothing_counts_as_lost(order, first, second):
    numbers, come, taken = watched(A, B)
    next_of = {True: first, False: second}
    for who in order:
        come(next_of[who])
        next_of[who] += 1
    assert numbers.settle(frozenset({A, B})) == 0 and not numbers.counted
    assert len(taken) == len(order)


def test_a_publisher_that_takes_the_place_of_another_loses_nothing():
    for first in (1, 11, 500):
        numbers, come, _ = watched(A)
        come(*range(1, 11))
        come(*range(first, first + 10))
        assert numbers.settle(frozenset({B})) == 0
        come(first + 12)  # from now on B is the one
        assert numbers.settle(frozenset({B})) == 2


def test_a_visitor_is_no_loss_and_counting_goes_on_after_it():
    numbers, come, _ = watched(A)
    come(5, 6, 1, 7, 2)
    assert numbers.unsettled and numbers.settle(frozenset({A, B})) == 0
    come(8, 3)
    assert numbers.settle(frozenset({A, B})) == 0
    come(9)
    assert numbers.settle(frozenset({A})) == 0  # the last look that may have seen both
    come(10, 12)
    assert numbers.settle(frozenset({A})) == 1 and not numbers.counted


def test_one_that_came_and_went_between_two_looks_is_no_loss():
    numbers, come, _ = watched(A)
    come(5, 1, 6)
    assert numbers.settle(frozenset({A})) == 0


def test_a_middleware_that_does_not_count_is_told():
    numbers, come, taken = watched(A)
    come(None, None, None)
    assert not numbers.unsettled and not numbers.counted and len(taken) == 3


class Sink:
    def add(self, channel):
        return lambda data: None


class Recorded:
    refused, undefined, absent = {}, {}, []

    def __init__(self, channels):
        self.channels = channels


def test_what_could_not_be_counted_is_said(tmp_path):
    channels = [Channel("/a", "t", Definition("", ""), lost=2), Channel("/b", "t", Definition("", ""), counted=False)]
    lines = summary(Recorded(channels), tmp_path, 1.0).splitlines()
    assert [line for line in lines if "not counted" in line and "/b" in line and "/a" not in line]
    assert complaint(channels) == "2 messages were lost, the bag has gaps: /a 2"


@pytest.mark.integration
@pytest.mark.skipif(find_spec("rclpy") is None, reason="rclpy is not installed")
def test_real_messages_are_numbered_by_each_publisher_and_overwritten_ones_are_found():
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.experimental import EventsExecutor
    from rclpy.qos import QoSProfile
    from std_msgs.msg import Int64

    from energy_monitor.listening import RideRecorder, identities
    from phil_node.executor import with_info

    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node("numbers", context=context, enable_rosout=False, start_parameter_services=False)
    try:
        for number, make in enumerate((SingleThreadedExecutor, EventsExecutor)):
            executor, topic = make(context=context), f"numbers_{number}"
            publisher = node.create_publisher(Int64, topic, QoSProfile(depth=100))
            found = node.get_publishers_info_by_topic(topic)
            while not found:
                time.sleep(0.02)
                found = node.get_publishers_info_by_topic(topic)
            numbers, taken = Numbers(identities(found)), []
            node.create_subscription(
                Int64, topic, with_info(numbers.watch(taken.append)), QoSProfile(depth=10), raw=True
            )
            while publisher.get_subscription_count() == 0:
                time.sleep(0.02)
            executor.add_node(node)

            def spin(count, executor=executor, taken=taken):
                deadline = time.monotonic() + 5.0
                while len(taken) < count and time.monotonic() < deadline:
                    executor.spin_once(timeout_sec=0.02)

            publisher.publish(Int64(data=0))
            spin(1)
            for value in range(1, 31):  # the subscription keeps 10 of them
                publisher.publish(Int64(data=value))
            time.sleep(0.2)
            spin(11)
            publisher.publish(Int64(data=31))
            spin(12)
            assert len(taken) == 12 and numbers.settle(identities(node.get_publishers_info_by_topic(topic))) == 20
            executor.remove_node(node)
            executor.shutdown()
        events = set(node.waitables)
        recorder = RideRecorder(node, Sink(), ["numbers_1"], [], False)
        recorder.discover()
        recorder.count_losses()
        assert [channel.topic for channel in recorder.channels] == ["/numbers_1"] and recorder.channels[0].counted
        assert set(node.waitables) == events  # what the middleware would lock itself with
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)
