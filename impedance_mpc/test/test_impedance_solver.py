"""The quadratic program on its own."""

from itertools import islice

import daqp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from impedance_mpc.proxqp import ProximalProgram
from impedance_mpc.solver import DAQP, FAILED, PROXQP, SOLVED, QuadraticProgram

TOLERANCE = 1e-6
each = pytest.mark.parametrize("solver", [QuadraticProgram, ProximalProgram], ids=[DAQP, PROXQP])


@each
@pytest.mark.slow
def test_solver_refuses_nan_and_recovers(solver):
    """A gradient with NaN fails, the next call is solved as if nothing had been."""
    qp = solver(np.eye(2), np.ones((1, 2)), 1e-8, 100)
    wide = 10.0 * np.ones(2)
    row = np.ones(1)
    assert qp.solve(np.array([-1.0, np.nan]), -row * 5, row * 5, -wide, wide) == FAILED
    assert qp.solve(np.array([-1.0, -2.0]), -row * 5, row * 5, -wide, wide) == SOLVED
    np.testing.assert_allclose(qp.z, [1.0, 2.0], atol=1e-7)
    assert qp.solve(np.array([-1.0, -2.0]), -row * 5, row * 2, -wide, wide) == SOLVED
    np.testing.assert_allclose(qp.z, [0.5, 1.5], atol=1e-7)


@each
def test_solver_that_runs_out_of_iterations_says_so_and_recovers(solver):
    """One change of the active set is too few for many active bounds: refused, no half-finished plan is used."""
    rng = np.random.default_rng(0)
    half = rng.normal(size=(20, 20))
    hessian, rows = half @ half.T + 1e-6 * np.eye(20), rng.normal(size=(5, 20))
    bound, box, g = np.ones(5), np.ones(20), 100.0 * rng.normal(size=20)
    short, long = solver(hessian, rows, 1e-9, 1), solver(hessian, rows, 1e-9, 200)
    assert short.solve(g, -bound, bound, -box, box) == FAILED
    np.testing.assert_array_equal(short.z, 0.0)
    assert long.solve(g, -bound, bound, -box, box) == SOLVED
    assert np.all(np.abs(long.z) <= 1.0 + 1e-8)


@each
@pytest.mark.parametrize("softness", [10.0, 1e4])
def test_a_soft_row_is_the_quadratic_penalty(solver, softness):
    """Minimum of 1/2 z^2 - 3 z with z <= 1 softly: the closed form is z = (3 + s) / (1 + s)."""
    qp = solver(np.eye(1), np.ones((1, 1)), 1e-9, 50, np.array([softness]))
    wide = np.array([1e3])
    for _ in range(2):
        assert qp.solve(np.array([-3.0]), np.array([-1.0]), np.array([1.0]), -wide, wide) == SOLVED
        assert qp.z[0] == pytest.approx((3.0 + softness) / (1.0 + softness), rel=1e-9)


def _nonnegative_least_squares(hessian, rows, softness, g, lower, upper, box_lower, box_upper):
    """The same program by Lawson and Hanson's way: as the shortest vector in a polyhedron, which NNLS finds."""
    size, soft = len(g), np.flatnonzero(softness > 0.0)
    both = np.eye(size + soft.size)  # a variable of its own for each soft row
    both[:size, :size] = hessian
    wide = np.hstack([rows, np.zeros((len(rows), soft.size))])
    wide[soft, size + np.arange(soft.size)] = 1.0 / np.sqrt(softness[soft])
    normals = np.vstack([np.eye(size, size + soft.size), wide])
    low, high = np.concatenate([box_lower, lower]), np.concatenate([box_upper, upper])
    factor = np.linalg.cholesky(both)
    offset = np.linalg.solve(factor, np.concatenate([g, np.zeros(soft.size)]))
    normals = np.linalg.solve(factor, normals.T).T
    has_high, has_low = np.isfinite(high), np.isfinite(low)
    sides = np.vstack([-normals[has_high], normals[has_low]])
    least = np.concatenate([-high[has_high] - normals[has_high] @ offset, low[has_low] + normals[has_low] @ offset])
    scale = np.linalg.norm(sides, axis=1)
    sides, least = sides / scale[:, None], least / scale
    unit = max(1.0, float(np.abs(least).max()))
    matrix, target = np.vstack([sides.T, least / unit]), np.zeros(size + soft.size + 1)
    target[-1] = 1.0
    residual = matrix @ nnls(matrix, target)[0] - target
    return np.linalg.solve(factor.T, -residual[:-1] / residual[-1] * unit - offset)[:size]


def _program(seed):
    """A program with rows of any size, hard and soft ones, and a chain of problems that have a solution."""
    chance = np.random.default_rng(seed)
    size, count = chance.integers(2, 10), chance.integers(1, 10)
    half = chance.normal(size=(size, size))
    hessian = half @ half.T + 10.0 ** chance.uniform(-2.0, 0.0) * np.eye(size)
    rows = chance.normal(size=(count, size)) * 10.0 ** chance.uniform(-4.0, 2.0, (count, 1))
    softness = np.where(chance.random(count) < 0.5, 10.0 ** chance.uniform(1.0, 7.0, count), 0.0)
    length = np.linalg.norm(rows, axis=1)

    def chain():
        g = 10.0 * chance.normal(size=size)
        while True:
            g = g + 10.0 ** chance.uniform(-6.0, 1.0) * chance.normal(size=size)
            inside = 0.3 * chance.normal(size=size)
            lower = rows @ inside - chance.exponential(1.0, count) * length
            # one in five is an equality, one in five has a side without a bound
            upper = rows @ inside + chance.exponential(0.5, count) * length * (chance.random(count) < 0.8)
            lower[chance.random(count) < 0.2] = -np.inf
            box_lower, box_upper = inside - chance.exponential(1.0, size), inside + chance.exponential(1.0, size)
            box_upper[chance.random(size) < 0.1] = np.inf
            yield g, lower, upper, box_lower, box_upper

    return hessian, rows, softness, chain()


@each
@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
@pytest.mark.slow
def test_every_start_leads_to_the_solution(solver, seed):
    """From the active set before, from none, by another method: the same to the tolerance, whatever the rows' unit."""
    hessian, rows, softness, chain = _program(seed)
    warm = solver(hessian, rows, TOLERANCE, 200, softness)
    for problem in islice(chain, 6):
        cold = solver(hessian, rows, TOLERANCE, 200, softness)
        assert warm.solve(*problem) == cold.solve(*problem) == SOLVED
        right = _nonnegative_least_squares(hessian, rows, softness, *problem)
        np.testing.assert_allclose(warm.z, right, atol=10.0 * TOLERANCE)
        np.testing.assert_allclose(cold.z, right, atol=10.0 * TOLERANCE)


def _crossed(by):
    def change(g, lower, upper, box_lower, box_upper):
        box_lower[1] = box_upper[1] + by

    return change


def _crossed_row(g, lower, upper, box_lower, box_upper):
    lower[0] = upper[0] + 1.0


def _nan_bound(g, lower, upper, box_lower, box_upper):
    upper[0] = np.nan


def _nan_box(g, lower, upper, box_lower, box_upper):
    box_lower[0] = np.nan


def _infinite_gradient(g, lower, upper, box_lower, box_upper):
    g[0] = np.inf


def _nan_gradient(g, lower, upper, box_lower, box_upper):
    g[0] = np.nan


def _never(g, lower, upper, box_lower, box_upper):
    lower[0] = upper[0] = np.inf


def _nothing_below(g, lower, upper, box_lower, box_upper):
    box_upper[0] = -np.inf


@each
@pytest.mark.parametrize("first", [True, False], ids=["in the first cycle", "later"])
@pytest.mark.parametrize("softness", [None, np.full(3, 1e3)], ids=["hard", "soft"])
@pytest.mark.parametrize(
    "spoil",
    [
        _crossed(2e-6),
        _crossed(1e-3),
        _crossed(5.0),
        _crossed_row,
        _nan_bound,
        _nan_box,
        _nan_gradient,
        _infinite_gradient,
        _never,
        _nothing_below,
    ],
)
def test_what_cannot_be_solved_fails_and_leaves_nothing_behind(solver, spoil, softness, first):
    """After it every problem is solved as if it had never been: a refused bound once switched its row off for good."""
    chance = np.random.default_rng(5)
    half = chance.normal(size=(4, 4))
    hessian, rows = half @ half.T + np.eye(4), chance.normal(size=(3, 4))
    qp = solver(hessian, rows, TOLERANCE, 100, softness)
    for number in range(6):
        problem = [20.0 * chance.normal(size=4), -np.ones(3), np.ones(3), -np.ones(4), np.ones(4)]
        if number == (0 if first else 2):
            before = qp.z.copy()
            spoil(*problem)
            assert qp.solve(*problem) == FAILED
            np.testing.assert_array_equal(qp.z, before)
            continue
        fresh = solver(hessian, rows, TOLERANCE, 100, softness)
        assert qp.solve(*problem) == fresh.solve(*problem) == SOLVED
        np.testing.assert_allclose(qp.z, fresh.z, atol=1e-9)


@each
@pytest.mark.parametrize("by", [1e-12, 5e-7])
def test_bounds_crossed_by_less_than_the_tolerance_are_one_bound(solver, by):
    qp = solver(np.eye(2), np.ones((1, 2)), TOLERANCE, 50)
    wide, row = np.ones(2), np.ones(1)
    for _ in range(2):
        assert qp.solve(np.array([-3.0, 1.0]), 0.5 * row + by, 0.5 * row, -9.0 * wide, 9.0 * wide) == SOLVED
        np.testing.assert_allclose(qp.z, [2.25, -1.75], atol=2.0 * TOLERANCE)
        assert qp.solve(np.array([-3.0, 1.0]), -9.0 * row, 9.0 * row, -9.0 * wide, 9.0 * wide) == SOLVED
        np.testing.assert_allclose(qp.z, [3.0, -1.0], atol=1e-9)


@each
def test_an_active_bound_may_become_infinite(solver):
    qp = solver(np.eye(1), np.ones((1, 1)), TOLERANCE, 50)
    wide = np.array([9.0])
    assert qp.solve(np.array([-3.0]), -wide, np.array([1.0]), -wide, wide) == SOLVED
    assert qp.solve(np.array([-3.0]), -wide, np.array([np.inf]), -wide, wide) == SOLVED
    assert qp.z[0] == pytest.approx(3.0)


@pytest.mark.parametrize("answer", ["beyond a bound", "not the lowest", "wrong flag", "no number"])
def test_the_solver_is_not_believed(monkeypatch, answer):
    """A model that answers something else than the solution is found out, also when it says optimal."""
    qp = QuadraticProgram(np.eye(2), np.ones((1, 2)), TOLERANCE, 50)
    problem = (np.array([-3.0, 0.0]), np.array([-9.0]), np.array([9.0]), -np.ones(2), np.ones(2))
    assert qp.solve(*problem) == SOLVED

    class Liar(daqp.Model):
        def solve(self):
            z, cost, flag, info = super().solve()
            z = {"beyond a bound": np.array([3.0, 0.0]), "not the lowest": 0.5 * z, "no number": np.nan * z}.get(
                answer, z
            )
            return z, cost, 4 if answer == "wrong flag" else flag, info

    monkeypatch.setattr(daqp, "Model", Liar)
    qp.reset()
    assert qp.solve(*problem) == FAILED
    monkeypatch.undo()
    assert qp.solve(*problem) == SOLVED
    np.testing.assert_allclose(qp.z, [1.0, 0.0], atol=1e-9)


@each
@pytest.mark.parametrize("hessian", [np.diag([1.0, 0.0]), np.diag([1.0, -1.0]), np.diag([1.0, np.nan])])
def test_a_program_that_is_not_strictly_convex_is_refused(solver, hessian):
    with pytest.raises(ValueError, match=r"not positive definite|not finite"):
        solver(hessian, np.ones((1, 2)), TOLERANCE, 50)
