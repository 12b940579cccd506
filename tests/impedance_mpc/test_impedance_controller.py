"""One cycle of the controller: optimum, constraints, fallback, determinism."""

import itertools

import numpy as np
import pytest
from impedance_loop import MassSpringDamper, MovingString, ride

from impedance_mpc import controller as controller_module
from impedance_mpc.controller import FALLBACK, ImpedanceController
from impedance_mpc.correction import CAPPED, DEAD_ZONE, OFF
from impedance_mpc.parameters import Parameters
from impedance_mpc.plant import design_plant, pt2_rig
from impedance_mpc.solver import FAILED, MAX_ITERATIONS, SOLVED, QuadraticProgram
from phil_node.parameters import ParameterError, build, defaults

DEFAULTS = defaults("impedance_mpc")


def parameters(**changes):
    return build(Parameters, {**DEFAULTS, **{name.replace("__", "."): value for name, value in changes.items()}})


def mass_controller(**changes):
    """Controller of one mass; without the approach, so that the first cycle already follows the wire."""
    changes = {"approach_time": 0.0, **changes}
    return ImpedanceController(parameters(**changes), MassSpringDamper().impedance)


def call(controller, w_tr=0.0, v_tr=0.0, f_tr=0.0, w_cat=0.0, v_cat=0.0, reference=float("nan")):
    one = np.ones(1)
    return controller.command(w_tr, v_tr, f_tr, w_cat * one, v_cat * one, 0.0 * one, 0.0 * one, w_cat, v_cat, reference)


def test_without_active_constraints_the_plan_is_the_least_squares_solution():
    """Bounds far away: the QP has to find the minimum of the sum of squares, to 1e-3 mm (solver tolerance 1e-9)."""
    c = mass_controller(
        correction_cap=1000.0,
        correction_rate_limit=1e7,
        position_minimum=-5.0,
        position_maximum=5.0,
        velocity_limit=50.0,
        acceleration_limit=10000.0,
        qp_tolerance=1e-9,
        weights__momentum=0.1,
    )
    c.books.p_tr = 2.0  # a momentum error for the correction force to work at
    call(c, w_tr=0.01, v_tr=0.1, f_tr=120.0, w_cat=0.012, v_cat=0.02, reference=0.011)
    u, f = c.plan
    cfg = c.config
    plant = design_plant(pt2_rig(cfg.rig_natural_frequency_hz, cfg.rig_damping_ratio, cfg.cycle_time), c.model)
    n_p, n_c, w = cfg.prediction_horizon, cfg.control_horizon, cfg.weights

    def residuals(z):
        x = np.array([0.01, 0.1, 0.012, 0.02, 0.0, 2.0])
        out = []
        for i in range(n_p):
            move, following = min(i, n_c - 1), min(i + 1, n_c - 1)
            x = plant.a @ x + plant.b0 @ [z[move], z[n_c + move]] + plant.b1 * z[following] + plant.e * 120.0
            out += list(np.sqrt([w.position * 1e6, w.velocity * 1e6, w.momentum]) * (plant.c @ x))
        out += list(np.sqrt(w.correction_force) * z[n_c:])
        out += list(np.sqrt(w.reference_rate) * 1e3 * np.diff(np.concatenate([[0.011], z[:n_c]])))
        out += list(np.sqrt(w.correction_rate) * np.diff(np.concatenate([[0.0], z[n_c:]])))
        return np.array(out)

    start = residuals(np.zeros(2 * n_c))
    columns = np.array([residuals(e) - start for e in np.eye(2 * n_c)]).T
    best = np.linalg.lstsq(columns, -start, rcond=None)[0]
    np.testing.assert_allclose(u, best[:n_c], atol=1e-6)
    np.testing.assert_allclose(f, best[n_c:], atol=1e-3)


def test_reference_stays_inside_the_box_and_reaches_it():
    """The wire is 50 mm above the limit: the reference goes to the limit exactly and no further."""
    c = mass_controller(position_minimum=-0.02, position_maximum=0.03, correction=False)
    out = call(c, w_tr=0.029, f_tr=400.0, w_cat=0.08)
    assert out.status == SOLVED
    u, _ = c.plan
    assert u.max() == 0.03
    assert u.min() >= -0.02


@pytest.mark.parametrize("acceleration", [20.0, 120.0])
def test_the_drive_is_not_asked_for_more_acceleration_than_it_has(acceleration):
    """A jump of the wire by 50 mm: the lead u - w - 2 zeta v / omega, times omega^2, stays at the limit to 0.1 %."""
    c = mass_controller(acceleration_limit=acceleration, constraint_stride=1, correction=False)
    call(c, w_tr=0.0, f_tr=120.0, w_cat=0.05)
    u, _ = c.plan
    cfg = c.config
    omega = 2.0 * np.pi * cfg.rig_natural_frequency_hz
    rig = pt2_rig(cfg.rig_natural_frequency_hz, cfg.rig_damping_ratio, cfg.cycle_time)
    x, found = np.zeros(2), []
    for now, following in itertools.pairwise(u):
        found.append(omega**2 * (now - x[0]) - 2.0 * cfg.rig_damping_ratio * omega * x[1])
        x = rig.a @ x + rig.b0 * now + rig.b1 * following
    assert np.abs(found).max() == pytest.approx(acceleration, rel=1e-3)


def test_predicted_velocity_keeps_its_limit():
    """A jump of the wire by 50 mm asks for about 5 m/s; rows at each instant: limit kept to 1e-3 mm/s of tolerance."""
    cfg = {"velocity_limit": 0.4, "constraint_stride": 1, "correction": False}
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
    assert max(np.abs(speeds)) <= 0.4 + 1e-5
    assert max(np.abs(speeds)) > 0.39


@pytest.mark.parametrize(("w_tr", "v_tr"), [(0.0, 3.0), (0.0, -3.0), (0.19, 2.5), (0.25, 1.0), (-0.3, -2.0)])
def test_program_stays_feasible_outside_the_limits(w_tr, v_tr):
    """Too fast or out of the box already: still solved, and the drive is not allowed more than stopping needs."""
    c = mass_controller(velocity_limit=0.5, correction=False, constraint_stride=1)
    out = call(c, w_tr=w_tr, v_tr=v_tr, w_cat=0.05, f_tr=100.0, reference=w_tr)
    assert out.status == SOLVED
    rig = pt2_rig(c.config.rig_natural_frequency_hz, c.config.rig_damping_ratio, 0.002)
    stop = min(max(w_tr + 2.0 * 0.8 / (2.0 * np.pi * 40.0) * v_tr, -0.2), 0.2)
    u, _ = c.plan
    assert np.all(np.abs(u) <= 0.2)
    x, y = np.array([w_tr, v_tr]), np.array([w_tr, v_tr])
    for i in range(30):
        x = rig.a @ x + rig.b0 * u[min(i, 19)] + rig.b1 * u[min(i + 1, 19)]
        y = rig.a @ y + (rig.b0 + rig.b1) * stop
        assert min(-0.5, y[1]) - 1e-5 <= x[1] <= max(0.5, y[1]) + 1e-5
        assert min(-0.2, y[0]) - 1e-7 <= x[0] <= max(0.2, y[0]) + 1e-7


def test_correction_force_keeps_its_bounds_and_is_zero_when_off():
    c = mass_controller()
    c.books.e_tr = 0.02
    out = call(c, w_tr=0.01, v_tr=0.2, f_tr=120.0, w_cat=0.01, v_cat=0.2)
    assert out.correction == CAPPED
    assert out.f_cor_lower <= out.f_cor <= out.f_cor_upper
    assert out.f_cor > 0.0
    assert out.f_cat == out.f_tr + out.f_cor
    c.correcting = False
    out = call(c, w_tr=0.01, v_tr=0.2, f_tr=120.0, w_cat=0.01, v_cat=0.2)
    assert (out.f_cor, out.correction) == (0.0, OFF)


def test_momentum_error_leaks_in_the_dead_zone():
    """Momentum error dp = p_tr - p_cat > 0 asks for a positive force, eq. (3.47)."""
    for sign in (1.0, -1.0):
        c = mass_controller()
        c.books.p_tr = 20.0 * sign
        out = call(c, f_tr=100.0)
        assert out.correction == DEAD_ZONE
        assert out.f_cor * sign > 0.0


def test_local_compliance_of_the_full_model_is_followed():
    """w_cat above c q by 1 mm for good: the drive goes 1 mm higher; 2 % is the share of the move-rate penalty."""
    plain, shifted = mass_controller(correction=False), mass_controller(correction=False)
    zero = np.zeros(1)
    call(plain)
    shifted.command(0.0, 0.0, 0.0, zero, zero, zero, zero, 0.001, 0.0)
    assert shifted.plan[0][-1] - plain.plan[0][-1] == pytest.approx(0.001, rel=0.02)


def test_start_apart_from_the_wire_is_a_smooth_approach():
    """8 mm apart: the reference leaves the drive's place slowly and the drive is at the wire after the time given.

    0.05 mm is what a target that accelerates costs a prediction that lets it drift evenly.
    """
    c = mass_controller(approach_time=0.2, correction=False)
    rig = pt2_rig(40.0, 0.8, 0.002)
    zero, x, gap, steps = np.zeros(1), np.array([0.008, 0.0]), [], []
    before = 0.008
    for k in range(200):
        out = c.command(x[0], x[1], 0.0, zero, zero, zero, zero, 0.0, 0.0)
        steps.append(abs(out.u_tr - before))
        before = out.u_tr_next
        x = rig.a @ x + rig.b0 * out.u_tr + rig.b1 * out.u_tr_next
        target = 0.004 * (1.0 + np.cos(np.pi * min((k + 1) / 100, 1.0)))
        gap.append(x[0] - target)
    assert max(np.abs(gap)) < 5e-5 * 5
    assert abs(gap[-1]) < 5e-5
    assert max(steps) < 5e-4


def test_failed_solver_gives_the_shifted_plan_inside_the_box(monkeypatch):
    c = mass_controller(position_maximum=0.01, correction=False)
    call(c, w_cat=0.02, v_cat=0.1, f_tr=200.0)
    before, _ = c.plan
    monkeypatch.setattr(c.qp, "solve", lambda *a: FAILED)
    out = call(c, w_cat=0.02, v_cat=0.1, f_tr=200.0)
    assert (out.status, out.fallbacks) == (FALLBACK, 1)
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


def test_solver_refuses_nan_and_recovers():
    """A gradient with NaN fails, the next call is solved as if nothing had been."""
    qp = QuadraticProgram(np.eye(2), np.ones((1, 2)), 1e-8, 100)
    wide = 10.0 * np.ones(2)
    row = np.ones(1)
    assert qp.solve(np.array([-1.0, np.nan]), -row * 5, row * 5, -wide, wide) == FAILED
    assert qp.solve(np.array([-1.0, -2.0]), -row * 5, row * 5, -wide, wide) == SOLVED
    np.testing.assert_allclose(qp.z, [1.0, 2.0], atol=1e-7)
    assert qp.solve(np.array([-1.0, -2.0]), -row * 5, row * 2, -wide, wide) == SOLVED
    np.testing.assert_allclose(qp.z, [0.5, 1.5], atol=1e-7)


def test_solver_that_runs_out_of_iterations_says_so():
    """One iteration: a feasible iterate is marked, an infeasible one refused; both leave finite numbers."""
    rng = np.random.default_rng(0)
    half = rng.normal(size=(20, 20))
    statuses = set()
    for scale in (0.0, 1e-9, 1.0, 100.0):
        qp = QuadraticProgram(half @ half.T + 1e-6 * np.eye(20), rng.normal(size=(5, 20)), 1e-12, 1)
        bound = np.ones(5)
        statuses.add(qp.solve(scale * rng.normal(size=20), -bound, bound, -np.ones(20), np.ones(20)))
        assert np.all(np.isfinite(qp.z))
    assert statuses & {MAX_ITERATIONS, FAILED}


def test_nan_in_the_cycle_is_answered_by_the_old_plan():
    c = mass_controller(correction=False)
    call(c, w_cat=0.001, f_tr=100.0)
    before, _ = c.plan
    c._p[:] = 0.0
    zero = np.zeros(1)
    out = c.command(0.0, 0.0, 100.0, np.array([np.nan]), zero, zero, zero, 0.001, 0.0)
    assert out.status == FALLBACK
    assert out.u_tr == before[1]
    assert call(c, w_cat=0.001, f_tr=100.0).status == SOLVED


def test_two_runs_and_a_run_after_reset_are_equal_to_the_bit():
    def run(c):
        record = ride(c, MovingString(half=40, segment=12), 150, noise=1.0)
        return np.concatenate([record.u_tr, record.f_cor, record.delta_e])

    model = MovingString(half=40, segment=12).impedance
    first = ImpedanceController(parameters(), model)
    a = run(first)
    for size in range(1, 200, 7):
        # Memory that is cut up in another way must not change a sum.
        junk = [np.zeros(size + i) for i in range(20)]
        other = ImpedanceController(parameters(), model)
        del junk
        if size % 5 == 1:
            assert np.array_equal(a, run(other))
    first.reset()
    assert np.array_equal(a, run(first))


def test_step_of_the_model_has_to_be_the_cycle():
    with pytest.raises(ValueError, match="cycle_time"):
        mass_controller(cycle_time=0.004)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"control_horizon": 40}, "'control_horizon' = 40"),
        ({"position_minimum": 0.3}, "'position_minimum' = 0.3"),
        ({"correction_alpha": 1.0}, "correction_alpha"),
        ({"weights__position": -1.0}, "weights.position"),
        ({"qp_max_iterations": 0}, "qp_max_iterations"),
        ({"correction": 1}, "correction"),
        ({"no_such_key": 1}, "no_such_key"),
    ],
)
def test_bad_parameters_are_named(changes, text):
    with pytest.raises(ParameterError, match=text):
        parameters(**changes)


def test_kernels_allocate_nothing_and_agree_with_numpy():
    c = mass_controller()
    rng = np.random.default_rng(0)
    p, g = rng.normal(size=c._p.size), np.zeros(c._g.size)
    controller_module._gradient(c.program.gradient_t, p, g)
    np.testing.assert_allclose(g, c.program.gradient_t.T @ p, rtol=1e-12, atol=1e-9)


def test_the_correction_force_changes_no_faster_than_its_limit():
    """1000 N/s are 2 N a cycle of 2 ms, however large the energy error is; 1e-3 N is the program's tolerance."""
    c = mass_controller(correction_rate_limit=1000.0, correction_cap=10.0)
    c.books.e_tr = 50.0
    found = [call(c, w_tr=0.0, v_tr=0.1, f_tr=100.0, w_cat=0.0, v_cat=0.1).f_cor for _ in range(12)]
    assert np.abs(np.diff([0.0, *found])).max() <= 2.0 + 1e-3
    assert max(found) == pytest.approx(10.0, abs=1e-3)


def test_a_cycle_is_booked_with_its_own_correction_force():
    c = mass_controller()
    c.books.e_tr = 50.0
    out = call(c, w_tr=0.0, v_tr=0.1, f_tr=100.0, w_cat=0.0, v_cat=0.1)
    assert out.f_cor != 0.0
    assert c.books.p_cat == pytest.approx(c.config.cycle_time * (100.0 + out.f_cor), rel=1e-12)
