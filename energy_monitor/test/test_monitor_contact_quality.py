"""Contact force: low-pass, running statistics, losses."""

from itertools import groupby

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.signal import sosfreqz

from energy_monitor.contact_quality import (
    ContactQuality,
    ContactStatistics,
    LowPass,
    contact_quality_of,
    low_pass,
    low_passed,
    run_in_cycles,
)

TS = 0.002
FORCES = st.integers(1, 200).flatmap(lambda n: arrays(np.float64, n, elements=st.floats(-50.0, 400.0)))


def stream(force, **options):
    quality = ContactQuality(TS, **{"run_in": 0.0, "loss_threshold": 2.0, **options})
    for k, value in enumerate(force.tolist()):
        quality.add(k, value)
    return quality


@settings(max_examples=40, deadline=None)
@given(FORCES, st.integers(1, 8), st.sampled_from([0.0, 0.05, 0.2]))
def test_a_cycle_at_a_time_equals_the_whole_ride(force, order, run_in):
    # Tolerance: the recursions of Welford and of the filter round differently from numpy's sums and scipy's loop;
    # sigma near zero is the root of a difference, hence its larger absolute tolerance.
    live = stream(force, order=order, run_in=run_in).statistics
    whole = contact_quality_of(force, TS, run_in, 2.0, order=order)
    assert live.samples == whole.samples
    assert live.losses == whole.losses
    assert live.loss_share == pytest.approx(whole.loss_share, abs=1e-12)
    for figure in ("mean", "minimum", "maximum"):
        assert getattr(live, figure) == pytest.approx(getattr(whole, figure), abs=1e-8)
    assert live.sigma == pytest.approx(whole.sigma, abs=1e-6)


@settings(max_examples=30, deadline=None)
@given(FORCES, st.integers(1, 8))
def test_the_scalar_filter_equals_scipy(force, order):
    # Tolerance: a fused multiply-add may round the last bit of either; stable filter, so it does not grow.
    one = LowPass(low_pass(TS, 20.0, order))
    assert [one.step(value) for value in force.tolist()] == pytest.approx(low_passed(force, TS, 20.0, order), abs=1e-8)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_low_pass_cuts_off_at_20_hz(order):
    # Butterworth: 3 dB at the cut-off for every order, 1 at zero; the bilinear transform is prewarped: both exact.
    _, gain = sosfreqz(low_pass(TS, 20.0, order), worN=[0.0, 20.0, 100.0], fs=1.0 / TS)
    assert abs(gain[0]) == pytest.approx(1.0, abs=1e-9)
    assert abs(gain[1]) == pytest.approx(np.sqrt(0.5), abs=1e-9)
    assert abs(gain[2]) < 5.0 ** (-order)


def test_a_constant_force_passes_from_the_first_sample():
    quality = stream(np.full(50, 117.0))
    statistics = quality.statistics
    # Rounding of the steady state only: the filter must not ring up from zero.
    assert quality.force == pytest.approx(117.0, abs=1e-9)
    assert statistics.sigma == pytest.approx(0.0, abs=1e-6)
    assert (statistics.minimum, statistics.maximum) == pytest.approx((117.0, 117.0), abs=1e-9)
    assert statistics.statistical_minimum == pytest.approx(117.0, abs=1e-5)


def test_a_slow_sine_keeps_its_statistics():
    # 1 Hz is far below 20 Hz: sigma = A / sqrt(2), extremes mean -+ A. 0.1 %: sampling of the peaks and end effects.
    time = np.arange(5000) * TS
    statistics = stream(120.0 + 30.0 * np.sin(2.0 * np.pi * time), run_in=2.0).statistics
    assert statistics.samples == 4000
    assert statistics.mean == pytest.approx(120.0, abs=0.03)
    assert statistics.sigma == pytest.approx(30.0 / np.sqrt(2.0), rel=1e-3)
    assert statistics.statistical_maximum == pytest.approx(120.0 + 90.0 / np.sqrt(2.0), rel=1e-3)
    assert (statistics.minimum, statistics.maximum) == pytest.approx((90.0, 150.0), rel=1e-3)


def test_losses_are_counted_on_the_measured_force():
    force = np.full(1000, 100.0)
    force[300:303] = 0.0  # 6 ms: the 20 Hz low-pass would hide it
    force[500:510] = 2.0  # at the threshold is lost
    force[999] = -1.0
    statistics = stream(force).statistics
    assert statistics.minimum > 2.0
    assert statistics.losses == 3
    assert statistics.loss_share == pytest.approx(14 / 1000)


@pytest.mark.parametrize(
    ("duration", "losses", "cycles"),
    [(0.0, 4, 9), (0.002, 4, 9), (0.003, 2, 7), (0.004, 2, 7), (0.005, 1, 5), (0.0101, 0, 0)],
)
def test_a_loss_counts_from_its_shortest_duration_on(duration, losses, cycles):
    """A sample stands for its cycle: two of them in a row last 4 ms."""
    force = np.full(1000, 100.0)
    force[[200, 202, *range(400, 402), *range(600, 605)]] = 0.0
    for found in (
        stream(force, loss_duration=duration).statistics,
        contact_quality_of(force, TS, 0.0, 2.0, loss_duration=duration),
    ):
        assert found.losses == losses
        assert found.loss_share == pytest.approx(cycles / 1000)


def test_a_loss_is_in_the_statistics_as_soon_as_it_is_long_enough():
    quality = ContactQuality(TS, 0.0, 2.0, loss_duration=0.005)
    seen = []
    for k, value in enumerate([100.0, 0.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0]):
        quality.add(k, value)
        seen.append((quality.statistics.losses, round(quality.statistics.loss_share * (k + 1))))
    assert seen == [(0, 0), (0, 0), (0, 0), (1, 3), (1, 4), (1, 4), (1, 4), (1, 4)]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.booleans(), st.integers(1, 8)), max_size=20), st.floats(0.0, 0.02))
def test_losses_live_and_of_the_whole_ride_are_those_of_the_record(pieces, duration):
    """Against the record read piece by piece."""
    force = np.array([0.0 if lost else 90.0 for lost, length in pieces for _ in range(length)])
    runs = [len(list(run)) for lost, run in groupby(force.tolist(), lambda value: value <= 2.0) if lost]
    counted = [run for run in runs if run * TS >= duration * (1.0 - 1e-9)]
    live = stream(force, loss_duration=duration).statistics
    whole = contact_quality_of(force, TS, 0.0, 2.0, loss_duration=duration)
    assert live.losses == whole.losses == len(counted)
    assert live.loss_share == whole.loss_share == pytest.approx(sum(counted) / max(len(force), 1))


def test_a_loss_that_began_in_the_run_in_counts_from_its_end():
    force = np.full(100, 100.0)
    force[40:60] = 0.0
    assert stream(force, run_in=0.1).statistics.losses == 1
    assert contact_quality_of(force, TS, 0.1, 2.0).losses == 1


def test_without_samples_there_are_no_statistics():
    assert stream(np.full(10, 100.0), run_in=1.0).statistics == ContactStatistics()
    assert contact_quality_of(np.zeros(0), TS, 0.0, 2.0) == ContactStatistics()


def test_a_cleared_monitor_starts_anew():
    quality = stream(np.linspace(0.0, 300.0, 400))
    quality.clear()
    for k in range(20):
        quality.add(k, 80.0)
    assert quality.statistics.mean == pytest.approx(80.0, abs=1e-9)
    assert quality.statistics.losses == 0
    for value in (0.0, 0.0):  # a loss that the reset cut is over
        quality.clear()
        quality.add(0, value)
    assert quality.statistics.losses == 1


@pytest.mark.parametrize(("run_in", "cycles"), [(0.0, 0), (2.0, 1000), (0.001, 1), (0.002, 1), (0.0021, 2), (0.6, 300)])
def test_the_run_in_ends_at_a_whole_cycle(run_in, cycles):
    assert run_in_cycles(run_in, TS) == cycles


def test_a_cut_off_above_half_the_rate_is_refused():
    with pytest.raises(ValueError, match="250 Hz"):
        low_pass(TS, 250.0)
