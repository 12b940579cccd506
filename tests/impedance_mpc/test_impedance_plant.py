"""Rig model with a ramped reference, Newmark as a state space, condensed prediction."""

import numpy as np
import pytest

from impedance_mpc.condense import Weights, predict, program
from impedance_mpc.plant import Impedance, design_plant, newmark_state_space, pt2_rig

TS = 0.002


def random_impedance(n, seed=0):
    rng = np.random.default_rng(seed)
    half = rng.normal(size=(n, n))
    return Impedance(
        mass=half @ half.T + n * np.eye(n),
        damping=10.0 * rng.normal(size=(n, n)) + 60.0 * np.eye(n),
        stiffness=2e3 * (half @ half.T + n * np.eye(n)) + 100.0 * rng.normal(size=(n, n)),
        input=rng.normal(size=n),
        output=rng.normal(size=n),
        ts=TS,
        newmark_beta=0.255,
        newmark_gamma=0.525,
    )


@pytest.mark.parametrize(("frequency", "damping"), [(40.0, 0.8), (30.0, 0.7), (15.0, 1.0), (60.0, 1.6)])
def test_ramped_reference_equals_a_fine_simulation(frequency, damping):
    """Against RK4 with 200 steps a cycle: its local error at these frequencies is far below the 1e-9 asked for."""
    rig = pt2_rig(frequency, damping, TS)
    rng = np.random.default_rng(3)
    u = 0.01 * rng.normal(size=21)
    omega, steps = 2.0 * np.pi * frequency, 200
    h = TS / steps

    def rate(x, reference):
        return np.array([x[1], omega**2 * (reference - x[0]) - 2.0 * damping * omega * x[1]])

    x = np.array([0.003, -0.2])
    fine = x.copy()
    for k in range(20):
        for i in range(steps):
            r0, r2 = u[k] + (u[k + 1] - u[k]) * i / steps, u[k] + (u[k + 1] - u[k]) * (i + 1) / steps
            r1 = 0.5 * (r0 + r2)
            k1 = rate(fine, r0)
            k2 = rate(fine + 0.5 * h * k1, r1)
            k3 = rate(fine + 0.5 * h * k2, r1)
            k4 = rate(fine + h * k3, r2)
            fine = fine + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        x = rig.a @ x + rig.b0 * u[k] + rig.b1 * u[k + 1]
        np.testing.assert_allclose(x, fine, rtol=0.0, atol=1e-9)


def test_rig_rests_on_a_constant_reference():
    rig = pt2_rig(40.0, 0.8, TS)
    np.testing.assert_allclose(rig.a @ [0.05, 0.0] + (rig.b0 + rig.b1) * 0.05, [0.05, 0.0], atol=1e-15)


def test_rig_agrees_with_scipys_first_order_hold():
    """SciPy shifts the state by B_1 u; outputs agree to rounding (1e-12 of values of order 1)."""
    from scipy.signal import cont2discrete

    omega, zeta = 2.0 * np.pi * 40.0, 0.8
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]])
    ad, bd, cd, dd, _ = cont2discrete((a, np.array([[0.0], [omega**2]]), np.eye(2), np.zeros((2, 1))), TS, "foh")
    rig = pt2_rig(40.0, zeta, TS)
    u = np.random.default_rng(0).normal(size=50)
    x = np.zeros(2)
    shifted = x - rig.b1 * u[0]
    for k in range(49):
        shifted = ad @ shifted + bd[:, 0] * u[k]
        x = rig.a @ x + rig.b0 * u[k] + rig.b1 * u[k + 1]
        np.testing.assert_allclose((cd @ shifted + dd[:, 0] * u[k + 1])[0], x[0], atol=1e-12)


def test_newmark_matrix_equals_the_step_as_printed():
    """(3.19) to (3.23) written out; equal up to the rounding of one solve (1e-9 relative)."""
    model = random_impedance(5)
    state = newmark_state_space(model)
    rng = np.random.default_rng(1)
    q, v, a = rng.normal(size=(3, 5))
    dt, beta, gamma = TS, model.newmark_beta, model.newmark_gamma
    force = rng.normal(size=5) * 100.0
    x = state.a @ np.concatenate([q, v, a]) + state.b_force @ force
    right = (
        force - model.damping @ (v + dt * (1.0 - gamma) * a) - model.stiffness @ (q + dt * v + dt**2 * (0.5 - beta) * a)
    )
    new = np.linalg.solve(model.stiffness * beta * dt**2 + model.damping * gamma * dt + model.mass, right)
    q_new = q + dt * v + dt**2 * ((0.5 - beta) * a + beta * new)
    v_new = v + dt * ((1.0 - gamma) * a + gamma * new)
    np.testing.assert_allclose(x, np.concatenate([q_new, v_new, new]), rtol=1e-9)
    np.testing.assert_allclose(state.c @ x, [model.output @ q_new, model.output @ v_new], rtol=1e-9)


def test_one_mass_settles_at_force_over_stiffness():
    one = np.ones(1)
    model = Impedance(np.array([[10.0]]), np.array([[300.0]]), np.array([[5e3]]), one, one, TS)
    state = newmark_state_space(model)
    x = np.zeros(3)
    for _ in range(2000):
        x = state.a @ x + state.b * 150.0
    assert x[0] == pytest.approx(0.03, rel=1e-9)


@pytest.mark.parametrize(("n_p", "n_c"), [(30, 20), (7, 7), (9, 2)])
def test_condensed_prediction_equals_the_simulation_step_by_step(n_p, n_c):
    """Same arithmetic in another order: 1e-11 of the largest output."""
    model = random_impedance(4)
    plant = design_plant(pt2_rig(40.0, 0.8, TS), model)
    prediction = predict(plant, n_p, n_c)
    rng = np.random.default_rng(2)
    x = rng.normal(size=plant.a.shape[0])
    held, force = rng.normal(size=4), 120.0
    u, f = rng.normal(size=n_c), 10.0 * rng.normal(size=n_c)
    y = (
        prediction.phi @ x
        + prediction.phi_held @ held
        + prediction.gamma_z * force
        + prediction.gamma @ np.concatenate([u, f])
    ).reshape(3, n_p)
    drive = (prediction.drive_phi @ x[:2] + prediction.drive_gamma @ u).reshape(2, n_p)
    for i in range(n_p):
        move, following = min(i, n_c - 1), min(i + 1, n_c - 1)
        x = (
            plant.a @ x
            + plant.b0 @ [u[move], f[move]]
            + plant.b1 * u[following]
            + plant.e * force
            + plant.e_held @ held
        )
        np.testing.assert_allclose(y[:, i], plant.c @ x, atol=1e-11 * np.abs(y).max())
        np.testing.assert_allclose(drive[:, i], x[:2], atol=1e-11 * np.abs(drive).max())


def test_momentum_error_falls_with_the_correction_force():
    plant = design_plant(pt2_rig(40.0, 0.8, TS), random_impedance(2))
    assert plant.b0[-1, 1] == -TS


def test_hessian_and_gradient_are_those_of_the_cost():
    """H and G p are second and first derivative of (3.55): an independent sum of squares agrees to 1e-9."""
    n, n_p, n_c = 3, 12, 6
    plant = design_plant(pt2_rig(40.0, 0.8, TS), random_impedance(n))
    prediction = predict(plant, n_p, n_c)
    w = Weights(2.0, 3e-4, 0.5, 0.07, 0.11, 0.13)
    found = program(plant, prediction, w, n_c, 3, 0.0064)
    rng = np.random.default_rng(5)
    p = rng.normal(size=found.layout.size) * 1e-2

    def cost(z):
        u, f = z[:n_c] * 1e-3, z[n_c:]
        x = p[: 3 * n + 3]
        held = p[found.layout.held]
        force, w_bias, v_bias, drift, u_before, f_before = p[found.layout.force :]
        total = 0.0
        for i in range(n_p):
            move, following = min(i, n_c - 1), min(i + 1, n_c - 1)
            x = plant.a @ x + plant.b0 @ [u[move], f[move]] + plant.b1 * u[following]
            x = x + plant.e * force + plant.e_held @ held
            e_pos, e_vel, dp = plant.c @ x
            e_pos, e_vel = e_pos - w_bias - drift * TS * (i + 1), e_vel - v_bias - drift
            total += w.position * (e_pos * 1e3) ** 2 + w.velocity * (e_vel * 1e3) ** 2
            total += w.momentum * dp**2
        total += w.correction_force * np.sum(f**2)
        total += w.reference_rate * np.sum((np.diff(np.concatenate([[u_before], u])) * 1e3) ** 2)
        total += w.correction_rate * np.sum(np.diff(np.concatenate([[f_before], f])) ** 2)
        return total

    def quadratic(z):
        return 0.5 * z @ found.hessian @ z + (found.gradient_t.T @ p) @ z

    base = cost(np.zeros(2 * n_c))
    for _ in range(5):
        z = rng.normal(size=2 * n_c)
        assert quadratic(z) == pytest.approx(cost(z) - base, rel=1e-9)
    assert np.array_equal(found.hessian, found.hessian.T)
    assert np.linalg.eigvalsh(found.hessian)[0] > 0.0


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"mass": np.eye(3)}, "mass"),
        ({"output": np.ones(3)}, "output"),
        ({"damping": np.array([[np.nan, 0.0], [0.0, 1.0]])}, "damping"),
        ({"ts": 0.0}, "step"),
        ({"newmark_beta": 0.9}, "beta"),
        ({"input": np.zeros(0)}, "degree of freedom"),
    ],
)
def test_impossible_impedance_models_are_refused(change, text):
    good = {"mass": np.eye(2), "damping": np.eye(2), "stiffness": np.eye(2), "input": np.ones(2), "output": np.ones(2)}
    with pytest.raises(ValueError, match=text):
        Impedance(**{**good, "ts": TS, **change})


def test_flat_matrices_are_read_row_by_row_and_checked():
    model = Impedance.from_flat(
        2, [1.0, 0.0, 0.0, 2.0], [0.0, 3.0, -3.0, 0.0], [1.0] * 4, [1.0, 0.0], [0.0, 1.0], TS, 0.25, 0.5
    )
    assert model.damping[0, 1] == 3.0
    assert model.damping[1, 0] == -3.0
    with pytest.raises(ValueError, match="3 entries"):
        Impedance.from_flat(2, [1.0] * 3, [1.0] * 4, [1.0] * 4, [1.0, 0.0], [0.0, 1.0], TS, 0.25, 0.5)


def test_singular_newmark_matrix_and_bad_rig_are_refused():
    zero, one = np.zeros((1, 1)), np.ones(1)
    with pytest.raises(ValueError, match="singular"):
        newmark_state_space(Impedance(zero, zero, zero, one, one, TS))
    with pytest.raises(ValueError, match="positive"):
        pt2_rig(0.0, 0.8, TS)


def test_control_horizon_has_to_fit():
    plant = design_plant(pt2_rig(40.0, 0.8, TS), random_impedance(1))
    with pytest.raises(ValueError, match="control horizon"):
        predict(plant, 5, 6)
