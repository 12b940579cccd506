"""The real-time model against the reference: measures against closed forms, goals, a shortened run."""

import math
from pathlib import Path

import numpy as np
import pytest

from validate import realtime
from validate.realtime import Signals, agreement

WHOLE = 2.0 * np.pi * np.arange(4000) / 400.0
"""Phase of ten whole periods."""


def test_a_signal_agrees_with_itself() -> None:
    found = agreement(np.sin(WHOLE), np.sin(WHOLE))
    assert (found.error, found.rms, found.offset) == (0.0, 0.0, 0.0)
    assert found.correlation == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("phase", [0.05, 0.5, math.pi])
def test_agreement_of_a_delayed_sine(phase: float) -> None:
    """Correlation cos(phase); rms over standard deviation 2 sin(phase/2), whatever the amplitude; rounding."""
    truth = 30.0 * np.sin(WHOLE)
    found = agreement(30.0 * np.sin(WHOLE - phase), truth)
    assert found.correlation == pytest.approx(math.cos(phase), abs=1e-9)
    assert found.error == pytest.approx(2.0 * math.sin(0.5 * phase), rel=1e-9)
    assert found.rms == pytest.approx(30.0 / math.sqrt(2.0) * found.error, rel=1e-9)


def test_an_offset_is_an_error_though_the_correlation_does_not_see_it() -> None:
    truth = math.sqrt(2.0) * np.sin(WHOLE)
    found = agreement(truth + 0.5, truth)
    assert found.correlation == pytest.approx(1.0, abs=1e-12)
    assert (found.error, found.offset) == pytest.approx((0.5, 0.5), rel=1e-9)


@pytest.mark.parametrize("ts", [2e-4, 2e-3])
def test_filter_is_without_phase_and_the_same_at_both_rates(ts: float) -> None:
    """5 Hz passes (0.05 %), 100 Hz does not (below 1e-4), at the rate of either model."""
    t = ts * np.arange(1, round(4.0 / ts) + 1)
    signals = Signals(t, np.sin(2 * np.pi * 5.0 * t), np.sin(2 * np.pi * 100.0 * t)).filtered()
    inner = (t > 1.0) & (t < 3.0)
    np.testing.assert_allclose(signals.w[inner], np.sin(2 * np.pi * 5.0 * t[inner]), atol=5e-4)
    assert np.abs(signals.F[inner]).max() < 1e-4


def test_samples_at_given_times() -> None:
    t = 1e-3 * np.arange(1, 101)
    signals = Signals(t, t, 2.0 * t)
    times = np.array([0.01, 0.05])
    np.testing.assert_allclose(signals.at(times).F, 2.0 * times)
    for wrong in (0.0105, 0.2, 0.0):
        with pytest.raises(ValueError, match="no samples"):
            signals.at(np.array([wrong]))


@pytest.mark.parametrize(("speed", "newton"), [(200, 108.8), (250, 130.625), (320, 169.328)])
def test_mean_force_is_the_limit_of_the_standard(speed: int, newton: float) -> None:
    """0.00047 v^2 + 90 N up to 200 km/h, 0.00097 v^2 + 70 N above."""
    assert realtime.target(speed) == pytest.approx(newton, rel=1e-12)


def test_no_limit_no_target() -> None:
    with pytest.raises(ValueError, match="500 km/h"):
        realtime.target(500)


@pytest.mark.parametrize("speed", [200 / 3.6, 320 / 3.6])
def test_nothing_comes_back_from_the_ends_of_the_reference(speed: float) -> None:
    """Follow the first wave to either end and back to where the pantograph is by then."""
    duration, c = 11.3, realtime.line().contact.wave_speed
    behind, ahead = realtime.needed_spans(speed, duration)
    left, right = realtime.START + 60.0 * behind, 60.0 * ahead - realtime.START
    out = left / c
    assert out + (left + speed * out) / (c - speed) > duration
    out = right / c
    assert out + (right - speed * out) / (c + speed) > duration


def test_goals_go_to_the_cases_that_they_are_for() -> None:
    measured = {"error of force": (0.1, "", ""), "truncation": (0.05, "", ""), "sigma of force": (30.0, "N", "")}
    two, four, fast, slow = (
        {row.name: row.goal for row in realtime.rows(speed, "three_mass", spans, measured)}
        for speed, spans in ((250, 2), (250, 4), (320, 4), (200, 4))
    )
    assert two == {"error of force": "<= 0.12", "truncation": "<= 0.07", "sigma of force": ""}
    assert four == {"error of force": "<= 0.08", "truncation": "<= 0.04", "sigma of force": ""}
    assert fast == {"error of force": "<= 0.15", "truncation": "", "sigma of force": ""}
    assert set(slow.values()) == {""}


@pytest.mark.slow
def test_shortened_run(tmp_path: Path) -> None:
    """Mean force as wanted (0.2 N: the reference rides it too); errors as in full runs, half as much for chance."""
    outcome = realtime.run(True, tmp_path, lambda _: None)
    rows = {(row.name, row.case): row.value for row in outcome.rows}
    for spans, error in ((2, 0.18), (4, 0.12)):
        case = f"250 km/h, en50318, {spans} spans"
        assert rows["error of force", case] < error
        assert rows["correlation of force", case] > 0.98
        assert 0.0 < rows["truncation", case] < error
        assert rows["displacement, rms of difference", case] < 0.45
        assert rows["mean force", case] == pytest.approx(realtime.target(250), abs=0.2)
    assert (tmp_path / "validate-realtime-250-en50318.png").stat().st_size > 10_000
