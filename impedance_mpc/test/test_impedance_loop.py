"""Closed loop with an ideal rig: tracking, energy, momentum, correction on against off."""

import pytest
from impedance_loop import MassSpringDamper, MovingString, ride

from impedance_mpc.controller import ImpedanceController
from impedance_mpc.parameters import Parameters
from phil_base.parameters import build, defaults

pytestmark = pytest.mark.slow

SCHEMES = {True: "integrated_with_correction", False: "integrated"}


def run(environment, cycles, noise=0.0, frequency=40.0, **changes):
    measured = {"forecast.stiffness": 3e4, "forecast.head_mass": 7.5}
    measured |= {"rig_natural_frequency_hz": 40.0, "rig_damping_ratio": 0.8, "rig_delay": 0.0}
    config = build(Parameters, {**defaults("impedance_mpc"), **measured, **changes})
    controller = ImpedanceController(config, environment.impedance)
    return ride(controller, environment, cycles, noise=noise, frequency=frequency)


def test_mass_spring_damper_is_emulated():
    """One degree of freedom, same code; the reduced model is exact, only the force changes within the horizon."""
    figures = run(MassSpringDamper(), 1500).summary()
    assert figures["pos_mm"] < 0.05
    assert figures["fallbacks"] == 0


@pytest.fixture(scope="module")
def rides():
    return {on: run(MovingString(), 2500, noise=1.0, control=SCHEMES[on]).summary() for on in (True, False)}


def test_moving_string_is_tracked_under_noise(rides):
    """Goal of the rig is 0.3 mm with a real wire; this one has softer springs, so a third of it."""
    for figures in rides.values():
        assert figures["pos_mm"] < 0.1
        assert figures["fallbacks"] == 0


def test_correction_keeps_the_energy_error_small_with_a_small_force(rides):
    """Below 0.1 % of the energy exchanged, half of which the tolerance of 0.01 J is in this short run.

    And below the run without it; force and momentum error stay small.
    """
    on, off = rides[True], rides[False]
    assert on["dW_end_%"] < 0.1
    assert on["dW_rms_%"] < 0.6 * off["dW_rms_%"]
    assert on["Fcor_rms"] < 3.0
    assert on["dp_max"] < 3.0  # N s of about 700 exchanged
    assert off["dp_max"] < 0.1  # what the forecast of the force was wrong by


def test_correction_mends_the_energy_of_a_rig_that_is_not_as_identified():
    """Rig at 30 Hz, model at 40 Hz: without the force the error is several times the 0.3 % that is the goal with it."""
    found = {on: run(MovingString(), 2000, frequency=30.0, control=SCHEMES[on]).summary() for on in (True, False)}
    assert found[True]["dW_end_%"] < 0.3
    assert found[True]["dW_end_%"] < 0.3 * found[False]["dW_end_%"]
    assert found[True]["pos_mm"] < 0.3


@pytest.mark.parametrize("limits", [{"position_maximum": 0.03}, {"velocity_limit": 0.05}])
def test_a_drive_at_its_limits_needs_no_fallback(limits):
    """The wire goes higher (or faster) than the drive may: many constraints at once, and every cycle is solved.

    The model is exact, so what goes beyond the limits does so between two rows: 1 % of the speed and 0.05 mm.
    """
    record = run(MovingString(), 1200, **limits)
    assert sum(status != 0 for status in record.status) == 0
    if "position_maximum" in limits:
        assert record.w_cat.max() > 0.04
        assert record.w_tr.max() <= 0.03 + 5e-5
    else:
        assert abs(record.v_tr).max() <= 0.0505
