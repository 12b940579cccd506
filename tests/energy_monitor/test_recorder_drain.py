"""What a recorder still takes after it was asked to end; the clock is made up."""

from importlib.util import find_spec

import pytest

if find_spec("rclpy") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

from energy_monitor import record


class Executor:
    """Each spin lasts LOOK; while the ride still talks, a message comes in each."""

    def __init__(self, monkeypatch, messages):
        self.now, self.spins, self.received, self.error = 100.0, 0, 7, None
        self.messages = messages
        monkeypatch.setattr(record, "monotonic", lambda: self.now)

    def spin_until_future_complete(self, future, timeout_sec):
        assert timeout_sec == record.LOOK
        self.now += timeout_sec
        self.spins += 1
        self.received += self.spins <= self.messages


def lasted(executor, asked):
    """Drain; the executor stands for the sink as well."""
    began = executor.now
    record._drain(executor, executor, asked)
    return executor.now - began


@pytest.mark.parametrize("messages", [0, 1, 12])
def test_it_ends_when_nothing_has_come_for_a_while(monkeypatch, messages):
    executor = Executor(monkeypatch, messages)
    # One spin more or less: QUIET is compared with sums of LOOK.
    assert lasted(executor, [2]) == pytest.approx(messages * record.LOOK + record.QUIET, abs=1.01 * record.LOOK)
    assert executor.received == 7 + messages


def test_it_ends_though_messages_still_come(monkeypatch):
    executor = Executor(monkeypatch, 10**6)
    assert lasted(executor, [2]) == pytest.approx(record.DRAIN, abs=1.01 * record.LOOK)


def test_a_second_signal_ends_it_at_once(monkeypatch):
    assert lasted(Executor(monkeypatch, 10**6), [2, 2]) == 0.0


def test_a_full_disk_ends_it_at_once(monkeypatch):
    executor = Executor(monkeypatch, 10**6)
    executor.error = OSError("no space left")
    assert lasted(executor, [2]) == 0.0


def test_it_waits_longer_than_messages_are_apart():
    # Fifty times a second the monitor publishes its books, ten times a second its statistics.
    assert 0.1 < record.QUIET < record.DRAIN
    assert record.LOOK <= record.QUIET / 4.0
