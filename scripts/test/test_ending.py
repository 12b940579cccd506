"""Who waits for a child that ends does not come before all others: the kernel may wait in it for one of them."""

import os
from collections.abc import Iterator

import pytest

from energy_monitor.watch import Watch
from phil_node.topics import TopicsProcess


@pytest.fixture(autouse=True)
def first() -> Iterator[None]:
    """Have this thread scheduled by SCHED_FIFO, where the system allows it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        pytest.skip("SCHED_FIFO is not allowed here")
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def test_a_recorder_waits_for_its_guardian_in_the_ordinary_class() -> None:
    with Watch(lambda: None):
        assert os.sched_getscheduler(0) == os.SCHED_FIFO
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_a_node_waits_for_the_process_for_its_topics_in_the_ordinary_class() -> None:
    topics = TopicsProcess()
    assert os.sched_getscheduler(0) == os.SCHED_FIFO
    topics.close()
    assert os.sched_getscheduler(0) == os.SCHED_OTHER
