"""Bounds of (3.49) in their four sign cases, their robustification case by case, and the books."""

import math

import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from impedance_mpc.books import Books
from impedance_mpc.correction import (
    CorrectionRule,
    bounds,
    decay_interval,
)
from phil_base.enumerations import Correction

TS = 0.002


def error_after(delta_e, v_cat, v_tr, f_tr, f_cor):
    """(3.46) from one cycle to the next."""
    return delta_e + TS * f_tr * v_tr - TS * (f_tr + f_cor) * v_cat


@pytest.mark.parametrize(
    ("v_cat", "delta_e", "theta_lower", "theta_upper"),
    [(0.2, 0.5, 0.9, 0.0), (0.2, -0.5, 0.0, 0.9), (-0.2, 0.5, 0.0, 0.9), (-0.2, -0.5, 0.9, 0.0)],
)
def test_four_sign_cases(v_cat, delta_e, theta_lower, theta_upper):
    """The ends of the interval give dE(k) = theta dE(k-1) with the theta of the table; 1e-12 is rounding."""
    lower, upper = decay_interval(delta_e, v_cat, 0.15, 120.0, TS, 0.9)
    assert lower < upper
    assert error_after(delta_e, v_cat, 0.15, 120.0, lower) == pytest.approx(theta_lower * delta_e, abs=1e-12)
    assert error_after(delta_e, v_cat, 0.15, 120.0, upper) == pytest.approx(theta_upper * delta_e, abs=1e-12)


def test_first_case_is_the_printed_formula():
    delta_e, v_cat, v_tr, f_tr, alpha = 0.3, 0.12, 0.1, 140.0, 0.8
    c = f_tr * (v_tr / v_cat - 1.0)
    s = delta_e / (v_cat * TS)
    assert decay_interval(delta_e, v_cat, v_tr, f_tr, TS, alpha) == pytest.approx(((1.0 - alpha) * s + c, s + c))


velocities = st.floats(0.001, 2.0).flatmap(lambda v: st.sampled_from([v, -v]))


@settings(max_examples=150, deadline=None)
@given(
    delta_e=st.floats(-50.0, 50.0),
    v_cat=velocities,
    v_tr=st.floats(-2.0, 2.0),
    f_tr=st.floats(-100.0, 600.0),
    alpha=st.floats(0.01, 0.99),
    share=st.floats(0.0, 1.0),
)
@example(delta_e=0.0, v_cat=0.1, v_tr=0.1, f_tr=100.0, alpha=0.5, share=0.5)
def test_inside_the_strict_bounds_the_energy_error_never_grows(delta_e, v_cat, v_tr, f_tr, alpha, share):
    """(3.48) for every force between the bounds, and the error keeps its sign; tolerance is rounding of the sums."""
    lower, upper = decay_interval(delta_e, v_cat, v_tr, f_tr, TS, alpha)
    assert lower <= upper
    after = error_after(delta_e, v_cat, v_tr, f_tr, lower + share * (upper - lower))
    rounding = 1e-12 * (1.0 + abs(delta_e) + TS * abs(f_tr) * (abs(v_tr) + abs(v_cat)))
    assert abs(after) <= alpha * abs(delta_e) + rounding
    assert after * delta_e >= -rounding * (abs(delta_e) + 1.0)


@settings(max_examples=150, deadline=None)
@given(
    delta_e=st.floats(-1e3, 1e3),
    v_cat=st.floats(-3.0, 3.0),
    v_tr=st.floats(-3.0, 3.0),
    f_tr=st.floats(-1e3, 1e3),
    before=st.floats(-30.0, 30.0),
    dead_zone=st.sampled_from([0.0, 0.03]),
    term=st.booleans(),
)
@example(delta_e=1.0, v_cat=5e-324, v_tr=0.0, f_tr=-1.0, before=0.0, dead_zone=0.0, term=True)
def test_robust_bounds_are_ordered_finite_capped_and_rate_limited(delta_e, v_cat, v_tr, f_tr, before, dead_zone, term):
    rule = CorrectionRule(0.98, 10.0, dead_zone, 2.0, term)
    lower, upper, _ = bounds(rule, delta_e, v_cat, v_tr, f_tr, before, TS)
    assert -10.0 <= lower <= upper <= 10.0
    inside = min(max(before, -10.0), 10.0)
    assert inside - 2.0 <= lower
    assert upper <= inside + 2.0


@settings(max_examples=100, deadline=None)
@given(delta_e=st.floats(-5.0, 5.0), v_cat=velocities, force=st.floats(-10.0, 10.0), share=st.floats(0.0, 1.0))
def test_without_the_instantaneous_term_equal_velocities_decay_too(delta_e, v_cat, force, share):
    """With v_tr = v_cat the term is zero: whatever the robust bounds allow outside the dead zone never adds error."""
    rule = CorrectionRule(0.98, 10.0, 0.03, 100.0)
    assume(abs(v_cat) >= rule.dead_zone)
    lower, upper, _ = bounds(rule, delta_e, v_cat, v_cat, 100.0 + force, force, TS)
    after = error_after(delta_e, v_cat, v_cat, 100.0 + force, lower + share * (upper - lower))
    assert abs(after) <= abs(delta_e) + 1e-13


RULE = CorrectionRule(alpha=0.98, cap=10.0, dead_zone=0.03, rate=4.0)


def test_dead_zone_leaves_the_force_free_within_cap_and_rate():
    assert bounds(RULE, 1.0, 0.029, 0.0, 100.0, 0.0, TS) == (-4.0, 4.0, Correction.DEAD_ZONE)
    assert bounds(RULE, 1.0, -0.029, 0.0, 100.0, 8.0, TS) == (4.0, 10.0, Correction.DEAD_ZONE)
    no_zone = CorrectionRule(0.98, 10.0, 0.0, 4.0)
    assert bounds(no_zone, 1.0, 0.0, 0.0, 100.0, 0.0, TS)[2] == Correction.DEAD_ZONE


def test_small_error_is_left_to_the_bounds_as_they_are():
    lower, upper, case = bounds(RULE, 4e-4, 0.1, 0.3, 100.0, 0.0, TS)
    assert (lower, upper, case) == (pytest.approx(0.04), pytest.approx(2.0), Correction.ACTIVE)
    lower, upper, case = bounds(RULE, 4e-4, -0.1, 0.3, 100.0, 0.0, TS)
    assert (lower, upper, case) == (pytest.approx(-2.0), pytest.approx(-0.04), Correction.ACTIVE)


def test_cap_and_rate_limit_cut_the_bounds():
    lower, upper, case = bounds(RULE, 0.02, 0.1, 0.1, 100.0, 7.0, TS)
    assert (lower, upper, case) == (3.0, 10.0, Correction.CAPPED)
    lower, upper, case = bounds(RULE, 0.02, 0.1, 0.1, 100.0, 0.0, TS)
    assert (lower, upper, case) == (pytest.approx(2.0), 4.0, Correction.CAPPED)


def test_projection_where_interval_and_window_do_not_meet():
    assert bounds(RULE, 1.0, 0.1, 0.1, 100.0, 9.0, TS) == (10.0, 10.0, Correction.PROJECTED)
    assert bounds(RULE, -1.0, 0.1, 0.1, 100.0, -9.0, TS) == (-10.0, -10.0, Correction.PROJECTED)
    # The rate limit alone: the force has to come down first.
    assert bounds(RULE, 1.0, -0.1, 0.1, 100.0, 9.0, TS) == (5.0, 5.0, Correction.PROJECTED)


def test_no_error_needs_no_force():
    assert bounds(RULE, 0.0, 0.1, 0.2, 100.0, 0.0, TS) == (0.0, 0.0, Correction.ACTIVE)


@pytest.mark.parametrize(
    "bad", [{"alpha": 0.0}, {"alpha": 1.0}, {"cap": 0.0}, {"rate": 0.0}, {"dead_zone": -0.1}, {"cap": math.nan}]
)
def test_senseless_rules_are_refused(bad):
    with pytest.raises(ValueError, match=r"alpha|cap"):
        CorrectionRule(**{"alpha": 0.9, "cap": 10.0, "dead_zone": 0.03, "rate": 1.0, **bad})


@settings(max_examples=50, deadline=None)
@given(
    st.lists(
        st.tuples(st.floats(-300, 600), st.floats(-2, 2), st.floats(-20, 20), st.floats(-2, 2)), min_size=1, max_size=40
    )
)
def test_books_are_the_sums_of_the_thesis(cycles):
    """(3.46) and (3.47), F_cat = F_tr + F_cor, against exact summation; 1e-9 covers 40 roundings of a few J."""
    books = Books(TS)
    for f, v, c, w in cycles:
        books.add(f, v, f + c, w)
    e_tr = math.fsum(TS * f * v for f, v, _, _ in cycles)
    e_cat = math.fsum(TS * (f + c) * w for f, _, c, w in cycles)
    assert books.delta_e == pytest.approx(e_tr - e_cat, abs=1e-9)
    assert books.delta_p == pytest.approx(-math.fsum(TS * c for _, _, c, _ in cycles), abs=1e-9)
    assert books.exchanged_energy == pytest.approx(math.fsum(TS * abs(f * v) for f, v, _, _ in cycles), abs=1e-9)
    assert books.exchanged_momentum == pytest.approx(math.fsum(TS * abs(f) for f, _, _, _ in cycles), abs=1e-9)
    books.clear()
    assert books == Books(TS)


def test_accumulated_work_counts_only_while_the_rig_follows():
    """Readings are sums since the ride's start; what came about while nobody followed is left out."""
    books = Books(TS)
    books.accumulate(5.0, 4.0, 50.0, 40.0)
    assert (books.work_tr, books.impulse_cat) == (0.0, 0.0)
    books.accumulate(6.0, 4.5, 52.0, 41.0)
    books.accumulate(16.0, 44.5, 152.0, 441.0, counted=False)
    books.accumulate(16.5, 44.75, 153.0, 443.0)
    assert (books.delta_work, books.delta_impulse) == (1.5 - 0.75, 3.0 - 3.0)
    books.forget()
    books.accumulate(0.0, 0.0, 0.0, 0.0)
    assert (books.work_tr, books.work_cat) == (1.5, 0.75)


def test_an_error_within_its_tolerance_is_left_alone():
    """Noise of the books must not be chased: the window alone bounds the force, on either side of zero."""
    rule = CorrectionRule(0.98, 10.0, 0.03, 4.0, tolerance=0.01)
    for delta_e in (0.0099, -0.0099):
        assert bounds(rule, delta_e, 0.2, 0.2, 100.0, 0.0, TS) == (-4.0, 4.0, Correction.SETTLED)
    assert bounds(rule, 0.0101, 0.2, 0.2, 100.0, 0.0, TS)[2] != Correction.SETTLED
