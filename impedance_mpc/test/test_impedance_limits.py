"""Limits of the drive, and what the controller does when the solver fails."""

import itertools

import numpy as np
import pytest
from impedance_cases import call, mass_controller

from impedance_mpc.controller import EnvironmentReading, RigReading
from impedance_mpc.plant import pt2_rig
from impedance_mpc.solver import FAILED, SOLVED
from phil_base.enumerations import SolverStatus


def test_reference_stays_inside_the_box_and_reaches_it():
    """The wire is 50 mm above the limit: the reference goes to the limit exactly and no further."""
    c = mass_controller(position_minimum=-0.02, position_maximum=0.03, control="integrated")
    out = call(c, w_tr=0.029, f_tr=400.0, w_cat=0.08)
    assert out.status == SOLVED
    u, _ = c.plan
    assert u.max() == 0.03
    assert u.min() >= -0.02


@pytest.mark.parametrize("acceleration", [20.0, 120.0])
def test_the_drive_is_not_asked_for_more_acceleration_than_it_has(acceleration):
    """A jump of the wire by 50 mm: omega^2 (u - w - 2 zeta v / omega) stays at the limit to 0.2 % (soft)."""
    c = mass_controller(acceleration_limit=acceleration, constraint_stride=1, control="integrated")
    call(c, w_tr=0.0, f_tr=120.0, w_cat=0.05)
    u, _ = c.plan
    cfg = c.config
    omega = 2.0 * np.pi * cfg.rig_natural_frequency_hz
    rig = pt2_rig(cfg.rig_natural_frequency_hz, cfg.rig_damping_ratio, cfg.cycle_time)
    x, found = np.zeros(2), []
    for now, following in itertools.pairwise(u):
        found.append(omega**2 * (now - x[0]) - 2.0 * cfg.rig_damping_ratio * omega * x[1])
        x = rig.a @ x + rig.b0 * now + rig.b1 * following
    assert np.abs(found).max() == pytest.approx(acceleration, rel=2e-3)


def test_predicted_velocity_keeps_its_limit():
    """A jump of the wire by 50 mm asks for about 5 m/s; rows at each instant: limit kept to 0.5 % (soft)."""
    cfg = {"velocity_limit": 0.4, "constraint_stride": 1, "control": "integrated"}
    c = mass_controller(**cfg)
    out = call(c, w_cat=0.05, f_tr=250.0)
    assert out.status == SOLVED
    rig = pt2_rig(c.config.rig_natural_frequency_hz, c.config.rig_damping_ratio, 0.002)
    u, _ = c.plan
    x, speeds, positions = np.zeros(2), [], []
    for i in range(30):
        x = rig.a @ x + rig.b0 * u[min(i, 19)] + rig.b1 * u[min(i + 1, 19)]
        speeds.append(x[1])
        positions.append(x[0])
    assert max(np.abs(speeds)) <= 0.4 * 1.005
    assert max(np.abs(speeds)) > 0.39


@pytest.mark.parametrize(("w_tr", "v_tr"), [(0.0, 3.0), (0.0, -3.0), (0.19, 2.5), (0.25, 1.0), (-0.3, -2.0)])
def test_program_has_a_solution_outside_the_limits(w_tr, v_tr):
    """Too fast or out of the box already: still solved, references inside, and the drive comes back inside.

    The limits are soft, but dear: within 40 ms (2.4 time constants of the position loop and what it takes to stop) the
    drive is within them but for 2 %.
    """
    c = mass_controller(velocity_limit=0.5, control="integrated", constraint_stride=1)
    out = call(c, w_tr=w_tr, v_tr=v_tr, w_cat=0.05, f_tr=100.0, reference=max(min(w_tr, 0.2), -0.2))
    assert out.status == SOLVED
    rig = pt2_rig(c.config.rig_natural_frequency_hz, c.config.rig_damping_ratio, 0.002)
    u, _ = c.plan
    assert np.all(np.abs(u) <= 0.2)
    x = np.array([w_tr, v_tr])
    for i in range(30):
        x = rig.a @ x + rig.b0 * u[min(i, 19)] + rig.b1 * u[min(i + 1, 19)]
        if i >= 20:
            assert abs(x[0]) <= 0.2 * 1.02
            assert abs(x[1]) <= 0.5 * 1.02


def test_a_limit_is_broken_no_further_than_its_price():
    """The softening is the trade: a tenth of it lets the drive go further beyond, none of it is free."""
    beyond = {}
    for softening in (1e3, 1e5):
        c = mass_controller(
            velocity_limit=0.05, constraint_stride=1, control="integrated", weights__softening=softening
        )
        call(c, w_cat=0.05, f_tr=250.0)
        u, _ = c.plan
        rig = pt2_rig(c.config.rig_natural_frequency_hz, c.config.rig_damping_ratio, 0.002)
        x, speeds = np.zeros(2), []
        for i in range(30):
            x = rig.a @ x + rig.b0 * u[min(i, 19)] + rig.b1 * u[min(i + 1, 19)]
            speeds.append(abs(x[1]))
        beyond[softening] = max(speeds) - 0.05
    assert 0.0 < beyond[1e5] < 0.2 * beyond[1e3]


@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.0012, 0.003])
def test_no_plan_zigzags_under_its_limits(delay):
    """Far from the wire at the limit of acceleration: each reference leads the drive by no more than that takes.

    The lead of 120 m/s^2 is 1.9 mm; where the drive goes over to braking at some 0.7 m/s, neighbouring references
    differ by twice that, its way of 1.4 mm, and what its change of speed takes from the damping, 1.5 mm.
    """
    c = mass_controller(control="integrated", rig_delay=delay)
    call(c, w_tr=0.0, f_tr=100.0, w_cat=-0.01)
    u, _ = c.plan
    assert np.abs(np.diff(u)).max() < 7.0e-3


def test_failed_solver_gives_the_shifted_plan_inside_the_box(monkeypatch):
    c = mass_controller(position_maximum=0.01, control="integrated")
    call(c, w_cat=0.02, v_cat=0.1, f_tr=200.0)
    before, _ = c.plan
    monkeypatch.setattr(c.qp, "solve", lambda *a: FAILED)
    out = call(c, w_cat=0.02, v_cat=0.1, f_tr=200.0)
    assert (out.status, out.fallbacks) == (SolverStatus.FALLBACK, 1)
    assert (out.u_tr, out.u_tr_next) == (before[1], before[2])
    for _ in range(40):
        out = call(c, w_cat=0.02, v_cat=0.1, f_tr=200.0)
    assert out.fallbacks == 41
    assert out.u_tr == out.u_tr_next == before[-1]
    assert out.u_tr <= 0.01


def test_fallback_in_the_first_cycle_holds_the_drive(monkeypatch):
    c = mass_controller()
    monkeypatch.setattr(c.qp, "solve", lambda *a: FAILED)
    out = call(c, w_tr=0.004, f_tr=10.0)
    assert out.u_tr == pytest.approx(0.004)
    out = call(c, w_tr=0.4, f_tr=10.0)
    assert abs(out.u_tr) <= 0.2


def test_nan_in_the_cycle_is_answered_by_the_old_plan():
    c = mass_controller(control="integrated")
    call(c, w_cat=0.001, f_tr=100.0)
    before, _ = c.plan
    zero = np.zeros(1)
    broken = EnvironmentReading(np.array([np.nan]), zero, zero, zero, 0.001, 0.0, 100.0)
    out = c.command(RigReading(0.0, 0.0, 100.0, before[1]), broken)
    assert out.status == SolverStatus.FALLBACK
    assert out.u_tr == before[1]
    assert call(c, w_cat=0.001, f_tr=100.0).status == SOLVED


def test_reset_clears_fallbacks_and_books(monkeypatch):
    c = mass_controller()
    monkeypatch.setattr(c.qp, "solve", lambda *a: FAILED)
    assert call(c, f_tr=10.0).fallbacks == 1
    c.reset()
    assert c.result.fallbacks == 0
    assert c.books.exchanged_momentum == 0.0


def test_fallback_shifts_the_correction_force_too(monkeypatch):
    c = mass_controller()
    c.books.p_tr = 20.0
    call(c, f_tr=100.0)
    _, before = c.plan
    assert before[1] != before[0]
    monkeypatch.setattr(c.qp, "solve", lambda *a: FAILED)
    out = call(c, f_tr=100.0)
    assert out.f_cor == min(max(before[1], out.f_cor_lower), out.f_cor_upper)
    np.testing.assert_allclose(c.plan[1][:-1], np.clip(before[1:], out.f_cor_lower, out.f_cor_upper))
