"""Equation of motion of the drive, contact law and pantograph chains."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from test_rig_sim.contact import Contact, contact_force
from test_rig_sim.drive import Drive, cogging_force, drive_acceleration, friction_force, stator_force
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.statics import equilibrium, set_up

CHAINS = ("en50318", "three_mass")
DRIVE = Drive(
    mass=8.0,
    force_constant=40.0,
    gravity=9.81,
    coulomb_friction=12.0,
    static_friction=15.0,
    stribeck_speed=0.02,
    friction_speed=0.002,
    viscous_friction=20.0,
    cogging_amplitude=8.0,
    cogging_second=2.0,
    cogging_period=0.02,
)


def test_weight_is_carried_by_the_current_that_balances_it() -> None:
    stator = stator_force(DRIVE, 0.0, 0.0, 8.0 * 9.81 / 40.0)
    assert drive_acceleration(DRIVE, stator, 0.0) == pytest.approx(0.0, abs=1e-12)


def test_contact_force_pushes_the_drive_up() -> None:
    change = drive_acceleration(DRIVE, 0.0, 120.0) - drive_acceleration(DRIVE, 0.0, 0.0)
    assert change == pytest.approx(120.0 / 8.0)


@given(st.floats(-5.0, 5.0))
def test_friction_opposes_motion_and_is_odd(v: float) -> None:
    assert friction_force(DRIVE, v) * v >= 0.0
    assert friction_force(DRIVE, -v) == -friction_force(DRIVE, v)


def test_friction_is_coulomb_plus_viscous_beyond_the_smoothing() -> None:
    # exp(-25) of the static share is left, tanh(50) is 1.
    assert friction_force(DRIVE, 0.1) == pytest.approx(12.0 + 20.0 * 0.1, rel=1e-8)


def test_friction_falls_from_the_static_to_the_coulomb_friction() -> None:
    # Stribeck's curve between: at 5 mm/s tanh(2.5) = 0.987 of 12 + 3 exp(-1/16) N, and it falls from there on.
    v = np.linspace(0.006, 0.05, 45)
    dry = np.array([friction_force(DRIVE, float(speed)) - 20.0 * speed for speed in v])
    assert friction_force(DRIVE, 0.005) - 0.1 == pytest.approx(math.tanh(2.5) * (12.0 + 3.0 * math.exp(-1.0 / 16.0)))
    assert (np.diff(dry) < 0.0).all()
    assert dry[0] > 14.0
    assert dry[-1] == pytest.approx(12.0, abs=0.01)


@given(st.floats(-0.3, 0.3))
def test_cogging_has_the_period_of_the_magnets(w: float) -> None:
    # Rounding of the sine's argument, up to 100 rad.
    assert cogging_force(DRIVE, w + DRIVE.cogging_period) == pytest.approx(cogging_force(DRIVE, w), abs=1e-11)
    assert abs(cogging_force(DRIVE, w)) <= DRIVE.cogging_amplitude + DRIVE.cogging_second


def test_cogging_has_its_two_harmonics_and_no_other() -> None:
    w = DRIVE.cogging_period * np.arange(64) / 64
    spectrum = np.fft.rfft([cogging_force(DRIVE, float(place)) for place in w]).imag / -32.0
    assert spectrum[1:3] == pytest.approx([8.0, 2.0], rel=1e-12)
    assert np.abs(np.delete(spectrum, [1, 2])).max() < 1e-12


@given(st.floats(-0.1, 0.1), st.floats(-5.0, 5.0), st.floats(0.0, 1000.0))
def test_contact_never_pulls(penetration: float, rate: float, damping: float) -> None:
    force = contact_force(Contact(5e4, damping), penetration, rate)
    assert force >= 0.0
    assert force == 0.0 or penetration > 0.0


@pytest.mark.parametrize("name", CHAINS)
def test_chain_is_symmetric_and_held_by_the_frame_spring_only(name: str) -> None:
    pantograph = PANTOGRAPHS[name]()
    for matrix in (pantograph.stiffness, pantograph.damping):
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() > 0.0
        # A rigid shift loads the link to the ground and nothing else.
        assert matrix.sum(axis=1)[1:] == pytest.approx(0.0, abs=1e-9)


def test_en50318_has_the_frequencies_of_its_data() -> None:
    # Closed form of two masses: omega^2 of M^-1 K from trace and determinant.
    pantograph = PANTOGRAPHS["en50318"]()
    eigenvalues = np.linalg.eigvals(pantograph.stiffness / pantograph.mass[:, None]).real
    assert eigenvalues.sum() == pytest.approx(4250.0 / 15.0 + 4200.0 / 7.2)
    assert eigenvalues.prod() == pytest.approx(50.0 * 4200.0 / (15.0 * 7.2))


@pytest.mark.parametrize("name", CHAINS)
@given(force=st.floats(10.0, 500.0))
@settings(max_examples=20)
def test_operating_point_passes_the_uplift_force_to_the_contact(name: str, force: float) -> None:
    pantograph = set_up(PANTOGRAPHS[name](), force, 5e4)
    n = pantograph.mass.size
    x = equilibrium(pantograph, force, 5e4)
    assert 5e4 * x[n - 1] == pytest.approx(force, rel=1e-9)
    assert x[0] == pytest.approx(pantograph.frame.rest, rel=1e-9)
    # The spring between car body and frame is not loaded.
    assert pantograph.preload == pytest.approx(pantograph.ground_stiffness * x[0], rel=1e-9)
    assert not x[n:].any()


def test_frame_spring_lowers_the_force_with_height() -> None:
    pantograph = set_up(PANTOGRAPHS["en50318"](), 120.0, 5e4)
    height = 0.05
    x = equilibrium(pantograph, 120.0, 5e4, height)
    # Three springs in series, seen from the contact point.
    series = 1.0 / (1.0 / 50.0 + 1.0 / 4200.0 + 1.0 / 5e4)
    assert 5e4 * (x[1] - height) == pytest.approx(120.0 - series * height, rel=1e-9)


@pytest.mark.parametrize(
    ("masses", "springs", "dashpots"),
    [([], [], []), ([1.0], [1.0, 2.0], [0.0]), ([0.0], [1.0], [0.0]), ([1.0] * 5, [1.0] * 5, [0.0] * 5)],
)
def test_impossible_chains_are_refused(masses: list[float], springs: list[float], dashpots: list[float]) -> None:
    with pytest.raises(ValueError, match=r"masses|springs"):
        chain(masses, springs, dashpots)


def test_cogging_is_zero_at_nominal_height() -> None:
    assert cogging_force(DRIVE, 0.0) == 0.0
    assert cogging_force(DRIVE, 0.25 * DRIVE.cogging_period) == pytest.approx(8.0 * math.sin(math.pi / 2.0))
