"""The whole audit on an invented ride, and its parameters."""

import numpy as np
import pytest

from energy_monitor.agreement import Entry
from energy_monitor.audit import Audit, CatenarySample, CommandSample, RigSample
from energy_monitor.books import books_of
from energy_monitor.contact_quality import contact_quality_of
from energy_monitor.parameters import Parameters
from phil_node.parameters import ParameterError, build, defaults

TS = 0.002


def parameters(**changes):
    return build(Parameters, {**defaults("energy_monitor"), **changes})


def invented(cycles, seed=3):
    """F_tr, v_tr, F_cor, v_cat: a ride with small errors."""
    chance, time = np.random.default_rng(seed), np.arange(cycles) * TS
    f_tr = 115.0 + 30.0 * np.sin(2.0 * np.pi * 1.16 * time) + chance.normal(0.0, 1.0, cycles)
    v_cat = 0.15 * np.cos(2.0 * np.pi * 1.16 * time)
    return f_tr, v_cat + chance.normal(0.0, 0.003, cycles), chance.normal(0.0, 1.0, cycles), v_cat


def drive(audit, ride, skip=()):
    """Send a ride as the nodes do: rig k and command k, then catenary k + 1; gives the booked cycles."""
    f_tr, v_tr, f_cor, v_cat = (column.tolist() for column in ride)
    booked, count = [], len(f_tr)
    audit.catenary(0, CatenarySample(v_cat[0], 0.0))
    for k in range(count):
        if (0, k) not in skip:
            audit.rig(k, RigSample(f"header {k}", f_tr[k], v_tr[k], 0.1 * k), k == count - 1)
        if (1, k) not in skip:
            audit.command(k, CommandSample(f_tr[k], f_cor[k], f_tr[k] + f_cor[k]))
        audit.catenary(k + 1, CatenarySample(v_cat[min(k + 1, count - 1)], f_tr[k] + f_cor[k]))
        for cycle, header in audit.settle(float(k)):
            assert header == f"header {cycle}"
            booked.append(cycle)
    return booked


def test_a_whole_ride_equals_the_vectorised_figures():
    audit, ride = Audit(parameters()), invented(3000)
    assert drive(audit, ride) == list(range(3000))
    f_tr, v_tr, f_cor, v_cat = ride
    history = books_of(f_tr, v_tr, f_tr + f_cor, v_cat, TS)
    # Same products in the same order: equal to the bit.
    assert audit.books.delta_e == history.delta_e[-1]
    assert audit.books.delta_p == history.delta_p[-1]
    assert audit.work == pytest.approx(299.9)
    whole = contact_quality_of(f_tr, TS, 2.0, 2.0)
    assert audit.quality.statistics.samples == whole.samples == 2000
    assert audit.quality.statistics.sigma == pytest.approx(whole.sigma, abs=1e-8)  # rounding of two recursions
    assert audit.complaints(1e9, 1.0) == []
    assert audit.trace.broken == 0


def test_a_lost_command_is_named_and_not_booked_but_the_force_counts():
    audit, ride = Audit(parameters()), invented(2000)
    booked = drive(audit, ride, skip={(1, 700)})
    assert booked == [k for k in range(2000) if k != 700]
    assert audit.quality.samples == 1000
    (complaint,) = audit.complaints(2000.0, 1.0)
    assert complaint == "1 missing from command (cycles 700)"


def test_a_stalled_ride_is_old():
    audit = Audit(parameters())
    audit.catenary(0, CatenarySample(0.0, 0.0))
    assert audit.complaints(100.0, 1.0) == []
    audit.rig(0, RigSample(None, 100.0, 0.0, 0.0), False)
    audit.command(0, CommandSample(100.0, 0.0, 100.0))
    assert [cycle for cycle, _ in audit.settle(5.0)] == [0]
    assert audit.complaints(5.9, 1.0) == []
    assert audit.complaints(6.5, 1.0) == ["no complete cycle for 1.5 s, waiting for cycle 1"]


def test_disagreement_with_the_controller_is_said():
    audit = Audit(parameters())
    drive(audit, invented(100))
    audit.agreement.ours(audit.entry(99))
    audit.agreement.theirs(Entry(99, audit.books.delta_e + 0.1, audit.books.delta_p, 1.0, 1.0))
    (complaint,) = audit.complaints(99.0, 1.0)
    assert complaint.startswith("books disagree with the controller's since cycle 99: dE by 0.1 J")


def test_a_cleared_audit_gives_the_same_ride_again():
    audit, ride = Audit(parameters()), invented(1500)
    drive(audit, ride)
    first = (audit.books.delta_e, audit.quality.statistics)
    audit.clear()
    assert drive(audit, ride) == list(range(1500))
    assert (audit.books.delta_e, audit.quality.statistics) == first


def test_a_rig_message_that_comes_again_counts_once():
    audit = Audit(parameters(**{"contact.run_in": 0.0}))
    sample = RigSample(None, 100.0, 0.0, 0.0)
    assert audit.rig(0, sample, False)
    assert not audit.rig(0, sample, False)
    assert audit.quality.samples == 1


def test_stray_cycle_numbers_are_refused_and_move_nothing():
    plain, disturbed, ride = Audit(parameters()), Audit(parameters()), invented(1500)
    drive(plain, ride)
    f_tr, v_tr, f_cor, v_cat = (column.tolist() for column in ride)
    booked = []
    for k in range(1500):
        for stray in (10**9, k + 2000) if k % 100 == 50 else ():
            assert not disturbed.rig(stray, RigSample("stray", 1.0, 0.0, 0.0), True)
            disturbed.command(stray, CommandSample(1.0, 1.0, 2.0))
            assert not disturbed.catenary(stray, CatenarySample(0.0, 0.0))
            disturbed.believed(Entry(stray, 0.0, 0.0, 0.0, 0.0))
        disturbed.catenary(k, CatenarySample(v_cat[k], f_tr[k - 1] + f_cor[k - 1] if k else 0.0))
        disturbed.rig(k, RigSample(None, f_tr[k], v_tr[k], 0.1 * k), k == 1499)
        disturbed.command(k, CommandSample(f_tr[k], f_cor[k], f_tr[k] + f_cor[k]))
        booked += [cycle for cycle, _ in disturbed.settle(0.0)]
    assert booked == list(range(1500))
    assert disturbed.refused == 15 * 2 * 4
    assert disturbed.matcher.finished and disturbed.matcher.missing == [0, 0, 0]
    assert disturbed.entry(1499) == plain.entry(1499)
    assert disturbed.quality.statistics == plain.quality.statistics
    disturbed.clear()
    assert disturbed.refused == 0


def test_a_ride_that_is_joined_late_is_taken_up():
    audit, booked = Audit(parameters()), []
    for k in range(50_000, 51_000):
        audit.catenary(k, CatenarySample(0.0, 100.0))
        audit.rig(k, RigSample(None, 100.0, 0.0, 0.0), False)
        audit.command(k, CommandSample(100.0, 0.0, 100.0))
        booked += [cycle for cycle, _ in audit.settle(0.0)]
    assert booked == list(range(50_049, 51_000))
    assert audit.refused == 3 * 49


def test_a_cut_off_beyond_half_the_rate_is_refused():
    with pytest.raises(ParameterError, match=r"contact\.cutoff.*cycle_time"):
        parameters(**{"contact.cutoff": 60.0, "cycle_time": 0.01})


def test_a_value_out_of_range_is_refused():
    with pytest.raises(ParameterError, match=r"'contact\.order' = 0 is not allowed: an integer from 1 to 10"):
        parameters(**{"contact.order": 0})
