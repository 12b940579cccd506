"""Stopwatch and guards."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from phil_base.guard import finite, finite_array, objection
from phil_node.timing import BATCH, KINDS, STUCK, Timing


def message():
    return SimpleNamespace(header=header(0), budget=0.0)


def header(seconds):
    return SimpleNamespace(stamp=SimpleNamespace(sec=seconds, nanosec=0), frame_id="")


def test_a_batch_is_sent_when_full_and_holds_every_cycle():
    sent = []
    timing = Timing()
    timing.connect(message(), lambda m: sent.append((m.cycle, list(m.turnaround), m.late)), 0.002)
    for cycle in range(BATCH + 3):
        timing.add(0.001 * (1 + cycle % 3), header(7), cycle)
    assert [(cycle, len(values)) for cycle, values, _ in sent] == [(BATCH - 1, BATCH)]
    np.testing.assert_allclose(sent[0][1], [0.001 * (1 + c % 3) for c in range(BATCH)], rtol=1e-6)
    assert sent[0][2] == sum(c % 3 == 2 for c in range(BATCH))
    timing.flush(header(7), BATCH + 2)
    assert len(sent[1][1]) == 3


def test_what_is_left_is_sent_once_at_the_end():
    sent = []
    timing = Timing()
    timing.connect(message(), lambda m: sent.append((m.cycle, list(m.turnaround), m.header.stamp.sec)), 0.002)
    timing.finish()
    assert sent == []
    for cycle in range(BATCH + 7):
        timing.add(0.5, header(cycle), cycle)
    timing.finish()
    timing.finish()
    assert [(cycle, len(values), stamp) for cycle, values, stamp in sent] == [
        (BATCH - 1, BATCH, BATCH - 1),
        (BATCH + 6, 7, BATCH + 6),
    ]


def test_clear_forgets():
    timing = Timing()
    timing.connect(message(), lambda m: None, 0.002)
    timing.add(1.0, header(0), 0)
    timing.refused = 4
    timing.clear()
    assert (timing.late, timing.refused, timing.summary()["cycles"]) == (0, 0, "0")


@given(st.lists(st.floats(), min_size=3, max_size=3))
def test_arrays_are_refused_exactly_when_a_number_is_not_finite(values):
    out = np.zeros(3)
    huge = any(abs(v) > 1e307 for v in values)
    if not huge:
        assert finite_array(values, out) == bool(np.isfinite(values).all()) == finite(*values)


def test_a_wrong_size_is_refused():
    assert not finite_array([1.0, 2.0], np.zeros(3))


def test_reasons_are_kept_once_with_their_number():
    timing = Timing()
    for cycle in range(300, 305):
        timing.refuse(f"state {cycle} of the rig was refused: f_tr is not finite")
    timing.refuse("state 305 of the rig was refused: v_tr is not finite")
    assert timing.refusals == [
        "state 300 of the rig was refused: f_tr is not finite",
        "state 305 of the rig was refused: v_tr is not finite",
    ]
    assert timing.summary()[f"reason: {timing.refusals[0]}"] == "5"
    timing.clear()
    assert timing.refusals == []


@given(st.lists(st.text(alphabet="abc-0123456789 ", max_size=8), max_size=200))
def test_reasons_take_bounded_memory(texts):
    timing = Timing()
    for text in texts:
        timing.refuse(text)
    counted = [int(value) for key, value in timing.summary().items() if key.startswith("reason: ")]
    assert len(counted) <= KINDS + 1 and sum(counted) == len(texts)


def test_a_node_is_stuck_when_what_comes_is_refused_and_nothing_is_done(monkeypatch):
    clock = SimpleNamespace(now=10**9)
    monkeypatch.setattr("phil_node.timing.perf_counter_ns", lambda: clock.now)

    def after(seconds):
        clock.now += round(seconds * 1e9)

    timing = Timing()
    timing.refuse("one stray before the ride")
    after(2.0 * STUCK)
    assert not timing.stuck  # nobody knows whether the ride was to begin
    timing.refuse("and it goes on")
    assert timing.stuck
    timing.add(0.001, None, 0)
    assert not timing.stuck
    after(0.1)
    timing.refuse("one in the middle")
    after(0.5 * STUCK)
    assert not timing.stuck
    after(STUCK)
    assert timing.stuck  # nothing has come of it
    timing.add(0.001, None, 1)
    assert not timing.stuck


def test_what_cannot_be_used_is_named():
    message = SimpleNamespace(f_tr=float("nan"), v_tr=float("inf"), w_tr=0.0, q=[1.0, 2.0], p=[float("nan")] * 3)
    assert objection(message, ("w_tr", "f_tr")) == "f_tr is not finite"
    assert objection(message, ("f_tr", "v_tr")) == "f_tr, v_tr are not finite"
    assert objection(message, ("w_tr", "q"), 3) == "q has 2 entries, not 3"
    assert objection(message, ("q", "p"), 3) == "q has 2 entries, not 3; p is not finite"
