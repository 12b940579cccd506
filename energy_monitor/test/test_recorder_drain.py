"""What a recorder does from turn to turn, and what it still takes after it was asked to end; the clock is made up."""

from importlib.util import find_spec

import pytest

if find_spec("rclpy") is None:
    pytest.skip("ROS is not installed", allow_module_level=True)

from energy_monitor import record


class Ride:
    """Recorder and sink of a ride that goes on for some turns; a turn lasts as long as the recorder wants it to."""

    def __init__(self, monkeypatch, messages, *arguments):
        self.now, self.count, self.error = 100.0, 7, None
        self.messages = messages
        self.complete, self.channels, self.counted, self.discovered = True, [], 0, 0
        monkeypatch.setattr(record, "monotonic", lambda: self.now)
        self.asked = []
        self.period = record.LOOK
        self.turns = record.Turns(self, self, record.arguments(arguments), self.asked)
        self.turns.pace = lambda period: setattr(self, "period", period * 1e-9)

    @property
    def received(self):
        return self.count

    def count_losses(self):
        self.counted += 1

    def discover(self):
        self.discovered += 1

    def ready(self, now):
        return now > 101.0

    def lasts(self, most=1e3):
        """Ride to the end; give how long it was, s."""
        began = self.now
        while not self.turns.done.done() and self.now - began < most:
            self.now += self.period
            self.count += self.messages > 0
            self.messages -= 1
            self.turns.take()
        return self.now - began


@pytest.mark.parametrize("messages", [0, 1, 12])
def test_it_ends_when_nothing_has_come_for_a_while(monkeypatch, messages):
    ride = Ride(monkeypatch, messages)
    ride.asked.append(2)
    # One turn more or less: QUIET is compared with sums of LOOK, and the first turn only begins.
    assert ride.lasts() == pytest.approx(messages * record.LOOK + record.QUIET, abs=2.01 * record.LOOK)
    assert ride.received == 7 + messages


def test_it_ends_though_messages_still_come(monkeypatch):
    ride = Ride(monkeypatch, 10**6)
    ride.asked.append(2)
    assert ride.lasts() == pytest.approx(record.DRAIN, abs=2.01 * record.LOOK)


def test_a_second_signal_ends_it_at_once(monkeypatch):
    ride = Ride(monkeypatch, 10**6)
    ride.asked += [2, 2]
    assert ride.lasts() <= record.LOOK


def test_a_full_disk_ends_it_at_once(monkeypatch):
    ride = Ride(monkeypatch, 10**6)
    ride.error = OSError("no space left")
    assert ride.lasts() <= record.LOOK


def test_it_goes_on_until_its_duration_is_over_and_looks_seldom(monkeypatch):
    ride = Ride(monkeypatch, 10**6, "--duration", "20")
    assert ride.lasts() == pytest.approx(20.0, abs=2.0 * record.STEADY_LOOK)
    assert ride.period == pytest.approx(record.STEADY_LOOK)
    # Once all is found it is looked whether links are enough, as often as losses are counted.
    assert ride.counted == pytest.approx(20.0 / record.COUNT, abs=2)
    assert ride.discovered == pytest.approx(20.0 / record.COUNT, abs=2)
    assert Ride(monkeypatch, 10**6).lasts(most=50.0) >= 50.0


def test_what_fails_in_a_turn_is_not_lost(monkeypatch, tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    ride = Ride(monkeypatch, 10**6, "--ready-file", str(folder / "ready"))
    folder.rmdir()
    assert ride.lasts() == pytest.approx(1.0, abs=2.0 * record.STEADY_LOOK)
    assert isinstance(ride.turns.failure, FileNotFoundError)


def test_it_waits_longer_than_messages_are_apart():
    # Fifty times a second the monitor publishes its books, ten times a second its statistics.
    assert 0.1 < record.QUIET < record.DRAIN
    assert record.LOOK <= record.QUIET / 4.0
