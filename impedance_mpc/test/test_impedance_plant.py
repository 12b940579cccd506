"""Rig model with a ramped reference and a dead time, Newmark as a state space."""

import numpy as np
import pytest
from impedance_loop import random_impedance

from impedance_mpc.plant import Impedance, newmark_state_space, pt2_rig

TS = 0.002


@pytest.mark.parametrize(("frequency", "damping"), [(40.0, 0.8), (30.0, 0.7), (15.0, 1.0), (60.0, 1.6)])
@pytest.mark.parametrize("delay", [0.0, 0.0004, 0.002, 0.0047])
@pytest.mark.slow
def test_ramps_that_arrive_late_equal_a_fine_simulation(frequency, damping, delay):
    """Against RK4 with 200 steps a cycle: its local error at these frequencies is far below the 1e-9 asked for.

    The ramps jump from one command to the next, as they do whenever a new plan disagrees with the one before.
    """
    rig = pt2_rig(frequency, damping, TS, delay)
    rng = np.random.default_rng(3)
    ramps = 0.01 * rng.normal(size=(24, 2))
    late = round(delay / TS * 200)
    omega, steps = 2.0 * np.pi * frequency, 200
    h = TS / steps

    def rate(x, reference):
        return np.array([x[1], omega**2 * (reference - x[0]) - 2.0 * damping * omega * x[1]])

    def reference(step, part):
        """Value within the fine step, 0 <= part <= 1, of the ramp that is on its way then."""
        number, inside = divmod(step - late, steps)
        begin, end = ramps[number + 3]
        return begin + (end - begin) * (inside + part) / steps

    x = np.array([0.003, -0.2])
    fine = x.copy()
    for k in range(20):
        for i in range(k * steps, (k + 1) * steps):
            k1 = rate(fine, reference(i, 0.0))
            k2 = rate(fine + 0.5 * h * k1, reference(i, 0.5))
            k3 = rate(fine + 0.5 * h * k2, reference(i, 0.5))
            k4 = rate(fine + h * k3, reference(i, 1.0))
            fine = fine + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        newest = k + 3 - rig.cycles
        x = rig.a @ x + rig.tail @ ramps[newest - 1] + rig.head @ ramps[newest]
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
    with pytest.raises(ValueError, match="delay"):
        pt2_rig(40.0, 0.8, TS, -0.001)
