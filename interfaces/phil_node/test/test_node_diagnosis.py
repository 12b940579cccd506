"""Levels, rates and the bound of the log; what the nodes say is in their own tests."""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

rclpy = pytest.importorskip("rclpy")
pytest.importorskip("phil_interfaces", reason="the interfaces are not built, or not sourced")

from rclpy.lifecycle import TransitionCallbackReturn  # noqa: E402

from phil_node import bounded_log, diagnosis  # noqa: E402
from phil_node.base import PhilNode  # noqa: E402
from phil_node.bounded_log import MOST, PERIOD, BoundedLog  # noqa: E402
from phil_node.diagnosis import ERROR, EVERY, LOOK, OK, STALE, WARN, Diagnosis, Reporter, worst  # noqa: E402
from phil_node.timing import KINDS  # noqa: E402
from test_rig_sim.parameters import Parameters  # noqa: E402

LEVELS = st.sampled_from([OK, WARN, STALE, ERROR])


class Mute(PhilNode[Parameters]):
    """A node that says what a test wants, and nothing else."""

    def __init__(self) -> None:
        super().__init__("test_rig_sim", Parameters)
        self.fault, self.said, self.gone = "no model", Diagnosis(), ""

    def build(self) -> None:
        if self.fault:
            raise RuntimeError(self.fault)

    def diagnose(self) -> Diagnosis:
        return Diagnosis(self.said.level, self.said.message, dict(self.said.values))

    def silence(self) -> str:
        return self.gone


@pytest.fixture
def mute() -> Iterator[Mute]:
    arguments = ["--ros-args", "--log-level", "fatal", "-r", "__ns:=/diagnosed"]
    rclpy.init(args=arguments, domain_id=int(os.environ["ROS_DOMAIN_ID"]))
    made = Mute()
    yield made
    made.destroy_node()
    rclpy.try_shutdown()


def test_a_node_says_why_it_refused_until_it_did_not(mute: Mute) -> None:
    signs = mute.health.signs()
    assert mute.trigger_configure() == TransitionCallbackReturn.FAILURE
    assert mute.health.signs() != signs  # told at once
    found = mute.health.diagnosis()
    assert (found.level, found.message) == (WARN, "cannot configure: no model")
    mute.fault = ""
    assert mute.trigger_configure() == TransitionCallbackReturn.SUCCESS
    found = mute.health.diagnosis()
    assert (found.level, found.message) == (OK, "configured")


@pytest.mark.slow
def test_a_node_to_which_nothing_comes_is_stale_but_an_error_stays_one(mute: Mute) -> None:
    mute.fault = ""
    mute.trigger_configure()
    mute.trigger_activate()
    assert mute.health.diagnosis().level == OK
    signs, mute.gone = mute.health.signs(), "no state since cycle 7"
    assert mute.health.signs() != signs
    found = mute.health.diagnosis()
    assert (found.level, found.message) == (STALE, "no state since cycle 7")
    mute.said = Diagnosis(ERROR, "emergency stop")
    found = mute.health.diagnosis()
    assert (found.level, found.message) == (ERROR, "emergency stop; no state since cycle 7")
    mute.said, mute.gone = Diagnosis(), ""
    assert mute.health.diagnosis().level == OK
    mute.trigger_deactivate()


def test_another_node_of_the_name_is_told(mute: Mute, monkeypatch: pytest.MonkeyPatch) -> None:
    assert mute.health.diagnosis().level == OK
    monkeypatch.setattr(mute, "count_services", lambda name: 2 if name == "/diagnosed/test_rig_sim/reset" else 0)
    found = mute.health.diagnosis()
    assert found.level == WARN and "another node on this ROS domain is called /diagnosed/test_rig_sim" in found.message


class Clock:
    """A clock that a test moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    made = Clock()
    monkeypatch.setattr(diagnosis, "monotonic", made)
    monkeypatch.setattr(bounded_log, "monotonic", made)
    return made


class Speaker:
    """What a Reporter needs of a node; `sent` has a level and a sentence each."""

    def __init__(self) -> None:
        self.sent: list[tuple[bytes, str]] = []
        self.found = Diagnosis()
        name = "/rig_a/test_rig_sim"
        self.reporter = Reporter(name, self._take, lambda: self.found, lambda: (self.found.level,), lambda: 0)

    def _take(self, message: Any) -> None:
        (status,) = message.status
        assert (status.name, status.hardware_id) == ("/rig_a/test_rig_sim: cycle", "/rig_a/test_rig_sim")
        self.sent.append((status.level, status.message))


@given(st.lists(st.tuples(LEVELS, st.sampled_from("abc")), max_size=6))
def test_the_level_is_the_worst_and_its_sentence_stands_first(said: list[tuple[bytes, str]]) -> None:
    found = Diagnosis()
    for level, text in said:
        found.add(level, text)
    assert found.level == worst(OK, *(level for level, _ in said))
    if found.level != OK:
        first = found.message.split("; ")[0]
        assert any((level, text) == (found.level, first) for level, text in said)
        assert "active" not in found.message or said[0][0] == OK


def test_an_error_is_worse_than_stale() -> None:
    assert worst(STALE, ERROR, WARN) == ERROR and worst(STALE, WARN, OK) == STALE


def test_once_a_second_and_at_once_on_a_change(clock: Clock) -> None:
    speaker = Speaker()
    for _ in range(50):
        speaker.reporter.look()
        clock.now += LOOK
    assert len(speaker.sent) == pytest.approx(50 * LOOK / EVERY, abs=1)
    before = len(speaker.sent)
    speaker.found = Diagnosis(ERROR, "emergency stop")
    speaker.reporter.look()
    assert speaker.sent[before:] == [(ERROR, "emergency stop")]


def test_the_last_incident_is_as_old_as_the_last_rise_of_a_counter(clock: Clock) -> None:
    reporter = Speaker().reporter
    assert reporter.since_last(late=0, stale=0) == "-"
    assert reporter.since_last(late=1, stale=0) == "0"
    clock.now += 7.0
    assert reporter.since_last(late=1, stale=0) == "7"
    assert reporter.since_last(late=1, stale=3) == "0"
    assert reporter.since_last(late=0, stale=0) == "-"  # reset


@given(texts=st.lists(st.integers(0, 10**6).map("cannot do {}".format) | st.text("abc", max_size=3), max_size=400))
def test_a_flood_is_bounded_and_counted(texts: list[str]) -> None:
    lines: list[str] = []
    log = BoundedLog(lambda: SimpleNamespace(error=lines.append))
    with pytest.MonkeyPatch.context() as patch:
        now = [5.0]
        patch.setattr(bounded_log, "monotonic", lambda: now[0])
        for text in texts:
            log.error(text)
        assert len(lines) <= (KINDS + 1) * MOST
        left_out = sum("cannot" in text for text in texts) - sum("cannot" in line for line in lines)
        now[0] += PERIOD + 1.0
        log.error("cannot do 7")
    if left_out and len({t for t in texts if "cannot" not in t}) < KINDS:
        assert lines[-1] == f"cannot do 7 ({left_out} lines like this were left out)"
