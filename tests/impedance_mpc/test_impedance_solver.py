"""The quadratic program on its own."""

import numpy as np
import pytest

from impedance_mpc.solver import FAILED, SOLVED, QuadraticProgram


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


def test_solver_that_runs_out_of_iterations_says_so_and_recovers():
    """One change of the active set is too few for many active bounds: refused, no half-finished plan is used."""
    rng = np.random.default_rng(0)
    half = rng.normal(size=(20, 20))
    hessian, rows = half @ half.T + 1e-6 * np.eye(20), rng.normal(size=(5, 20))
    bound, box, g = np.ones(5), np.ones(20), 100.0 * rng.normal(size=20)
    short, long = QuadraticProgram(hessian, rows, 1e-9, 1), QuadraticProgram(hessian, rows, 1e-9, 200)
    assert short.solve(g, -bound, bound, -box, box) == FAILED
    np.testing.assert_array_equal(short.z, 0.0)
    assert long.solve(g, -bound, bound, -box, box) == SOLVED
    assert np.all(np.abs(long.z) <= 1.0 + 1e-8)


@pytest.mark.parametrize("softness", [10.0, 1e4])
def test_a_soft_row_is_the_quadratic_penalty(softness):
    """Minimum of 1/2 z^2 - 3 z with z <= 1 softly: the closed form is z = (3 + s) / (1 + s)."""
    qp = QuadraticProgram(np.eye(1), np.ones((1, 1)), 1e-9, 50, np.array([softness]))
    wide = np.array([1e3])
    for _ in range(2):
        assert qp.solve(np.array([-3.0]), np.array([-1.0]), np.array([1.0]), -wide, wide) == SOLVED
        assert qp.z[0] == pytest.approx((3.0 + softness) / (1.0 + softness), rel=1e-9)
