"""Which cycles of a ride tracking and contact force are judged by."""

import numpy as np

from energy_monitor.analysis import _evaluated, _spectrum_within, spectrum

CYCLE = np.arange(100)


def test_a_ride_that_follows_from_its_beginning_is_judged_after_its_run_in():
    """A rig holds in cycle 0; that does not put the run-in off."""
    counted = CYCLE > 0
    assert np.flatnonzero(_evaluated(CYCLE, counted, 20)).tolist() == list(range(20, 100))


def test_every_time_that_the_rig_begins_to_follow_has_a_run_in():
    """Soft start at 30, something else from 60 to 69, landing at 90."""
    counted = ((CYCLE >= 30) & (CYCLE < 60)) | ((CYCLE >= 70) & (CYCLE < 90))
    assert np.flatnonzero(_evaluated(CYCLE, counted, 10)).tolist() == [*range(40, 60), *range(80, 90)]


def test_a_ride_that_never_follows_is_taken_as_a_whole():
    assert np.flatnonzero(_evaluated(CYCLE, np.zeros(100, dtype=bool), 30)).tolist() == list(range(30, 100))


def test_the_spectrum_ends_with_the_cycles_that_are_judged():
    """A landing is a step of 120 N, which would outweigh everything else below 2 Hz."""
    force = 120.0 + 10.0 * np.sin(0.3 * np.arange(1000))
    landed = np.where(np.arange(1000) < 800, force, 0.0)
    found = _spectrum_within(landed, np.arange(1000), np.arange(100, 800), 0.002)
    for mine, theirs in zip(found, spectrum(force[100:800], 0.002), strict=True):
        np.testing.assert_array_equal(mine, theirs)
    assert _spectrum_within(landed, np.arange(1000), np.arange(0), 0.002)[0].size == 0
