"""Rides of a pantograph on the moving catenary: pieces, soft start, imposed forces, balance of forces."""

import math

import numpy as np
import pytest

from catenary_model import reference
from catenary_model.model import Catenary, Config
from catenary_model.pantograph import Pantograph
from catenary_model.ride import Coupled, joined, push, ride

V = 250.0 / 3.6
PANTOGRAPH = Pantograph.of([15.0, 7.2], [[100.0, -10.0], [-10.0, 10.0]], [[4250.0, -4200.0], [-4200.0, 4200.0]], 120.0)


def catenary() -> Catenary:
    return Catenary(Config(spans=2, speed=V, start_position=30.0))


def test_pieces_are_the_whole() -> None:
    whole = ride(catenary(), PANTOGRAPH, 1.2)
    train = Coupled(catenary(), PANTOGRAPH)
    pieces = joined([train.go_on(cycles) for cycles in (1, 99, 400, 100)])
    for name in ("t", "w", "v", "F", "track", "slack_droppers"):
        np.testing.assert_array_equal(getattr(pieces, name), getattr(whole, name))
    assert whole.t[-1] == pytest.approx(1.2)
    np.testing.assert_allclose(whole.track, 30.0 + V * whole.t)


def test_start_as_the_reference_does() -> None:
    """Same law of the uplift, same start: force and height agree while they rise, 1 N and 0.3 mm of 100 N and 30 mm."""
    moving = ride(catenary(), PANTOGRAPH, 1.0, soft_start=1.0)
    fixed = reference.Reference(
        reference.Config(speed=V, spans=8, first_span=-2, start_position=30.0, element_length=0.5, time_step=5e-4)
    ).ride(PANTOGRAPH, 1.0, ramp=1.0)
    early = moving.t < 0.5
    np.testing.assert_allclose(moving.w[early], fixed.w[3::4][early], atol=3e-4)
    smooth = [np.convolve(F, np.full(n, 1.0 / n), "valid") for F, n in ((moving.F, 50), (fixed.F, 200))]
    np.testing.assert_allclose(smooth[0][:200], smooth[1][::4][:200], atol=1.0)


def test_pushing_is_stepping() -> None:
    force = 100.0 + 20.0 * np.sin(np.arange(300) / 9.0)
    one, other = catenary(), catenary()
    found = push(one, force)
    for k, newton in enumerate(force):
        other.step(float(newton))
        assert found.w[k] == other.w_cat
    np.testing.assert_array_equal(found.F, force)
    assert found.t[-1] == pytest.approx(0.6)
    assert push(one, force[:5]).t[0] == pytest.approx(0.602)


def test_mean_forces_balance() -> None:
    """Over whole spans the mean contact force is the uplift less the frame spring's part k_1 <y_1>, 1 %."""
    train = Coupled(catenary(), PANTOGRAPH)
    train.go_on(2500)
    found = train.go_on(round(5 * 60.0 / V / 2e-3))
    frame = found.w.mean() + found.F.mean() / 50e3 + found.F.mean() / 4200.0
    assert found.F.mean() == pytest.approx(120.0 - 50.0 * frame, rel=0.01)


def test_a_held_force_acts_on_both_sides() -> None:
    train = Coupled(catenary(), PANTOGRAPH)
    train.go_on(1500)
    force = train.catenary.f_cat
    held = train.go_on(10, held=force)
    np.testing.assert_allclose(held.F, force)
    after = train.go_on(500)
    assert np.abs(np.diff(after.F)).max() > 0.0
    assert math.isfinite(after.F.sum())


def test_a_blow_downwards_loses_contact_and_it_comes_back() -> None:
    train = Coupled(catenary(), PANTOGRAPH)
    train.go_on(1500)
    train.strike(-2.0)
    found = train.go_on(1000)
    assert (found.F[:100] == 0.0).sum() > 20
    assert (found.F[-250:] > 0.0).all()


def test_a_ride_below_one_cycle_is_refused() -> None:
    with pytest.raises(ValueError, match="shorter than one cycle"):
        ride(catenary(), PANTOGRAPH, 1e-4)
