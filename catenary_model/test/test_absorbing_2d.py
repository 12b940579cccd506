"""Plane waves, Engquist-Majda and Higdon boundaries of the 2-D wave equation, and runs in time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.absorbing import BoundaryStencil, Stencil, assembly, periodic_strip, square, wave_1d, wave_2d
from catenary_model.absorbing.engquist_majda import continuous, first_order, second_order
from catenary_model.absorbing.higdon import Factor, box, courant, diagonal, higdon, product
from catenary_model.absorbing.plane_waves import Band, oriented, reflected_roots, reflection, rms, time_factor, worst

WAVE = wave_2d(c=340.0, dx=0.1, dt=0.5 * 0.1 / 340.0)
ANGLES = np.array([0.0, 20.0, 45.0, 60.0, 75.0])
angles = st.floats(-1.4, 1.4, allow_subnormal=False)
nodes_per_wave = st.floats(5.0, 100.0, allow_subnormal=False)


@given(angles, nodes_per_wave)
def test_plane_waves_pass_the_interior(angle: float, ratio: float) -> None:
    k = 2.0 * np.pi / (ratio * WAVE.dx[0])
    k_x, k_y = np.array([k * np.cos(angle)]), np.array([k * np.sin(angle)])
    z = time_factor(WAVE, k_x, k_y)
    residual = WAVE.symbol(np.exp(1j * k_x * WAVE.dx[0]), np.exp(1j * k_y * WAVE.dx[1]), z)
    # Rounding of the five-point sum, relative to its largest coefficient.
    assert np.abs(residual)[0] < 1e-12 * np.abs(WAVE.coefficients).max()
    assert abs(abs(z[0]) - 1.0) < 1e-12
    # Second order in space and time: omega_t = c k (1 - O((k dx)^2)), and the numerical wave is the slower one.
    omega = np.angle(z[0]) / WAVE.dt
    assert 1.0 - (k * WAVE.dx[0]) ** 2 / 12.0 < omega / (340.0 * k) <= 1.0 + 1e-12


@given(st.floats(-1.3, 1.3, allow_subnormal=False), nodes_per_wave)
def test_reflected_wave_of_the_five_point_scheme_is_the_mirrored_one(angle: float, ratio: float) -> None:
    k = 2.0 * np.pi / (ratio * WAVE.dx[0])
    k_x, k_y = np.array([k * np.cos(angle)]), np.array([k * np.sin(angle)])
    root = reflected_roots(WAVE, time_factor(WAVE, k_x, k_y), np.exp(1j * k_y * WAVE.dx[1]))
    # Square root of rounding next to grazing, where the two roots meet.
    assert root[0, 0] == pytest.approx(np.exp(-1j * k_x[0] * WAVE.dx[0]), abs=1e-6)


@pytest.mark.parametrize(
    ("boundary", "order"),
    [(first_order(WAVE), 1), (second_order(WAVE), 2), (second_order(WAVE, "centred"), 2), (higdon(WAVE, [0, 0]), 2)],
)
def test_engquist_majda_is_recovered_on_a_fine_grid(boundary: BoundaryStencil, order: int) -> None:
    fine, finer = (
        np.abs(reflection(WAVE, boundary, np.array(2.0 * np.pi / (n * WAVE.dx[0])), np.radians(ANGLES)))
        for n in (50.0, 100.0)
    )
    expected = continuous(ANGLES, order)
    # (k dx)^2 = 4e-3 at 100 nodes a wave; the error falls with it, by four, once it is above rounding.
    assert np.abs(finer - expected).max() < 4e-3
    error = np.abs(fine - expected).max()
    assert np.abs(finer - expected).max() < max(0.3 * error, 1e-9)


def test_higdon_is_exact_at_its_angles_and_a_product_reflects_the_product() -> None:
    k = np.array(2.0 * np.pi / (200.0 * WAVE.dx[0]))
    boundary = higdon(WAVE, [10.0, 35.0, 55.0])
    assert np.abs(reflection(WAVE, boundary, k, np.radians([10.0, 35.0, 55.0]))).max() < 1e-4
    single = [np.abs(reflection(WAVE, higdon(WAVE, [d]), k, np.radians(ANGLES))) for d in (10.0, 35.0, 55.0)]
    np.testing.assert_allclose(np.abs(reflection(WAVE, boundary, k, np.radians(ANGLES))), np.prod(single, axis=0), 1e-7)


def test_first_order_is_the_box_of_one_factor() -> None:
    np.testing.assert_allclose(first_order(WAVE).coefficients, higdon(WAVE, [0.0]).coefficients, atol=1e-15)


def test_reflection_is_the_same_at_all_four_sides() -> None:
    left = second_order(WAVE)
    k, angle = np.array(2.0 * np.pi / (15.0 * WAVE.dx[0])), np.radians(ANGLES)
    expected = reflection(WAVE, left, k, angle)
    for side in ("left", "right"):
        for axis in (0, 1):
            turned = BoundaryStencil(left.coefficients, side, axis)
            np.testing.assert_allclose(reflection(WAVE, turned, k, angle), expected, rtol=1e-9, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.builds(
            Factor,
            st.floats(0.1, 1.2),
            st.floats(0.0, 0.5, allow_subnormal=False),
            st.floats(0.0, 0.5, allow_subnormal=False),
            st.floats(1e-3, 0.5),
        ),
        min_size=1,
        max_size=2,
    ),
    st.floats(0.2, 0.69),
)
def test_products_within_the_limits_neither_amplify_waves_nor_grow(
    factors: list[Factor], courant_number: float
) -> None:
    stencil = wave_2d(1.0, 1.0, courant_number)
    boundary = product(factors, courant_number)
    k = Band(100.0, 4.0, 8).wave_numbers(1.0)
    assert np.abs(reflection(stencil, boundary, k[:, None], np.radians(ANGLES))).max() <= 1.0 + 1e-9
    # Two factors leave a double eigenvalue near 1, which rounding splits by its square root, 1e-8.
    assert periodic_strip.stability(stencil, boundary, nodes=8, samples=7).radius < 1.0 + 1e-7


@pytest.mark.parametrize("degrees", [15.0, 60.0])
def test_packets_in_time_reflect_what_the_dispersion_relation_says(degrees: float) -> None:
    for boundary in (second_order(WAVE), higdon(WAVE, [0.0, 40.0], 1e-3)):
        echo = periodic_strip.measure(WAVE, boundary, 2.0 * np.pi / (12.0 * WAVE.dx[0]), np.radians(degrees))
        expected = np.abs(reflection(WAVE, boundary, echo.k, echo.angle))
        assert len(echo.k) > 5 and np.ptp(expected) > 1e-4
        # The packet's tail has not quite left the strip: 1e-5 of its amplitude.
        np.testing.assert_allclose(echo.amplitude, expected, atol=2e-5)


def test_strip_for_one_wave_number_is_the_square_with_that_wave_along_it() -> None:
    boundary, k_y, n = second_order(WAVE), 7.0, 9
    eta = np.exp(1j * k_y * WAVE.dx[1])
    weights = WAVE.weights()
    rng = np.random.default_rng(1)
    past = [rng.standard_normal(n) + 1j * rng.standard_normal(n) for _ in range(2)]
    new = next(assembly.march(periodic_strip.update(WAVE, boundary, None, n, k_y), past))
    m = np.arange(3) - 1
    plane = [w[:, None] * eta ** m[None, :] for w in past]
    expected = np.zeros(n, complex)
    for j in range(1, n - 1):
        expected[j] = sum((weights[level] * plane[level][j - 1 : j + 2]).sum() for level in range(2))
    c = boundary.coefficients[0]
    newest = expected[:2, None] * eta ** m[None, :]
    expected[0] = (c[0] * newest).sum() + sum((c[1 + q] * plane[q][:2]).sum() for q in range(2))
    np.testing.assert_allclose(new, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("degrees", "damping", "stable"), [((0.0, 30.0), 1e-2, True), ((0.0, 0.0), 5e-3, True), ((0.0, 30.0), -5e-3, False)]
)
def test_verdict_of_a_square_agrees_with_a_long_run(degrees: tuple[float, ...], damping: float, stable: bool) -> None:
    coefficients = higdon(WAVE, degrees, max(damping, 0.0)).coefficients.copy()
    if damping < 0.0:
        # The same box with a damping of the wrong sign, which `product` refuses.
        factors = [box(Factor(np.cos(np.radians(d)), damping=damping), courant(WAVE)) for d in degrees]
        operator = np.zeros((3, 3))
        for (a, b), value in np.ndenumerate(factors[0]):
            operator[a : a + 2, b : b + 2] += value * factors[1]
        coefficients = -operator[None, :, :, None]
        coefficients[0, 0, 0, 0] = 0.0
    step = square.update(WAVE, BoundaryStencil(coefficients), 10, diagonal(WAVE, damping=max(damping, 0.0)))
    radius = assembly.radius(step)
    assert (radius < 1.0) is stable
    # Without any symmetry, so that every mode takes part.
    run = assembly.march(step, [np.random.default_rng(2).standard_normal(100)])
    sizes = np.array([np.linalg.norm(next(run)) for _ in range(6000)])
    # The slowest modes are left in the end; conjugate ones beat within about 1300 steps, so compare peaks.
    measured = (sizes[-1500:].max() / sizes[-4500:-3000].max()) ** (1.0 / 3000.0)
    assert measured == pytest.approx(radius, abs=4e-4)
    assert bool(sizes[-1] < 1e-3 * sizes[0]) is stable
    assert (assembly.growth_after(step, 17) < 1e-6) is stable


def test_unstable_boundary_is_found_by_the_strip() -> None:
    wild = second_order(WAVE).coefficients.copy()
    wild[0, 1, 0, 1] *= 1.3
    assert periodic_strip.stability(WAVE, BoundaryStencil(wild)).radius > 1.05


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ValueError, match="circle"):
        entries = assembly.Entries(2, 1)
        entries.add(0, 0, 1, 0.5)
        entries.add(0, 1, 0, 0.5)
        entries.add(1, 0, 0, 1.0)
        entries.solve()
    with pytest.raises(ValueError, match="near_corner"):
        square.update(WAVE, second_order(WAVE), 12, diagonal(WAVE))
    with pytest.raises(ValueError, match="at least one factor"):
        product([], 0.5)
    with pytest.raises(ValueError, match="damping"):
        product([Factor(1.0, damping=-0.1)], 0.5)
    with pytest.raises(ValueError, match="wave speed"):
        courant(Stencil(WAVE.offsets, WAVE.coefficients, WAVE.dx, WAVE.dt))
    with pytest.raises(ValueError, match="shortest"):
        Band(10.0, 1.0)
    with pytest.raises(ValueError, match="two"):
        oriented(wave_1d(1.0, 1.0, 0.5), first_order(WAVE))


def test_worst_is_never_below_the_mean() -> None:
    boundary = second_order(WAVE)
    assert np.all(worst(WAVE, boundary, ANGLES) >= rms(WAVE, boundary, ANGLES))
