"""Element matrices against quadrature and against what they must do to polynomials and waves."""

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model import elements
from catenary_model.line import CONTACT_3_1
from catenary_model.moving_frame import Mesh, assemble, dense, wire_elements

LENGTHS = (0.25, 1.0, 1.25)


@pytest.mark.parametrize("h", LENGTHS)
def test_integrals_equal_gauss_quadrature(h: float) -> None:
    # 6 Gauss points are exact to degree 11, the integrands have degree 6 at most
    nodes, weights = np.polynomial.legendre.leggauss(6)
    value, slope, bend = elements.shape_derivatives((nodes + 1) / 2, h)
    for matrix, left, right in (
        (elements.mass(h), value, value),
        (elements.tension(h), slope, slope),
        (elements.bending(h), bend, bend),
        (elements.convection(h), value, slope),
    ):
        np.testing.assert_allclose(matrix, (left * weights * h / 2) @ right.T, rtol=1e-12, atol=1e-12 * matrix.max())


@given(st.floats(0.0, 1.0), st.floats(0.05, 5.0))
@settings(max_examples=25, deadline=None)
def test_shape_functions_reproduce_cubics(xi: float, h: float) -> None:
    out = np.zeros(4)
    elements.shape_functions(xi, h, out)
    for power in range(4):
        nodal = np.array([0.0**power, power * 0.0 ** max(power - 1, 0), h**power, power * h ** (power - 1)])
        assert out @ nodal == pytest.approx((xi * h) ** power, rel=1e-9, abs=1e-9)


def test_convection_is_skew_but_for_the_ends() -> None:
    symmetric = elements.convection(1.3) + elements.convection(1.3).T
    expected = np.zeros((4, 4))
    expected[0, 0], expected[2, 2] = -1.0, 1.0
    np.testing.assert_allclose(symmetric, expected, atol=1e-14)


def test_velocity_terms_of_the_assembled_frame_are_skew_inside() -> None:
    frame = assemble(Mesh(1.0, 10), CONTACT_3_1, CONTACT_3_1, 80.0)
    still = assemble(Mesh(1.0, 10), CONTACT_3_1, CONTACT_3_1, 0.0)
    moving = dense(frame.damping) - dense(still.damping)
    inner = slice(4, -4)
    np.testing.assert_allclose((moving + moving.T)[inner, inner], 0.0, atol=1e-10)
    assert np.abs(moving).max() > 100.0


@pytest.mark.parametrize("speed", [0.0, 250 / 3.6, 320 / 3.6])
@pytest.mark.parametrize("wave_number", [0.1, 0.5, 1.0, -0.5, -1.0])
def test_dispersion_of_the_mesh_follows_the_beam(speed: float, wave_number: float) -> None:
    """Bloch waves obey rhoA (omega - v k)^2 = EI k^4 + T k^2 for w = exp(i (k x + omega t)), damping aside.

    Tolerance 5e-4 of omega: cubic elements err by (k h)^6 for the stiffness, 6 elements a wave at k = 1.
    """
    wire, h = CONTACT_3_1, 1.0
    M, D, K = wire_elements(type(wire)(wire.mass_per_length, 0.0, wire.bending_stiffness, wire.tension), h, speed)

    def bloch(block: np.ndarray) -> np.ndarray:
        phase = np.exp(1j * wave_number * h)
        gather = np.vstack([np.eye(2), phase * np.eye(2)])
        return np.asarray(gather.conj().T @ block @ gather)

    M2, D2, K2 = bloch(M), bloch(D), bloch(K)
    # lambda = i omega of lambda^2 M + lambda D + K
    one, zero = np.eye(2), np.zeros((2, 2))
    eigenvalues = scipy.linalg.eigvals(np.block([[zero, one], [-K2, -D2]]), scipy.linalg.block_diag(one, M2))
    omega = eigenvalues.imag
    for sign in (1.0, -1.0):
        exact = speed * wave_number + sign * wire.frequency(wave_number)
        assert np.abs(omega - exact).min() <= 5e-4 * wire.frequency(wave_number)
    assert np.abs(eigenvalues.real).max() <= 1e-6 * np.abs(omega).max()
