"""Late, lost, doubled, swapped: whatever comes in whatever order, the counts add up."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phil_base.cycle_counts import GAPS, CycleCounts
from phil_node.timing import BATCH, Timing

ORDERS = st.lists(st.integers(0, 30), max_size=60)


def counted(cycles):
    counts = CycleCounts()
    return counts, [counts.take(cycle) for cycle in cycles]


def shown(counts):
    return counts.lost, counts.doubled, counts.swapped


@pytest.mark.parametrize(
    ("cycles", "wanted"),
    [
        (range(5), (0, 0, 0)),
        ((0, 1, 4, 5), (2, 0, 0)),
        ((0, 1, 1, 0, 2), (0, 2, 0)),
        ((0, 2, 1, 3), (0, 0, 1)),
        ((3, 2, 1, 0, 4), (0, 0, 3)),
        ((0, 5, 3, 3, 6), (3, 1, 1)),
        ((7,), (7, 0, 0)),
        ((), (0, 0, 0)),
    ],
)
def test_each_kind_is_told_from_the_others(cycles, wanted):
    assert shown(counted(cycles)[0]) == wanted


@given(ORDERS)
def test_any_order_loss_and_repetition_adds_up(cycles):
    counts, first = counted(cycles)
    came = set(cycles)
    assert counts.next == max(came, default=-1) + 1
    assert counts.lost == counts.next - len(came)
    assert counts.doubled == len(cycles) - len(came)
    assert first == [cycle not in cycles[:i] for i, cycle in enumerate(cycles)]
    assert counts.swapped == sum(
        new and cycle < max(cycles[:i], default=-1) for i, (cycle, new) in enumerate(zip(cycles, first, strict=True))
    )


@given(ORDERS, st.integers(0, 35), ORDERS)
def test_what_is_taken_back_has_not_come(cycles, back, then):
    counts, _ = counted(cycles)
    doubled, swapped = counts.doubled, counts.swapped
    counts.rewind(back)
    again, _ = counted([cycle for cycle in cycles if cycle < back])
    again.skip(counts.next) if counts.next > again.next else None
    again.doubled, again.swapped = doubled, swapped
    assert (counts.next, *shown(counts)) == (again.next, *shown(again))
    for cycle in then:  # and the gaps are where they have to be
        assert counts.take(cycle) is again.take(cycle)
    assert shown(counts) == shown(again)


def test_gaps_are_bounded_and_what_is_missing_in_old_ones_stays_lost():
    counts, _ = counted(range(0, 4 * GAPS, 2))
    assert shown(counts) == (2 * GAPS - 1, 0, 0)
    assert len(counts._firsts) == len(counts._ends) == GAPS
    assert counts.take(4 * GAPS - 3) and not counts.take(1)
    assert shown(counts) == (2 * GAPS - 2, 1, 1)


def test_the_sums_of_all_inputs_are_sent_and_shown():
    sent, timing = [], Timing()
    message = SimpleNamespace(header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0), frame_id=""), budget=0.0)
    timing.connect(
        message, lambda m: sent.append((m.messages_late, m.messages_lost, m.messages_doubled, m.messages_swapped)), 1.0
    )
    rig, wire = counted((0, 2, 1, 1, 5))[0], counted((1, 1))[0]
    rig.late = 4
    timing.inputs = {"test_rig_sim/state": rig, "catenary_model/state": wire}
    for cycle in range(BATCH):
        timing.add(1e-3, message.header, cycle)
    assert sent == [(4, 3, 2, 1)]
    found = timing.summary()
    assert {key: found[key] for key in found if key.startswith(("messages", "input"))} == {
        "messages late": "4",
        "messages lost": "3",
        "messages doubled": "2",
        "messages swapped": "1",
        "input test_rig_sim/state": "late 4, lost 2, doubled 1, swapped 1",
        "input catenary_model/state": "late 0, lost 1, doubled 1, swapped 0",
    }
