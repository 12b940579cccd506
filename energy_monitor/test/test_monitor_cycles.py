"""Matching of streams by cycle number."""

import random

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from energy_monitor.cycles import AHEAD, CONFIRMED, Arrival, CycleMatcher, JumpFilter

STREAMS = ("rig", "command", "catenary")


def drain(matcher, now=0.0):
    taken = []
    while (cycle := matcher.take(now)) is not None:
        taken.append(cycle)
        assert [matcher.payload(s, cycle) for s in range(3)] == [(s, cycle) for s in range(3)]
    return taken


def feed(matcher, stream, cycles, now=0.0):
    taken = []
    for cycle in cycles:
        matcher.accept(stream, cycle, (stream, cycle))
        taken += drain(matcher, now)
    return taken


@settings(max_examples=50, deadline=None)
@given(st.integers(1, 60), st.integers(2, 30), st.randoms(use_true_random=False), st.integers(0, 5))
def test_complete_streams_give_every_cycle_once_in_order(count, window, chance, doubles):
    # Each stream is in order, the three are interleaved at random.
    matcher = CycleMatcher(STREAMS, window)
    position, taken = [0, 0, 0], []
    while min(position) < count:
        stream = chance.choice([s for s in range(3) if position[s] < count])
        taken += feed(matcher, stream, [position[stream]])
        if doubles and chance.random() < 0.1 * doubles:
            assert matcher.accept(stream, position[stream], (stream, position[stream])) is Arrival.DUPLICATE
        position[stream] += 1
    assert taken == list(range(count))
    assert matcher.complete == count
    assert matcher.missing == [0, 0, 0]
    assert (matcher.stale, matcher.out_of_order, matcher.incomplete, matcher.pending) == (0, 0, 0, 0)


@settings(max_examples=50, deadline=None)
@given(st.sets(st.tuples(st.integers(0, 2), st.integers(0, 98)), max_size=30), st.integers(2, 40))
@example(lost={(0, 22), (0, 42), (1, 42), (2, 42)}, window=20)  # a jump over a cycle that nobody sent
def test_what_is_lost_is_counted_where_it_was_lost(lost, window):
    matcher, taken = CycleMatcher(STREAMS, window), []
    for cycle in range(100):
        if cycle == 99:
            matcher.finish(99)
        for stream in range(3):
            if (stream, cycle) not in lost:
                taken += feed(matcher, stream, [cycle])
    broken = {cycle for _, cycle in lost}
    assert taken == [cycle for cycle in range(100) if cycle not in broken]
    assert matcher.missing == [sum(s == stream for s, _ in lost) for stream in range(3)]
    for stream in range(3):
        assert matcher.missing_cycles[stream] == sorted(c for s, c in lost if s == stream)[:8]
    assert matcher.incomplete == len(broken)
    assert matcher.complete == 100 - len(broken)
    assert matcher.finished


def test_out_of_order_messages_still_make_a_cycle():
    matcher = CycleMatcher(STREAMS, 8)
    feed(matcher, 0, [0, 1, 2])
    feed(matcher, 1, [0, 1, 2])
    assert matcher.accept(2, 2, (2, 2)) is Arrival.NEW
    assert drain(matcher) == []
    assert matcher.accept(2, 0, (2, 0)) is Arrival.OUT_OF_ORDER
    assert matcher.accept(2, 1, (2, 1)) is Arrival.OUT_OF_ORDER
    assert drain(matcher) == [0, 1, 2]
    assert matcher.out_of_order == 2


@st.composite
def rides(draw):
    """Three streams in order, each with its own gaps and doubles, and the order in which they are read."""
    count = draw(st.integers(5, 120))
    streams = []
    for _ in range(3):
        lost = draw(st.sets(st.integers(0, count - 2), max_size=10))
        sent = [cycle for cycle in range(count) if cycle not in lost]
        for place in sorted(draw(st.lists(st.integers(0, len(sent) - 1), max_size=6)), reverse=True):
            sent.insert(place, sent[place])
        streams.append(sent)
    order = [stream for stream in range(3) for _ in streams[stream]]
    pieces = draw(st.integers(1, 6))  # few pieces: long bursts, topic by topic
    if draw(st.booleans()):
        order = draw(st.permutations(order))
    else:
        order = [s for k in range(pieces) for s in draw(st.permutations((0, 1, 2))) for _ in streams[s][k::pieces]]
    return count, streams, order


@settings(max_examples=60, deadline=None)
@given(rides(), st.integers(2, 30))
def test_any_order_of_reading_gives_the_counts_of_the_one_in_step(ride, window):
    count, streams, order = ride

    def read(order):
        matcher, taken, left = CycleMatcher(STREAMS, window), [], [list(stream) for stream in streams]
        for stream in order:
            cycle = left[stream].pop(0)
            if stream == 0 and cycle == count - 1:
                matcher.finish(cycle)
            taken += feed(matcher, stream, [cycle])
        assert matcher.finished
        counts = matcher.complete, matcher.incomplete, matcher.missing, matcher.missing_cycles
        by_number = [(of.late, of.lost, of.doubled, of.swapped) for of in matcher.counts]
        return taken, *counts, matcher.duplicates, matcher.stale, matcher.out_of_order, by_number

    def doubles(stream):
        return len(stream) - len(set(stream))

    in_step = [stream for cycle in range(count) for stream in range(3) for _ in range(streams[stream].count(cycle))]
    found = read(order)
    assert found == read(in_step)
    assert found[0] == [cycle for cycle in range(count) if all(cycle in stream for stream in streams)]
    assert found[3] == [count - len(set(stream)) for stream in streams]
    assert found[5] == sum(map(doubles, streams))
    assert found[6:8] == (0, 0)
    lost = [max(stream, default=-1) + 1 - len(set(stream)) for stream in streams]
    assert found[8] == [(0, *two, 0) for two in zip(lost, map(doubles, streams), strict=True)]


@pytest.mark.parametrize("late", [600, 5000])
def test_who_was_held_up_loses_nothing(late):
    """All that waited comes topic by topic."""
    matcher, taken = CycleMatcher(STREAMS, 100), []
    for burst in (range(late), range(late, 2 * late)):
        for stream in (1, 0, 2):
            taken += feed(matcher, stream, burst)
    assert taken == list(range(2 * late))
    assert matcher.missing == [0, 0, 0]
    assert not any(matcher._waiting)


def test_memory_has_an_end():
    """A stream that is silent for good does not let the others pile up; what it then still sends is too late."""
    matcher = CycleMatcher(STREAMS, 4, capacity=50)
    for cycle in range(1000):
        for stream in (0, 2):
            feed(matcher, stream, [cycle])
        assert max(map(len, matcher._waiting)) <= 51
    assert matcher.missing == [0, 950, 0]
    assert matcher.accept(1, 3, (1, 3)) is Arrival.STALE
    assert feed(matcher, 1, range(950, 1000)) == list(range(950, 1000))


def test_a_cycle_that_was_given_up_is_stale_when_it_comes():
    matcher = CycleMatcher(STREAMS, 4)
    feed(matcher, 0, range(10))
    assert (matcher.next, matcher.missing) == (0, [0, 0, 0])  # the others may still bring them all
    feed(matcher, 2, range(10))
    feed(matcher, 1, (0, 1, 3, 4, 5))
    assert matcher.next == 2
    feed(matcher, 1, [6])
    assert matcher.next == 7
    assert matcher.accept(1, 2, (1, 2)) is Arrival.STALE
    assert matcher.accept(1, 1, (1, 1)) is Arrival.DUPLICATE
    assert (matcher.stale, matcher.duplicates) == (1, 1)
    assert matcher.missing == [0, 1, 0]
    assert matcher.pending == 3


def test_a_repeated_last_message_is_no_stale_one():
    matcher = CycleMatcher(STREAMS, 4)
    for stream in range(3):
        feed(matcher, stream, [0])
    assert matcher.accept(0, 0, (0, 0)) is Arrival.DUPLICATE
    assert matcher.stale == 0


def test_a_jump_is_counted_without_walking_through_it():
    matcher = CycleMatcher(STREAMS, 100)
    feed(matcher, 0, [0, 1])
    for stream, missing in ((2, [0, 0, 0]), (1, [0, 2, 2])):
        assert feed(matcher, stream, [10**12]) == []
        assert matcher.missing == missing
    assert feed(matcher, 0, [10**12]) == []
    assert matcher.missing == [10**12 - 99 - 2, 10**12 - 99, 10**12 - 99]  # the rest might come out of order
    assert matcher.missing_cycles[1] == list(range(8))
    assert matcher.accept(2, 7, (2, 7)) is Arrival.STALE


def test_the_state_after_the_last_cycle_is_not_missed_elsewhere():
    # The catenary still steps after the last cycle.
    matcher = CycleMatcher(STREAMS, 8)
    matcher.finish(2)
    for stream, count in ((0, 3), (1, 3), (2, 4)):
        feed(matcher, stream, range(count))
    assert matcher.finished
    assert (matcher.complete, matcher.missing, matcher.pending) == (3, [0, 0, 0], 0)


def test_age_is_that_of_the_newest_complete_cycle():
    matcher = CycleMatcher(STREAMS, 8)
    assert matcher.age(1.0) is None
    for stream in range(3):
        feed(matcher, stream, [0], now=10.0)
    feed(matcher, 0, [1], now=11.0)
    assert matcher.age(12.5) == 2.5


def test_after_clear_cycle_0_is_expected_again():
    matcher = CycleMatcher(STREAMS, 8)
    for stream in range(3):
        feed(matcher, stream, range(20))
    matcher.clear()
    for stream in (2, 0):
        assert feed(matcher, stream, [0]) == []
    assert feed(matcher, 1, [0]) == [0]


def test_only_the_payload_of_the_cycle_just_taken_is_given():
    matcher = CycleMatcher(STREAMS, 4)
    for stream in range(3):
        feed(matcher, stream, [0, 1])
    for cycle in (0, 2):
        with pytest.raises(KeyError):
            matcher.payload(0, cycle)


def test_a_stray_number_is_not_believed_but_a_jump_is():
    jumps = JumpFilter()
    assert jumps.believes(AHEAD + 7, 7)
    assert not jumps.believes(AHEAD + 8, 7)
    # The same stray number again and again, or strays between good ones, are no jump.
    assert not any(jumps.believes(10**9, 7) for _ in range(2 * CONFIRMED))
    for k in range(2 * CONFIRMED):
        assert jumps.believes(7 + k, 7 + k)
        assert not jumps.believes(10**9 + k, 8 + k)
    # A stream that goes on from there is one.
    found = [jumps.believes(5000 + k, 7) for k in range(CONFIRMED)]
    assert found == [False] * (CONFIRMED - 1) + [True]


def test_a_window_is_needed():
    with pytest.raises(ValueError, match="window"):
        CycleMatcher(STREAMS, 1)


def test_a_long_ride_with_random_losses_keeps_its_accounts():
    chance = random.Random(1)
    matcher, taken, sent = CycleMatcher(STREAMS, 50), 0, [0, 0, 0]
    for cycle in range(3000):
        for stream in range(3):
            if chance.random() < 0.99 or cycle >= 2900:
                sent[stream] += 1
                taken += len(feed(matcher, stream, [cycle]))
    assert matcher.complete == taken
    assert [matcher.missing[s] + sent[s] for s in range(3)] == [3000, 3000, 3000]
    assert matcher.complete + matcher.incomplete == 3000
