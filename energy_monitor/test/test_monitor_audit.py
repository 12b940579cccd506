"""The whole audit on an invented ride, and its parameters."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from energy_monitor.agreement import Entry
from energy_monitor.audit import HEARTBEAT, Audit, CatenarySample, CommandSample, RigSample
from energy_monitor.books import accumulated_of, books_of
from energy_monitor.contact_quality import contact_quality_of
from energy_monitor.parameters import Parameters
from phil_base.parameters import ParameterError, build, defaults

TS = 0.002


def parameters(**changes):
    return build(Parameters, {**defaults("energy_monitor"), **changes})


class Invented:
    """A ride with small errors: the rig meets the forecast but for some noise, and both sides have meters."""

    def __init__(self, cycles, seed=3):
        chance, time = np.random.default_rng(seed), np.arange(cycles) * TS
        self.f_tr = 115.0 + 30.0 * np.sin(2.0 * np.pi * 1.16 * time) + chance.normal(0.0, 1.0, cycles)
        self.v_cat = 0.15 * np.cos(2.0 * np.pi * 1.16 * time)
        self.v_tr = self.v_cat + chance.normal(0.0, 0.003, cycles)
        self.f_cor = chance.normal(0.0, 1.0, cycles)
        self.f_predicted = np.append(self.f_tr[1:], 0.0) + chance.normal(0.0, 0.5, cycles)
        self.meters = np.cumsum(chance.normal(0.01, 0.02, (4, cycles)), axis=1)
        self.mode = np.ones(cycles, int)
        self.mode[0] = 0
        self.environment = np.zeros(cycles, int)

    @property
    def sent(self):
        """Force that each command sends to the catenary: no correction while another environment is followed."""
        return self.f_predicted + np.where(self.environment == 0, self.f_cor, 0.0)

    @property
    def f_cat(self):
        return np.append(0.0, self.sent[:-1])

    def rig(self, k):
        work, _, impulse, _ = self.meters[:, k].tolist()
        return RigSample(f"header {k}", float(self.f_tr[k]), float(self.v_tr[k]), work, impulse, int(self.mode[k]))

    def command(self, k):
        numbers = (self.f_tr[k], self.f_predicted[k], self.f_cor[k], self.sent[k])
        return CommandSample(*(float(number) for number in numbers), int(self.environment[k]))

    def catenary(self, k):
        _, work, _, impulse = self.meters[:, k].tolist()
        return CatenarySample(float(self.v_cat[k]), float(self.f_cat[k]), work, impulse)

    def __len__(self):
        return len(self.f_tr)


def invented(cycles, seed=3):
    return Invented(cycles, seed)


def drive(audit, ride, skip=()):
    """Send a ride as the nodes do: rig k and command k, then catenary k + 1; gives the booked cycles."""
    booked, count = [], len(ride)
    audit.catenary(0, ride.catenary(0))
    for k in range(count):
        if (0, k) not in skip:
            audit.rig(k, ride.rig(k), k == count - 1)
        if (1, k) not in skip:
            audit.command(k, ride.command(k))
        if k + 1 < count:
            audit.catenary(k + 1, ride.catenary(k + 1))
        for cycle, header in audit.settle(float(k)):
            assert header == f"header {cycle}"
            booked.append(cycle)
    return booked


def test_a_whole_ride_equals_the_vectorised_figures():
    audit, ride = Audit(parameters()), invented(3000)
    assert drive(audit, ride) == list(range(3000))
    # The rig does not follow in cycle 0. Same numbers in the same order: equal to the bit.
    counted = np.arange(3000) > 0
    history = books_of(ride.f_tr, ride.v_tr, ride.f_cat, ride.v_cat, TS, counted)
    assert audit.books.delta_e == history.delta_e[-1]
    assert audit.books.delta_p == history.delta_p[-1]
    work_tr, work_cat, impulse_tr, impulse_cat = ride.meters
    meters = accumulated_of(work_tr, work_cat, impulse_tr, impulse_cat, counted)
    assert audit.books.delta_work == meters.delta_work[-1]
    assert audit.books.delta_impulse == meters.delta_impulse[-1]
    assert audit.books.accumulated.work_tr == pytest.approx(work_tr[-1] - work_tr[0], abs=1e-9)
    whole = contact_quality_of(ride.f_tr, TS, 2.0, 2.0)
    assert audit.quality.statistics.samples == whole.samples == 2000
    assert audit.quality.statistics.sigma == pytest.approx(whole.sigma, abs=1e-8)  # rounding of two recursions
    assert audit.complaints(1e9, 1.0) == []
    assert audit.trace.broken == 0


def test_only_cycles_in_which_the_rig_follows_the_catenary_are_in_the_books():
    audit, ride = Audit(parameters()), invented(1000)
    ride.mode[:200] = 7  # approaching
    ride.mode[600:650] = 2  # bridging: follows
    ride.mode[700:] = 4  # retracting
    ride.environment[500:550] = 1
    drive(audit, ride)
    k = np.arange(1000)
    counted = (k >= 200) & (k < 700) & ~((k >= 500) & (k < 550))
    history = books_of(ride.f_tr, ride.v_tr, ride.f_cat, ride.v_cat, TS, counted)
    meters = accumulated_of(ride.meters[0], ride.meters[1], ride.meters[2], ride.meters[3], counted)
    assert audit.books.delta_e == history.delta_e[-1]
    assert audit.books.delta_work == meters.delta_work[-1]
    assert audit.books.cycles == 450
    assert audit.agreement.closed_at == 500
    assert audit.trace.broken == 0


def test_a_correction_that_is_lost_on_the_catenary_is_found():
    audit, ride = Audit(parameters()), invented(100)
    ride.environment[40:] = 1
    command = ride.command

    def told(k):
        sample = command(k)
        return sample._replace(environment=0) if k == 60 else sample

    ride.command = told
    drive(audit, ride)
    assert (audit.trace.broken, audit.trace.first_broken) == (1, 60)


def test_a_lost_command_is_named_and_not_booked_but_the_force_counts():
    audit, ride = Audit(parameters()), invented(2000)
    booked = drive(audit, ride, skip={(1, 700)})
    assert booked == [k for k in range(2000) if k != 700]
    assert audit.quality.samples == 1000
    (complaint,) = audit.complaints(2000.0, 1.0)
    assert complaint == "1 missing from command (cycles 700)"


def test_a_stalled_ride_is_old():
    audit = Audit(parameters())
    audit.catenary(0, CatenarySample(0.0, 0.0, 0.0, 0.0))
    assert audit.complaints(100.0, 1.0) == []
    audit.rig(0, RigSample(None, 100.0, 0.0, 0.0, 0.0, 1), False)
    audit.command(0, CommandSample(100.0, 100.0, 0.0, 100.0, 0))
    assert [cycle for cycle, _ in audit.settle(5.0)] == [0]
    assert audit.complaints(5.9, 1.0) == []
    assert audit.complaints(6.5, 1.0) == ["no complete cycle for 1.5 s, waiting for cycle 1"]


def test_a_monitor_that_was_held_up_raises_no_alarm_of_its_own():
    """Between two heartbeats it saw nothing; it gets as long again to read what waited, then the ride is stalled."""
    audit, time = Audit(parameters()), 5.0
    audit.catenary(0, CatenarySample(0.0, 0.0, 0.0, 0.0))
    audit.rig(0, RigSample(None, 100.0, 0.0, 0.0, 0.0, 1), False)
    audit.command(0, CommandSample(100.0, 100.0, 0.0, 100.0, 0))
    audit.alive(time)
    assert [cycle for cycle, _ in audit.settle(time)] == [0]
    time += 3.0  # it was stopped
    for beat in range(40):
        assert audit.complaints(time, 1.0) == [], beat
        audit.alive(time)
        time += HEARTBEAT
    audit.alive(time)
    assert audit.complaints(time + HEARTBEAT, 1.0) == ["no complete cycle for 7.1 s, waiting for cycle 1"]


@settings(max_examples=6, deadline=None)
@given(st.randoms(use_true_random=False), st.integers(1, 4))
@pytest.mark.slow
def test_any_order_of_reading_gives_the_books_of_the_one_in_step(chance, pieces):
    """Topic by topic, the controller's books among them: the same books, figures and complaints to the bit."""
    cycles = 1100
    ride = invented(cycles)
    lost = {(stream, chance.randrange(1, cycles - 1)) for stream in range(3) for _ in range(chance.randrange(4))}
    whole = Audit(parameters())
    streams = [[k for k in range(cycles) if (stream, k) not in lost] for stream in range(3)] + [range(0, cycles, 10)]
    entries = {}

    def told(audit, stream, k):
        if stream == 0:
            audit.rig(k, ride.rig(k), k == cycles - 1)
        elif stream == 1:
            audit.command(k, ride.command(k))
        elif stream == 2:
            audit.catenary(k, ride.catenary(k))
        elif k in entries:
            audit.believed(entries[k])
        for cycle, _ in audit.settle(0.0):
            if cycle % 10 == 0:
                entries.setdefault(cycle, audit.entry(cycle))
                audit.agreement.ours(audit.entry(cycle))

    for k in range(cycles):
        for stream in range(3):
            if k in streams[stream]:
                told(whole, stream, k)
    for k in range(0, cycles, 10):
        told(whole, 3, k)
    late = Audit(parameters())
    for piece in range(pieces):
        for stream in chance.sample(range(4), 4):
            length = -(-len(streams[stream]) // pieces)
            for k in streams[stream][piece * length : (piece + 1) * length]:
                told(late, stream, k)
    for one in (whole, late):
        assert one.matcher.complete == cycles - len({k for _, k in lost})
        assert one.matcher.missing == [sum(stream == s for s, _ in lost) for stream in range(3)]
        assert one.refused == 0
    assert late.entry(0) == whole.entry(0)
    assert late.quality.statistics == whole.quality.statistics
    assert late.agreement.compared == whole.agreement.compared > 100
    assert late.complaints(0.0, 1.0) == whole.complaints(0.0, 1.0)


@pytest.mark.parametrize("told", [True, False], ids=["monitor reset in between", "monitor not reset"])
@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_a_ride_that_began_anew_while_the_monitor_was_held_up(told, order):
    """Topic by topic: the end of one ride, then the beginning of the next; only the next one is in the books then."""
    first, second, audit, alone = invented(900), invented(400, seed=8), Audit(parameters()), Audit(parameters())
    cycles = range(300, 900), range(400)

    def send(audit, ride, stream, k):
        if stream == 0:
            audit.rig(k, ride.rig(k), False)
        elif stream == 1:
            audit.command(k, ride.command(k))
        else:
            audit.catenary(k, ride.catenary(k))

    for k in range(300):
        for stream in range(3):
            send(audit, first, stream, k)
        list(audit.settle(0.0))
    if told:
        audit.clear()
    booked = []
    for stream in order:
        for ride, numbers in zip((first, second), cycles, strict=True):
            for k in numbers:
                send(audit, ride, stream, k)
                booked += [cycle for cycle, _ in audit.settle(0.0)]
    for k in range(400):
        for stream in range(3):
            send(alone, second, stream, k)
    list(alone.settle(0.0))
    assert booked[-400:] == list(range(400))
    assert audit.entry(0) == alone.entry(0)
    assert audit.quality.statistics == alone.quality.statistics
    assert (audit.complaints(0.0, 1.0), audit.refused, audit.rides) == ([], 0, 1)


def test_a_stream_that_is_sent_again_is_no_new_ride():
    """What a late match brings once more: doubles."""
    audit, ride = Audit(parameters()), invented(300)
    for k in range(300):
        audit.rig(k, ride.rig(k), False)
        audit.command(k, ride.command(k))
        if k < 200:
            audit.catenary(k, ride.catenary(k))
    for k in range(300):
        audit.catenary(k, ride.catenary(k))
    assert [cycle for cycle, _ in audit.settle(0.0)] == list(range(300))
    assert (audit.matcher.missing, audit.matcher.duplicates, audit.rides) == ([0, 0, 0], 200, 0)


def test_disagreement_with_the_controller_is_said():
    audit = Audit(parameters())
    drive(audit, invented(100))
    audit.agreement.ours(audit.entry(99))
    audit.agreement.theirs(replace(audit.entry(99), delta_e=audit.books.delta_e + 0.1))
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
    sample = RigSample(None, 100.0, 0.0, 0.0, 0.0, 1)
    assert audit.rig(0, sample, False)
    assert not audit.rig(0, sample, False)
    assert audit.quality.samples == 1


def test_stray_cycle_numbers_are_refused_and_move_nothing():
    plain, disturbed, ride = Audit(parameters()), Audit(parameters()), invented(1500)
    drive(plain, ride)
    booked = []
    for k in range(1500):
        for stray in (10**9, k + 2000) if k % 100 == 50 else ():
            assert not disturbed.rig(stray, RigSample("stray", 1.0, 0.0, 0.0, 0.0, 1), True)
            disturbed.command(stray, CommandSample(1.0, 1.0, 1.0, 2.0, 0))
            assert not disturbed.catenary(stray, CatenarySample(0.0, 0.0, 0.0, 0.0))
            disturbed.believed(Entry(stray, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
        disturbed.catenary(k, ride.catenary(k))
        disturbed.rig(k, ride.rig(k), k == 1499)
        disturbed.command(k, ride.command(k))
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
        audit.catenary(k, CatenarySample(0.0, 100.0, 1.0 * k, 2.0 * k))
        audit.rig(k, RigSample(None, 100.0, 0.0, 1.5 * k, 2.0 * k, 1), False)
        audit.command(k, CommandSample(100.0, 100.0, 0.0, 100.0, 0))
        booked += [cycle for cycle, _ in audit.settle(0.0)]
    assert booked == list(range(50_049, 51_000))
    # What the meters had counted before belongs to no cycle that was seen.
    assert audit.books.delta_work == pytest.approx(0.5 * 950, rel=1e-9)
    assert audit.refused == 3 * 49


def test_a_cut_off_beyond_half_the_rate_is_refused():
    with pytest.raises(ParameterError, match=r"contact\.cutoff.*cycle_time"):
        parameters(**{"contact.cutoff": 60.0, "cycle_time": 0.01})


def test_a_value_out_of_range_is_refused():
    with pytest.raises(ParameterError, match=r"'contact\.order' = 0 is not allowed: an integer from 1 to 10"):
        parameters(**{"contact.order": 0})
