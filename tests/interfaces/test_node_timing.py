"""Stopwatch and guards."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from phil_node.guard import finite, finite_array
from phil_node.timing import BATCH, Timing


def message():
    return SimpleNamespace(header=SimpleNamespace(stamp=None, frame_id=""), budget=0.0)


def test_a_batch_is_sent_when_full_and_holds_every_cycle():
    sent = []
    timing = Timing()
    timing.connect(message(), lambda m: sent.append((m.cycle, list(m.turnaround), m.late)), 0.002)
    header = SimpleNamespace(stamp="t")
    for cycle in range(BATCH + 3):
        timing.add(0.001 * (1 + cycle % 3), header, cycle)
    assert [(cycle, len(values)) for cycle, values, _ in sent] == [(BATCH - 1, BATCH)]
    np.testing.assert_allclose(sent[0][1], [0.001 * (1 + c % 3) for c in range(BATCH)], rtol=1e-6)
    assert sent[0][2] == sum(c % 3 == 2 for c in range(BATCH))
    timing.flush(header, BATCH + 2)
    assert len(sent[1][1]) == 3


def test_what_is_left_is_sent_once_at_the_end():
    sent = []
    timing = Timing()
    timing.connect(message(), lambda m: sent.append((m.cycle, list(m.turnaround), m.header.stamp)), 0.002)
    timing.finish()
    assert sent == []
    for cycle in range(BATCH + 7):
        timing.add(0.5, SimpleNamespace(stamp=cycle), cycle)
    timing.finish()
    timing.finish()
    assert [(cycle, len(values), stamp) for cycle, values, stamp in sent] == [
        (BATCH - 1, BATCH, BATCH - 1),
        (BATCH + 6, 7, BATCH + 6),
    ]


def test_clear_forgets():
    timing = Timing()
    timing.connect(message(), lambda m: None, 0.002)
    timing.add(1.0, SimpleNamespace(stamp=0), 0)
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
