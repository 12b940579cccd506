"""What is a ride and what are stray messages, by cycle numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from energy_monitor.bag import Bag, Table
from energy_monitor.report.rides import bag_of_ride, last_ride, paired, rides_of

RIDE = list(range(400))


def stream(cycles: list[int], own: list[bool] | None = None) -> Table:
    """A stream of states; those that are not their own say other things than the ride's."""
    cycle = np.array(cycles, np.int64)
    mark = np.zeros(len(cycle)) if own is None else (~np.array(own)).astype(float)
    columns = {
        "cycle": cycle,
        "header.stamp.sec": np.zeros(len(cycle), np.int64),
        "header.stamp.nanosec": cycle % 2000 * 500_000,
        "f_tr": cycle * 1.0 + mark,
    }
    return Table("/rig", "RigState", np.arange(len(cycle)) * 1000, columns)


def cycles(table: Table) -> list[int]:
    return sorted(set(table["cycle"].tolist()))


@pytest.mark.parametrize("at", [1, 5, 63, 64, 65, 250, 399, 400])
@pytest.mark.parametrize("stray", [0, 3, 150, 10**6, 10**12])
def test_a_stray_message_ends_no_ride(at: int, stray: int) -> None:
    table = stream([*RIDE[:at], stray, *RIDE[at:]])
    rides = rides_of(table)
    assert len(rides) == 1 and cycles(rides[0]) == RIDE


@pytest.mark.parametrize("block", [RIDE[100:220], RIDE[-1:], RIDE[-150:], [399] * 5, [0] * 5])
@pytest.mark.parametrize("at", [250, 400])
def test_messages_that_come_again_end_no_ride(block: list[int], at: int) -> None:
    rides = rides_of(stream([*RIDE[:at], *block, *RIDE[at:]]))
    assert len(rides) == 1 and cycles(rides[0]) == RIDE


def test_messages_in_each_others_places_are_put_right() -> None:
    order = list(RIDE)
    order[50], order[284] = order[284], order[50]
    assert cycles(last_ride(stream(order))) == RIDE
    assert cycles(last_ride(stream([1, 0, *RIDE[2:]]))) == RIDE


@pytest.mark.parametrize("first", [11, 40, 64, 65, 400])
@pytest.mark.parametrize("second", [12, 400])
def test_numbers_that_begin_anew_and_go_on_are_a_ride(first: int, second: int) -> None:
    rides = rides_of(stream([*RIDE[:first], *RIDE[:second]]))
    assert [len(ride) for ride in rides] == [first, second]


def test_a_gap_is_no_new_ride_and_a_part_of_another_one_is() -> None:
    assert len(rides_of(stream([*RIDE, *range(5000, 5100)]))) == 1
    rides = rides_of(stream([*range(3000, 3400), *range(1000, 1200)]))
    assert [cycles(ride)[0] for ride in rides] == [3000, 1000]


def test_two_rigs_at_once_are_two_rides() -> None:
    mixed = [number for pair in zip(range(1000, 1400), RIDE, strict=True) for number in pair]
    assert sorted(cycles(ride)[0] for ride in rides_of(stream(mixed))) == [0, 1000]


def test_a_ride_goes_on_behind_a_stray_that_is_nearer_to_another_one() -> None:
    order = list(RIDE)
    order.insert(58, 74)
    order.insert(1, 65)
    (ride,) = rides_of(stream(order))
    assert set(cycles(ride)) >= set(RIDE)


def test_a_number_beyond_any_sense_does_not_part_a_ride() -> None:
    (ride,) = rides_of(stream([0, 0, 1, -1, 0, *RIDE[2:]]))
    assert set(cycles(ride)) == set(RIDE)
    assert cycles(last_ride(stream([-1, -3]))) != []


@settings(max_examples=60, deadline=None)
@given(st.data())
@pytest.mark.slow
def test_whatever_is_put_into_a_ride_it_keeps_its_cycles(data: st.DataObject) -> None:
    # Each stray once: five zeros within the first six cycles are taken for a ride that began again, as they may be.
    order = list(RIDE)
    for stray in data.draw(st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=8, unique=True)):
        order.insert(data.draw(st.integers(0, len(order))), stray)
    kept = set(cycles(last_ride(stream(order))))
    assert kept >= set(RIDE) - {0} and len(rides_of(stream(order))) == 1


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, 3000), max_size=200))
def test_any_numbers_are_split_without_loss_of_order(numbers: list[int]) -> None:
    rides = rides_of(stream(numbers))
    assert bool(rides) == bool(numbers)
    assert sum(len(ride) for ride in rides) <= len(numbers)


def test_a_reset_is_one_of_all_streams() -> None:
    both, one = stream([*RIDE, *RIDE[:100]]), stream([*RIDE, *range(400, 500)])
    assert len(paired([rides_of(both), rides_of(both), rides_of(both)])) == 2
    assert [len(ride[0]) for ride in paired([rides_of(both), rides_of(one), rides_of(one)])] != []


def test_what_was_recorded_beside_a_ride_goes_with_it() -> None:
    both = stream([*RIDE, *RIDE[:100]])
    rides = paired([rides_of(both)] * 3)
    model = Table("/model", "ImpedanceModel", np.array([-5]), {"cycle": np.array([0])})
    timing = Table("/timing", "CycleTiming", np.array([10_000, 300_000, 410_000]), {"cycle": np.array([9, 299, 9])})
    bag = Bag(Path("x"), "mcap", True, {}, {"/model": model, "/timing": timing})
    assert bag_of_ride(bag, rides, 0).tables["/timing"]["cycle"].tolist() == [9, 299]
    assert bag_of_ride(bag, rides, 1).tables["/timing"]["cycle"].tolist() == [9]
    assert all(len(bag_of_ride(bag, rides, ride).tables["/model"]) == 1 for ride in (0, 1))


def test_a_ride_that_was_recorded_twice_at_once_is_one_and_a_later_one_like_it_is_another() -> None:
    delayed = [number for pair in zip(RIDE[90:], RIDE, strict=False) for number in pair]
    rides = rides_of(stream([*RIDE[:90], *delayed, *RIDE[-90:]]))
    assert [cycles(ride) for ride in rides] == [RIDE]
    assert len(rides_of(stream([*RIDE, *RIDE]))) == 2


def test_a_message_belongs_to_one_ride_at_most() -> None:
    assert sum(len(ride) for ride in rides_of(stream(list(range(500))[::-1]))) <= 500
