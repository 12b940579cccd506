"""Newmark's method as dense algebra: what defines a step, and what is known of its motion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phil_base import newmark

TS = 0.002


def chain(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass, damping and stiffness matrix of some stable system: symmetric, positive definite."""
    draw = np.random.default_rng(seed)
    M, D, K = (part @ part.T + np.eye(n) for part in draw.standard_normal((3, n, n)))
    return M, 10.0 * D, 1e4 * K


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.floats(0.1, 0.5), st.floats(0.5, 1.0))
def test_a_step_fulfils_the_equation_of_motion_and_newmarks_sums(seed: int, n: int, beta: float, gamma: float) -> None:
    """To 1e-9 of the largest term: rounding of a solve with a condition number below 1e5."""
    M, D, K = chain(seed, n)
    A, B = newmark.state_space(M, D, K, TS, beta, gamma)
    draw = np.random.default_rng(seed)
    old, f = draw.standard_normal((3, n)), 1e3 * draw.standard_normal(n)
    q, q_t, q_tt = (A @ old.ravel() + B @ f).reshape(3, n)
    terms = np.array([M @ q_tt, D @ q_t, K @ q, -f])
    assert np.abs(terms.sum(axis=0)).max() < 1e-9 * np.abs(terms).max()
    q_sum = old[0] + TS * old[1] + TS**2 * ((0.5 - beta) * old[2] + beta * q_tt)
    v_sum = old[1] + TS * ((1.0 - gamma) * old[2] + gamma * q_tt)
    scale = np.abs(np.concatenate([old[0], TS**2 * q_tt])).max(), np.abs(np.concatenate([old[1], TS * q_tt])).max()
    assert np.abs(q - q_sum).max() < 1e-12 * scale[0] and np.abs(v_sum - q_t).max() < 1e-12 * scale[1]


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_without_damping_the_trapezoidal_rule_keeps_the_energy(seed: int, n: int) -> None:
    """Beta 1/4, gamma 1/2: to rounding, 1e-9 after 200 steps."""
    M, _, K = chain(seed, n)
    A, _ = newmark.state_space(M, np.zeros((n, n)), K, TS, 0.25, 0.5)
    q, q_t = np.random.default_rng(seed).standard_normal((2, n)) * np.array([[1e-2], [1.0]])
    x = np.concatenate([q, q_t, -np.linalg.solve(M, K @ q)])

    def energy(x: np.ndarray) -> float:
        q, q_t = x[:n], x[n : 2 * n]
        return float(q_t @ M @ q_t + q @ K @ q)

    before = energy(x)
    for _ in range(200):
        x = A @ x
    assert energy(x) == pytest.approx(before, rel=1e-9)
