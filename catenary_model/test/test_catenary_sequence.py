"""Order of the commands: duplicates, late ones, gaps, nonsense."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.sequence import Sequence, Verdict


def after(*cycles: int, longest: int = 100) -> Sequence:
    sequence = Sequence(longest)
    for cycle in cycles:
        assert sequence.judge(cycle, 1.0) is Verdict.TAKEN
        sequence.taken(cycle, float(cycle))
    return sequence


def test_in_order() -> None:
    sequence = after(0, 1, 2)
    assert sequence.expected == 3
    assert sequence.missing == 0


def test_the_last_command_may_come_again_and_older_ones_are_stale() -> None:
    sequence = after(0, 1, 2)
    assert sequence.judge(2, 2.0) is Verdict.REPEATED
    assert sequence.judge(2, math.nan) is Verdict.REPEATED
    assert sequence.judge(1, 1.0) is Verdict.STALE
    # the number decides before the content does
    assert sequence.judge(0, math.nan) is Verdict.STALE
    assert sequence.expected == 3


def test_nonsense_is_refused_and_the_cycle_stays_open() -> None:
    sequence = after(0)
    for force in (math.nan, math.inf, -math.inf, 1e15, -1e15):
        assert sequence.judge(1, force) is Verdict.REFUSED
    assert sequence.judge(1, 100.0) is Verdict.TAKEN


def test_what_is_refused_has_a_reason() -> None:
    sequence = after(0, 1, longest=3)
    assert sequence.objection(2, math.nan) == "f_cat is not finite"
    assert sequence.objection(2, 1e15) == "f_cat = 1e+15 N is out of all proportion, at most 1e+06 N"
    sequence.judge(6, 7.0)
    assert sequence.objection(6, 7.0) == "it is more than 3 cycles ahead of cycle 2, which has not come"
    sequence.judge(7, 7.0)
    assert sequence.objection(7, 7.0) == sequence.broken


def test_two_forces_for_one_cycle_are_told_of_and_the_first_stays() -> None:
    sequence = after(0, 1, 2)
    assert sequence.judge(2, 2.5) is Verdict.CONTRADICTED
    assert "second publisher" in sequence.objection(2, 2.5)
    assert (sequence.expected, sequence.last_force) == (3, 2.0)
    assert sequence.judge(3, 3.0) is Verdict.TAKEN


def test_gap_is_bridged_with_the_last_force() -> None:
    sequence = after(0, 1)
    assert sequence.judge(5, 7.0) is Verdict.TAKEN
    assert (sequence.missing, sequence.last_force) == (3, 1.0)


def test_a_gap_too_long_breaks_until_reset() -> None:
    sequence = after(0, 1, longest=3)
    assert sequence.judge(6, 7.0) is Verdict.REFUSED
    assert not sequence.broken
    assert sequence.judge(7, 7.0) is Verdict.BROKEN  # the commands have gone on there
    assert sequence.broken.startswith("4 commands missing before cycle 6, at most 3")
    assert sequence.judge(2, 7.0) is Verdict.BROKEN
    sequence.reset()
    assert sequence.judge(0, 7.0) is Verdict.TAKEN


@pytest.mark.parametrize("stray", [6, 1000, 10**9, 2**64 - 1])
def test_a_stray_that_is_too_far_ahead_does_not_break(stray: int) -> None:
    sequence = after(0, 1, longest=3)
    for _ in range(3):
        assert sequence.judge(stray, 7.0) is Verdict.REFUSED
    assert sequence.judge(1, 1.0) is Verdict.REPEATED
    assert sequence.judge(stray + 1, 7.0) is Verdict.REFUSED  # the stream was elsewhere in between
    assert sequence.judge(2, 7.0) is Verdict.TAKEN
    assert (sequence.missing, sequence.broken) == (0, "")
    # a stray of before a reset does not make the next one a successor
    sequence.judge(stray, 7.0)
    sequence.reset()
    assert sequence.judge(stray + 1, 7.0) is Verdict.REFUSED


def counts_of(sequence: Sequence) -> tuple[int, int, int, int]:
    counts = sequence.counts
    return counts.late, counts.lost, counts.doubled, counts.swapped


@pytest.mark.parametrize(
    ("cycles", "wanted"),
    [
        ((0, 1, 4), (0, 2, 0, 0)),
        ((0, 1, 4, 3), (1, 1, 0, 1)),  # bridged when it came
        ((0, 1, 1, 0, 2), (0, 0, 2, 0)),
        ((0, 2, 1, 3), (1, 0, 0, 1)),  # the wire does not wait: what was swapped is late
        ((0, 1, 50, 51, 2), (0, 48, 0, 0)),  # a gap that is too long: the wire stands before it
        ((0, 1, 50, 2), (0, 0, 0, 0)),  # a stray
    ],
)
def test_late_lost_doubled_and_swapped_are_counted(cycles: tuple[int, ...], wanted: tuple[int, ...]) -> None:
    sequence = Sequence(10)
    for cycle in cycles:
        if sequence.judge(cycle, 1.0) is Verdict.TAKEN:
            sequence.taken(cycle, 1.0)
    assert counts_of(sequence) == wanted
    sequence.reset()
    assert counts_of(sequence) == (0, 0, 0, 0)


def test_what_is_refused_has_not_come() -> None:
    sequence = after(0)
    sequence.judge(1, math.nan)
    sequence.judge(1, 1.0)
    sequence.taken(1, 1.0)
    assert counts_of(sequence) == (0, 0, 0, 0)
    sequence.judge(2, math.nan)
    sequence.judge(3, 1.0)
    sequence.taken(3, 1.0)
    assert counts_of(sequence) == (0, 1, 0, 0)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(0, 30), max_size=60))
def test_any_order_of_commands_adds_up(cycles: list[int]) -> None:
    """Every cycle is stepped with its command or bridged; every command was taken, late or there before."""
    sequence, taken, bridged = Sequence(100), 0, 0
    for cycle in cycles:
        if sequence.judge(cycle, 1.0) is Verdict.TAKEN:
            taken, bridged = taken + 1, bridged + sequence.missing
            sequence.taken(cycle, 1.0)
    late, lost, doubled, swapped = counts_of(sequence)
    assert taken + bridged == sequence.expected == sequence.counts.next
    assert bridged == lost + late and late == swapped
    assert len(cycles) == taken + late + doubled
