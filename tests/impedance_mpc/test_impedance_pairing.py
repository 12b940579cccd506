"""States of rig and catenary meet by cycle number, in order, each once."""

from hypothesis import given, settings
from hypothesis import strategies as st

from impedance_mpc.pairing import BACKLOG, Arrival, CyclePairs


def drain(pairs):
    found = []
    while (pair := pairs.take()) is not None:
        found.append(pair)
    return found


def test_a_pair_needs_both_and_comes_once():
    pairs = CyclePairs()
    assert pairs.add_rig(0, "r0") is Arrival.NEW
    assert drain(pairs) == []
    assert pairs.add_catenary(0, "c0") is Arrival.NEW
    assert drain(pairs) == [(0, "r0", "c0")]
    assert drain(pairs) == []


def test_repetition_is_told_from_a_stale_state():
    pairs = CyclePairs()
    for k in range(3):
        pairs.add_rig(k, k)
        pairs.add_catenary(k, k)
    assert len(drain(pairs)) == 3
    assert pairs.add_rig(2, 2) is Arrival.REPEATED
    assert pairs.add_rig(1, 1) is Arrival.STALE
    assert pairs.add_catenary(2, 2) is Arrival.REPEATED
    assert pairs.add_catenary(0, 0) is Arrival.STALE
    assert pairs.missing == 0


def test_backlog_of_the_rig_is_worked_off_in_order():
    pairs = CyclePairs()
    for k in range(5):
        pairs.add_rig(k, f"r{k}")
    found = []
    for k in range(5):
        pairs.add_catenary(k, f"c{k}")
        found += drain(pairs)
    assert found == [(k, f"r{k}", f"c{k}") for k in range(5)]
    assert pairs.missing == 0


def test_gap_of_the_rig_is_counted_and_bridged_with_the_waiting_catenary_state():
    pairs = CyclePairs()
    pairs.add_rig(0, "r0")
    pairs.add_catenary(0, "c0")
    drain(pairs)
    pairs.add_rig(3, "r3")
    assert drain(pairs) == []  # the catenary's answer to command 0 is still to come
    pairs.add_catenary(1, "c1")
    assert drain(pairs) == [(3, "r3", "c1")]
    assert pairs.missing == 2
    pairs.add_catenary(4, "c4")
    pairs.add_rig(4, "r4")
    assert drain(pairs) == [(4, "r4", "c4")]


def test_catenary_ahead_lets_the_lost_cycle_go():
    pairs = CyclePairs()
    pairs.add_catenary(2, "c2")
    pairs.add_rig(0, "r0")
    pairs.add_rig(2, "r2")
    assert drain(pairs) == [(2, "r2", "c2")]
    assert pairs.missing == 2


def test_silent_partner_does_not_fill_the_memory():
    pairs = CyclePairs()
    for k in range(BACKLOG + 100):
        pairs.add_rig(k, k)
    assert len(pairs._rig) == BACKLOG
    pairs.clear()
    assert pairs.add_rig(0, 0) is Arrival.NEW


@settings(max_examples=60, deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=60))
def test_any_order_of_two_complete_streams_gives_every_cycle_once(order):
    pairs = CyclePairs()
    rig = catenary = 0
    found = []
    for is_rig in order:
        if is_rig:
            pairs.add_rig(rig, rig)
            rig += 1
        else:
            pairs.add_catenary(catenary, catenary)
            catenary += 1
        found += drain(pairs)
    assert found == [(k, k, k) for k in range(min(rig, catenary))]
    assert pairs.missing == 0
