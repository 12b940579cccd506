"""Comparison of two books and tracing of samples."""

import pytest

from energy_monitor.agreement import Agreement, Entry, SampleTrace, Tolerance

TOLERANCE = Tolerance(energy=1e-3, momentum=1e-3, relative=1e-6)


def entry(cycle, delta_e=0.0, delta_p=0.0, energy=100.0, momentum=100.0, delta_work=0.0, delta_impulse=0.0):
    return Entry(cycle, delta_e, delta_p, delta_work, delta_impulse, energy, momentum)


def test_equal_books_agree_whichever_comes_first():
    agreement = Agreement(TOLERANCE)
    for cycle in range(0, 2000, 10):
        first, second = (agreement.ours, agreement.theirs) if cycle % 20 else (agreement.theirs, agreement.ours)
        first(entry(cycle, 0.1, 0.2))
        second(entry(cycle, 0.1, 0.2))
    assert agreement.agrees
    assert agreement.compared == 200


def test_only_equal_cycles_are_compared():
    agreement = Agreement(TOLERANCE)
    agreement.ours(entry(10, 1.0))
    agreement.theirs(entry(20, 2.0))
    assert agreement.compared == 0
    agreement.theirs(entry(10, 1.0))
    agreement.ours(entry(20, 2.0))
    assert (agreement.compared, agreement.agrees) == (2, True)


def test_one_side_may_be_ahead_and_nothing_grows_without_end():
    agreement = Agreement(TOLERANCE)
    for cycle in range(0, 600, 10):
        agreement.theirs(entry(cycle))
    for cycle in range(0, 600, 10):
        agreement.ours(entry(cycle))
    assert agreement.compared == 60
    for cycle in range(10000):
        agreement.ours(entry(cycle))
    assert agreement.compared == 60


def test_a_difference_beyond_the_tolerance_is_kept_with_its_first_cycle():
    agreement = Agreement(TOLERANCE)
    for cycle, energy in ((0, 0.0), (10, 1.09e-3), (20, 1.2e-3), (30, 0.5), (40, 0.0)):
        agreement.ours(entry(cycle, 1.0))
        agreement.theirs(entry(cycle, 1.0 + energy))
    assert not agreement.agrees
    assert agreement.disagreements == 2
    assert agreement.first_disagreement == 20
    assert abs(agreement.worst_energy - 0.5) < 1e-12
    assert agreement.energy_difference == 0.0


def test_momentum_is_compared_as_well():
    agreement = Agreement(TOLERANCE)
    agreement.ours(entry(0))
    agreement.theirs(entry(0, delta_p=-2e-3))
    assert agreement.first_disagreement == 0
    agreement.clear()
    assert agreement.agrees


@pytest.mark.parametrize("book", ["delta_work", "delta_impulse"])
def test_the_accumulated_book_is_compared_as_well(book):
    agreement = Agreement(TOLERANCE)
    agreement.ours(entry(0, 0.5))
    agreement.theirs(entry(0, 0.5, **{book: 1.05e-3}))
    assert agreement.agrees
    agreement.ours(entry(10, 0.5))
    agreement.theirs(entry(10, 0.5, **{book: 1.2e-3}))
    assert agreement.first_disagreement == 10
    worst = agreement.worst_energy if book == "delta_work" else agreement.worst_momentum
    assert worst == pytest.approx(1.2e-3, rel=1e-12)


def test_nothing_is_compared_once_the_other_book_is_about_something_else():
    agreement = Agreement(TOLERANCE)
    agreement.theirs(entry(10, 0.0))
    agreement.theirs(entry(20, 5.0))
    agreement.close(15)
    agreement.close(30)
    agreement.ours(entry(10))
    agreement.ours(entry(20))
    assert (agreement.compared, agreement.agrees, agreement.closed_at) == (1, True, 15)
    agreement.clear()
    agreement.ours(entry(20))
    agreement.theirs(entry(20, 5.0))
    assert not agreement.agrees


def test_samples_that_fit_leave_no_trace():
    trace = SampleTrace()
    assert trace.add(0, 100.0, (100.0, 101.0, 0.1, 101.1), 0.0)
    assert trace.add(1, 90.0, (90.0, 89.0, -0.2, 88.8), 101.1)
    # A cycle is missing: what the catenary felt cannot be held against a command that is not known.
    assert trace.add(3, 95.0, (95.0, 95.0, 0.0, 95.0), 1.0)
    assert trace.broken == 0


def test_a_command_from_another_cycle_is_found():
    trace = SampleTrace()
    assert trace.add(0, 100.0, (100.0, 100.0, 0.0, 100.0), 0.0)
    assert not trace.add(1, 101.0, (100.0, 100.0, 0.0, 100.0), 100.0)
    assert (trace.broken, trace.first_broken) == (1, 1)
    assert "another force than the rig's" in trace.reason


def test_a_wrong_sum_and_a_wrong_drive_of_the_catenary_are_found():
    trace = SampleTrace()
    assert not trace.add(0, 100.0, (100.0, 100.0, 1.0, 100.0), 0.0)
    assert "f_predicted + f_cor" in trace.reason
    trace.clear()
    assert trace.add(0, 100.0, (100.0, 100.0, 1.0, 101.0), 0.0)
    assert not trace.add(1, 100.0, (100.0, 100.0, 1.0, 101.0), 100.0)
    assert "catenary felt" in trace.reason
