"""States of rig and catenary meet by cycle number, in order, each once; strays do no harm."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from impedance_mpc.pairing import LONGEST, Arrival, CyclePairs


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
    assert pairs.add_rig(3, "r3") is Arrival.AHEAD
    pairs.add_catenary(1, "c1")
    assert drain(pairs) == []  # it may be a stray
    assert pairs.add_rig(4, "r4") is Arrival.NEW  # it was none
    assert drain(pairs) == [(3, "r3", "c1")]
    assert pairs.missing == 2
    for k in (2, 3, 4):  # what the catenary bridges
        pairs.add_catenary(k, f"c{k}")
    assert drain(pairs) == [(4, "r4", "c4")]
    assert (pairs.missing, pairs.refused) == (2, 0)


def test_catenary_ahead_lets_the_lost_cycle_go():
    pairs = CyclePairs()
    pairs.add_catenary(2, "c2")
    for k in range(3):
        pairs.add_rig(k, f"r{k}")
    assert drain(pairs) == []
    pairs.add_catenary(3, "c3")
    assert drain(pairs) == [(2, "r2", "c2")]
    assert pairs.missing == 2


@pytest.mark.parametrize("side", ["rig", "catenary"])
@pytest.mark.parametrize("ahead", [2, 3, 40, 100, 999, LONGEST, LONGEST + 1, 10**9, 2**64 - 1])
@pytest.mark.parametrize("when", ["before both", "between", "after both"])
def test_a_stray_changes_nothing_and_is_counted(side, ahead, when):
    pairs = CyclePairs()
    stray = getattr(pairs, f"add_{side}")
    found = []
    for k in range(1200):
        if k == 10 and when == "before both":
            stray(min(k + ahead, 2**64 - 1), "stray")
        pairs.add_catenary(k, f"c{k}")
        found += drain(pairs)
        if k == 10 and when == "between":
            stray(min(k + ahead, 2**64 - 1), "stray")
            found += drain(pairs)
        pairs.add_rig(k, f"r{k}")
        if k == 10 and when == "after both":
            stray(min(k + ahead, 2**64 - 1), "stray")
        found += drain(pairs)
    assert found == [(k, f"r{k}", f"c{k}") for k in range(1200)]
    assert (pairs.missing, pairs.refused) == (0, 1)


def test_a_nearer_state_that_comes_all_the_same_is_not_blocked_by_farther_ones():
    pairs = CyclePairs()
    for k in (50, 51, 52):  # before a reset of the rig, say
        pairs.add_rig(k, "old")
    found = []
    for k in range(60):
        pairs.add_rig(k, f"r{k}")
        pairs.add_catenary(k, f"c{k}")
        found += drain(pairs)
    assert found == [(k, f"r{k}", f"c{k}") for k in range(60)]
    assert (pairs.missing, pairs.refused) == (0, 3)


@pytest.mark.parametrize("side", ["rig", "catenary"])
@pytest.mark.parametrize("at", [0, 1, 30])
def test_two_states_that_were_swapped_are_both_taken_and_counted(side, at):
    order = list(range(60))
    order[at], order[at + 1] = order[at + 1], order[at]
    pairs, found = CyclePairs(), []
    for k, swapped in enumerate(order):
        pairs.add_rig(swapped if side == "rig" else k, "r")
        pairs.add_catenary(swapped if side == "catenary" else k, "c")
        found += drain(pairs)
    assert found == [(k, "r", "c") for k in range(60)]
    assert (pairs.missing, pairs.refused, pairs.swapped) == (0, 0, 1)
    counts = (pairs.of_rig, pairs.of_catenary) if side == "rig" else (pairs.of_catenary, pairs.of_rig)
    assert list(map(str, counts)) == [
        "late 0, lost 0, doubled 0, swapped 1",
        "late 0, lost 0, doubled 0, swapped 0",
    ]


def test_a_rig_that_has_gone_on_waits_for_the_catenary():
    pairs = CyclePairs()
    pairs.add_rig(0, "r")
    assert not pairs.waits_for_catenary  # before cycle 0 nothing was sent that could be sent again
    pairs.add_catenary(0, "c")
    assert drain(pairs) == [(0, "r", "c")]
    assert not pairs.waits_for_catenary
    pairs.add_rig(1, "r")
    assert pairs.waits_for_catenary
    pairs.add_rig(2, "r")
    pairs.add_catenary(1, "c")
    assert drain(pairs) == [(1, "r", "c")]
    assert pairs.waits_for_catenary  # for the next one
    pairs.add_catenary(2, "c")
    pairs.add_catenary(3, "c")
    drain(pairs)
    assert not pairs.waits_for_catenary  # now the rig's is to come
    pairs.clear()
    assert not pairs.waits_for_catenary


def test_silent_partner_does_not_fill_the_memory():
    pairs = CyclePairs()
    for k in range(LONGEST + 100):
        pairs.add_rig(k, k)
    assert len(pairs._rig.states) == LONGEST + 1
    assert pairs.refused == 99
    # The partner speaks again: what was refused is a gap like any other.
    found = []
    for k in range(LONGEST + 1):
        pairs.add_catenary(k, k)
        found += drain(pairs)
    pairs.add_catenary(LONGEST + 1, "waiting")
    pairs.add_rig(LONGEST + 100, "a")
    pairs.add_rig(LONGEST + 101, "b")
    found += drain(pairs)
    assert found == [*((k, k, k) for k in range(LONGEST + 1)), (LONGEST + 100, "a", "waiting")]
    assert pairs.missing == 99
    pairs.clear()
    assert pairs.add_rig(0, 0) is Arrival.NEW
    assert pairs.refused == 0


def test_the_node_counts_strays_and_warns_of_them():
    pytest.importorskip("phil_interfaces.msg")
    from diagnostic_msgs.msg import DiagnosticStatus
    from phil_interfaces.msg import CatenaryState, RigState

    from impedance_mpc.node import ImpedanceNode
    from phil_node.timing import Timing

    class Node(SimpleNamespace):
        _take_rig, _take_catenary = ImpedanceNode._take_rig, ImpedanceNode._take_catenary
        _refuse, _answer_all, diagnose = ImpedanceNode._refuse, ImpedanceNode._answer_all, ImpedanceNode.diagnose
        _object = ImpedanceNode._object

    books = SimpleNamespace(delta_e=0.0, delta_work=0.0, exchanged_energy=0.0, delta_p=0.0)
    result = SimpleNamespace(correction=0, f_cor=0.0, iterations=1, fallbacks=0)
    rows = np.zeros((4, 0))
    switch = SimpleNamespace(books=books, result=result, active=0)
    node = Node(switch=switch, pairs=CyclePairs(), timing=Timing(), segment=tuple(rows), _rows=rows, _hurried=False)
    node.unusable = node.fallbacks_reported = 0
    assert node.diagnose().level == DiagnosticStatus.OK
    node._take_rig(RigState(cycle=10**9))
    node._take_catenary(CatenaryState(cycle=10**9))
    node._take_rig(RigState(cycle=0, w_tr=float("nan")))
    node._take_rig(RigState(cycle=50))
    node._take_rig(RigState(cycle=0))
    assert (node.timing.refused, node.pairs.next) == (4, 0)
    found = node.diagnose()
    assert found.level == DiagnosticStatus.WARN
    assert found.message.split("; ") == [
        "state 1000000000 of the rig was refused: more than 1000 cycles ahead of 0, which comes next",
        "state 1000000000 of the catenary was refused: more than 1000 cycles ahead of 0, which comes next",
        "state 0 of the rig was refused: w_tr is not finite",
        "state 50 of the rig cannot be used: state 0, with which a ride begins, has not come",
        "strays were dropped when state 0 of the rig came",
    ]


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


def test_late_lost_and_doubled_states_are_counted_by_sender():
    pairs, found = CyclePairs(), []
    for k in (0, 1, 1, 0, 4, 5):  # the rig: 2 and 3 are lost, as the next two show
        pairs.add_rig(k, f"r{k}")
        if k < 3:
            pairs.add_catenary(k, f"c{k}")
        found += drain(pairs)
    assert str(pairs.of_rig) == "late 0, lost 2, doubled 2, swapped 0"
    assert str(pairs.of_catenary) == "late 0, lost 0, doubled 2, swapped 0"
    pairs.add_catenary(2, "c2")
    found += drain(pairs)
    pairs.add_rig(3, "r3")  # its cycle is over
    for k in (3, 4, 5):  # what the wire bridged, behind the command that made it: 3 and 4 are over, too
        pairs.add_catenary(k, f"c{k}")
    found += drain(pairs)
    assert found == [(0, "r0", "c0"), (1, "r1", "c1"), (4, "r4", "c2"), (5, "r5", "c5")]
    assert str(pairs.of_rig) == "late 1, lost 1, doubled 2, swapped 1"
    assert str(pairs.of_catenary) == "late 2, lost 0, doubled 2, swapped 0"
    pairs.clear()
    assert str(pairs.of_rig) == str(pairs.of_catenary) == "late 0, lost 0, doubled 0, swapped 0"


def test_states_of_before_a_reset_are_not_in_the_counts_of_the_ride():
    pairs = CyclePairs()
    for k in (50, 51, 52, *range(60)):
        pairs.add_rig(k, k)
    assert str(pairs.of_rig) == "late 0, lost 0, doubled 0, swapped 0"


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(0, 15)), max_size=50))
def test_any_order_of_states_adds_up(messages):
    """Each state is used or kept, doubled, or refused, or still looked at; each cycle has come or is lost."""
    pairs = CyclePairs()
    for of_rig, cycle in messages:
        (pairs.add_rig if of_rig else pairs.add_catenary)(cycle, cycle)
        drain(pairs)
    for stream, of_rig in ((pairs._rig, True), (pairs._catenary, False)):
        counts, sent = stream.counts, sum(side is of_rig for side, _ in messages)
        came = counts.next - counts.lost
        assert sent == came + counts.doubled + stream.refused + (stream._ahead is not None)
        assert 0 <= counts.late <= came and counts.lost >= 0
        assert len(stream.states) <= came
