"""The books of (3.46) and (3.47)."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from energy_monitor.books import Books, Meters, accumulated_of, books_of

TS = 0.002
FIGURES = ("e_tr", "e_cat", "p_tr", "p_cat", "exchanged_energy", "exchanged_momentum", "delta_e", "delta_p")
COUNTED = ("work_tr", "work_cat", "impulse_tr", "impulse_cat")
RIDES = st.integers(1, 60).flatmap(lambda n: arrays(np.float64, (4, n), elements=st.floats(-1e3, 1e3)))


@settings(max_examples=40, deadline=None)
@given(RIDES)
def test_a_cycle_at_a_time_equals_the_whole_ride_to_the_bit(ride):
    # The same products are added in the same order, so nothing but equality is acceptable.
    books, history = Books(TS), books_of(*ride, TS)
    for k in range(ride.shape[1]):
        books.add(*ride[:, k].tolist())
        for figure in FIGURES:
            assert getattr(books, figure) == getattr(history, figure)[k]


@settings(max_examples=40, deadline=None)
@given(RIDES, st.integers(0, 60))
def test_energy_is_additive_over_time(ride, where):
    # Tolerance: rounding of 60 sums of products up to 2e3 J each.
    where = min(where, ride.shape[1] - 1)
    whole = books_of(*ride, TS)
    first, second = books_of(*ride[:, :where], TS), books_of(*ride[:, where:], TS)
    for figure in FIGURES:
        start = getattr(first, figure)[-1] if where else 0.0
        assert start + getattr(second, figure)[-1] == pytest.approx(getattr(whole, figure)[-1], abs=1e-8)


@settings(max_examples=40, deadline=None)
@given(RIDES, st.floats(-10.0, 10.0))
def test_energy_is_bilinear_and_momentum_linear_in_the_force(ride, factor):
    # Tolerance: rounding of 60 products scaled by up to 10.
    f_tr, v_tr, f_cat, v_cat = ride
    one, scaled = books_of(*ride, TS), books_of(factor * f_tr, v_tr, factor * f_cat, v_cat, TS)
    for figure in ("e_tr", "e_cat", "delta_e", "p_tr", "p_cat", "delta_p"):
        assert getattr(scaled, figure)[-1] == pytest.approx(factor * getattr(one, figure)[-1], abs=1e-8)
    for figure in ("exchanged_energy", "exchanged_momentum"):
        assert getattr(scaled, figure)[-1] == pytest.approx(abs(factor) * getattr(one, figure)[-1], abs=1e-8)
    faster = books_of(f_tr, factor * v_tr, f_cat, factor * v_cat, TS)
    assert faster.delta_e[-1] == pytest.approx(factor * one.delta_e[-1], abs=1e-8)
    assert np.array_equal(faster.delta_p, one.delta_p)


@settings(max_examples=40, deadline=None)
@given(RIDES)
def test_momentum_error_is_minus_the_sum_of_the_correction_force(ride):
    # (3.47) with its sign corrected. Tolerance: rounding of 60 differences of numbers up to 2e3.
    f_tr, v_tr, f_cor, v_cat = ride
    history = books_of(f_tr, v_tr, f_tr + f_cor, v_cat, TS)
    assert history.delta_p == pytest.approx(-np.cumsum(TS * f_cor), abs=1e-9)


@settings(max_examples=40, deadline=None)
@given(RIDES)
def test_a_perfect_emulation_has_no_error(ride):
    history = books_of(ride[0], ride[1], ride[0], ride[1], TS)
    assert not history.delta_e.any()
    assert not history.delta_p.any()
    assert np.all(np.diff(history.exchanged_energy) >= 0.0)
    assert np.all(np.abs(history.e_tr) <= history.exchanged_energy * (1.0 + 1e-12))


def test_a_sine_against_the_closed_form():
    # F = F0 + F1 sin(wt), v = V sin(wt) over whole periods: E = F1 V T / 2; there the rectangle rule is exact
    # but for rounding.
    n, f0, f1, speed = 1000, 120.0, 30.0, 0.2
    phase = 2.0 * np.pi * 4.0 * np.arange(n) / n
    force, velocity = f0 + f1 * np.sin(phase), speed * np.sin(phase)
    history = books_of(force, velocity, force, np.zeros(n), TS)
    assert history.e_tr[-1] == pytest.approx(0.5 * f1 * speed * n * TS, rel=1e-12)
    assert history.p_tr[-1] == pytest.approx(f0 * n * TS, rel=1e-12)
    assert history.delta_e[-1] == history.e_tr[-1]


@settings(max_examples=40, deadline=None)
@given(RIDES, st.randoms(use_true_random=False))
def test_meters_a_cycle_at_a_time_equal_the_whole_ride_to_the_bit(ride, chance):
    counted = np.array([chance.random() < 0.7 for _ in range(ride.shape[1])])
    books, history = Books(TS), accumulated_of(*ride, counted)
    for k in range(ride.shape[1]):
        books.read(Meters(*ride[:, k].tolist()), bool(counted[k]))
        assert books.accumulated == tuple(getattr(history, name)[k] for name in COUNTED)
        assert books.delta_work == history.delta_work[k]
        assert books.delta_impulse == history.delta_impulse[k]


def test_the_way_of_a_meter_is_counted_from_the_reading_before_and_only_where_it_counts():
    # 5 J and 2 J before the first reading and between the second and the third, which does not count.
    books = Books(TS)
    for work, counted in ((5.0, True), (6.0, True), (8.0, False), (8.5, True)):
        books.read(Meters(work, 0.5 * work, 10.0 * work, 11.0 * work), counted)
    assert books.accumulated == (1.5, 0.75, 15.0, 16.5)
    assert (books.delta_work, books.delta_impulse) == (0.75, -1.5)


def test_sums_over_the_cycles_that_count():
    f, v = np.array([1.0, 2.0, 4.0]), np.array([1.0, 1.0, -1.0])
    history = books_of(f, v, 2.0 * f, v, 1.0, np.array([True, False, True]))
    assert history.e_tr.tolist() == [1.0, 1.0, -3.0]
    assert history.e_cat.tolist() == [2.0, 2.0, -6.0]
    assert (history.p_tr[-1], history.p_cat[-1]) == (5.0, 10.0)
    assert (history.exchanged_energy[-1], history.exchanged_momentum[-1]) == (5.0, 5.0)


def test_what_happens_between_the_samples_is_in_the_meters_alone():
    # Both sides swing at half the cycle rate: every sample has force and velocity 0, each cycle moves 1 mJ and 1 mN s.
    cycles = 100
    books = Books(TS)
    for k in range(cycles + 1):
        books.add(0.0, 0.0, 0.0, 0.0)
        books.read(Meters(1e-3 * k, 0.0, 1e-3 * k, 0.0), True)
    assert books.delta_e == books.delta_p == 0.0
    assert (books.delta_work, books.delta_impulse) == pytest.approx((0.1, 0.1), rel=1e-12)


def test_cleared_books_are_empty():
    books = Books(TS)
    books.add(100.0, 0.1, 99.0, 0.1)
    books.read(Meters(1.0, 1.0, 1.0, 1.0), True)
    books.read(Meters(2.0, 3.0, 2.0, 3.0), True)
    books.clear()
    books.read(Meters(9.0, 9.0, 9.0, 9.0), True)
    assert books.accumulated == (0.0, 0.0, 0.0, 0.0)
    assert books.cycles == 0
    assert all(getattr(books, figure) == 0.0 for figure in FIGURES)


def test_arrays_of_different_length_are_refused():
    with pytest.raises(ValueError, match="shapes differ"):
        books_of(np.zeros(3), np.zeros(3), np.zeros(2), np.zeros(3), TS)
