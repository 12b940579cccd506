"""Reflection coefficients, output errors and stability verdicts of boundary stencils in one dimension."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.absorbing import (
    J_OE,
    BoundaryStencil,
    band,
    beam,
    broadband,
    clamped,
    eigenvalues,
    growth,
    moving_beam,
    output_error,
    packet,
    radius,
    reflection,
    run,
    steps,
    unknowns,
    wave_1d,
    wave_2d,
    waves,
)
from catenary_model.absorbing.judge import judge
from catenary_model.absorbing.objective import errors, errors_with_derivative, outgoing
from catenary_model.absorbing.reflection import amplitudes, amplitudes_with_derivative, echo_matrix
from catenary_model.absorbing.simulate import growth_of
from catenary_model.absorbing.stability import edge_rows, moduli_with_derivative, transition

COURANT_ONE = wave_1d(10.0, 0.1, 0.01)
EXACT = BoundaryStencil(np.array([[[0.0, 0.0], [0.0, 1.0]]]))  # w_0^{n+1} = w_1^n
STRING = wave_1d(120.0, 0.5, 2e-3)
BEAM = beam(1.35, 0.2, 150.0, 20e3, 0.25, 1e-3)
W = band(0.5, 30.0)


def mur(courant: float, side: str = "left") -> BoundaryStencil:
    """First-order one-way equation, centred: w_0^{n+1} = w_1^n + (r - 1)/(r + 1) (w_1^{n+1} - w_0^n)."""
    a = (courant - 1.0) / (courant + 1.0)
    return BoundaryStencil(np.array([[[0.0, a], [-a, 1.0]]]), side)


def random_boundary(seed: int, shape: tuple[int, int, int], size: float = 0.3) -> BoundaryStencil:
    return BoundaryStencil(np.random.default_rng(seed).normal(size=shape) * size * unknowns(shape))


def test_exact_boundary_of_the_wave_at_courant_number_one() -> None:
    """What leaves is never seen again: no reflection and no output error at any frequency, to rounding."""
    f = np.linspace(0.2, 45.0, 50)
    assert np.abs(reflection(COURANT_ONE, EXACT, f)).max() < 1e-10
    assert J_OE(COURANT_ONE, EXACT, W) < 1e-11
    assert J_OE(COURANT_ONE, EXACT.mirrored(), W) < 1e-11
    assert J_OE(COURANT_ONE, clamped(COURANT_ONE, "left"), W) > 1.0


def test_clamped_ends_reflect_everything() -> None:
    f = np.linspace(0.5, 60.0, 30)
    assert np.allclose(reflection(STRING, clamped(STRING, "left"), f), -1.0)
    lossless = beam(1.35, 0.0, 150.0, 20e3, 0.25, 1e-3)
    assert np.allclose(np.abs(reflection(lossless, clamped(lossless, "right"), f)), 1.0)


@given(f=st.floats(0.5, 60.0), courant=st.floats(0.5, 0.99))
@settings(deadline=None)
def test_one_way_equation_reflects_as_its_formula_says(f: float, courant: float) -> None:
    """Centred in a box, the waves e^{i(k x + w t)} leave tan(w dt/2) -+ r tan(k dx/2): their ratio is R, 1e-9."""
    stencil = wave_1d(courant * 0.5 / 2e-3, 0.5, 2e-3)
    omega = np.pi * f * stencil.dt
    k = 2.0 * np.arcsin(np.sin(omega) / courant)
    ratio = np.tan(omega), courant * np.tan(k / 2.0)
    expected = abs((ratio[0] - ratio[1]) / (ratio[0] + ratio[1]))
    assert abs(reflection(stencil, mur(courant), np.array([f]))[0]) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("side", ["left", "right"])
def test_runs_reflect_as_the_dispersion_relation_says(side: str) -> None:
    """A short pulse and wave packets against the formula: 2 % of R at frequencies that the grid resolves."""
    boundary = mur(0.6, side)
    f = np.array([12.0, 20.0, 30.0])
    theory = np.abs(reflection(STRING, boundary, f))
    assert np.allclose(broadband(STRING, boundary, np.linspace(10.0, 30.0, 11))[[1, 5, 10]], theory, rtol=0.02)
    assert packet(STRING, boundary, 30.0, cycles=16)[0] == pytest.approx(theory[2], rel=0.1)


def test_beam_at_the_node_with_the_evanescent_branch() -> None:
    """Incident, reflected and evanescent wave together meet the two boundary equations, to rounding."""
    boundary = random_boundary(5, (2, 3, 4))
    z = np.exp(2j * np.pi * np.array([1.0, 10.0, 60.0]) * BEAM.dt)
    modes = waves(BEAM, z)
    a = amplitudes(boundary, modes)
    k, level = np.arange(4), 1 - np.arange(3)
    for i in range(3):
        shape = modes.incident[i, 0] ** k + a[i, 0] * modes.reflected[i, 0] ** k + a[i, 1] * modes.reflected[i, 1] ** k
        field = z[i] ** level[:, None] * shape
        for p in range(2):
            assert abs(np.sum(boundary.coefficients[p] * field) - field[0, p]) < 1e-12


def test_local_field_is_the_sum_of_the_evanescent_waves_at_each_node() -> None:
    """Six nodes, five evanescent waves of large amplitudes that nearly cancel: seen is what is there."""
    stencil = moving_beam(1.35, 0.2, 150.0, 20e3, 60.0, 0.25, 1e-3)
    modes = waves(stencil, np.exp(2j * np.pi * np.array([2.0, 20.0]) * stencil.dt))
    a = amplitudes(random_boundary(7, (6, 3, 8), 0.1), modes)
    seen = (echo_matrix(modes) @ a[..., None])[..., 0]
    assert np.allclose(seen[:, 0], a[:, 0])
    for k in range(5):
        assert np.allclose(seen[:, 1 + k], sum(a[:, j] * modes.reflected[:, j] ** k for j in range(1, 6)))


@pytest.mark.parametrize("side", ["left", "right"])
def test_output_error_is_that_of_a_simulation(side: str) -> None:
    """Complex harmonic wave on a long grid with the boundary at one end, nodes and steps counted: 1e-9."""
    boundary = random_boundary(2, (2, 3, 4))
    boundary = boundary if side == "left" else boundary.mirrored()
    omega, nodes, count = 1.7, 8, 16
    z = outgoing(BEAM, np.array([omega]), side)[0]
    x = np.arange(80) * BEAM.dx[0]
    levels = np.array([np.exp(1j * omega * x) * z**-n for n in range(2)])
    frames = [
        [f.copy() for f, _ in zip(steps(BEAM, *ends(boundary), part), range(count), strict=False)]
        for part in (levels.real, levels.imag)
    ]
    near = slice(nodes) if side == "left" else slice(-nodes, None)
    total = sum(
        np.abs((re + 1j * im - np.exp(1j * omega * x) * z ** (n + 1))[near]).sum()
        for n, (re, im) in enumerate(zip(*frames, strict=True))
    )
    assert output_error(BEAM, boundary, np.array([omega]), count, nodes)[0] == pytest.approx(total, rel=1e-9)


def ends(boundary: BoundaryStencil) -> tuple[BoundaryStencil | None, BoundaryStencil | None]:
    return (boundary, None) if boundary.side == "left" else (None, boundary)


def test_derivatives_against_difference_quotients() -> None:
    """Amplitudes, output errors and eigenvalue moduli along a random direction: 1e-6 of the largest."""
    boundary, shape = random_boundary(1, (2, 3, 4), 0.05), (2, 3, 4)
    direction = np.random.default_rng(9).normal(size=shape) * unknowns(shape)
    d, h = direction[unknowns(shape)], 1e-6
    plus, minus = (BoundaryStencil(boundary.coefficients + s * h * direction) for s in (1, -1))
    modes = judge(BEAM, W, "left").inside
    omega = np.array([0.1, 1.0, 3.0])
    value, slope = amplitudes_with_derivative(boundary, modes)
    assert np.allclose(value, amplitudes(boundary, modes))
    found = (amplitudes(plus, modes) - amplitudes(minus, modes)) / (2 * h)
    assert np.allclose(slope @ d, found, atol=1e-6 * np.abs(found).max())
    slope = errors_with_derivative(BEAM, boundary, omega)[1]
    found = (errors(BEAM, plus, omega) - errors(BEAM, minus, omega)) / (2 * h)
    assert np.allclose(slope @ d, found, atol=1e-6 * np.abs(found).max())
    for other in (None, "same"):
        triple = [(b, clamped(BEAM) if other is None else b.mirrored()) for b in (boundary, plus, minus)]
        slope = moduli_with_derivative(BEAM, *triple[0], 14, "left")[1]
        high, low = (moduli_with_derivative(BEAM, *pair, 14, "left")[0] for pair in triple[1:])
        assert np.allclose(slope @ d, (high - low) / (2 * h), atol=1e-5)


def test_edge_rows_replace_new_values_by_old_ones() -> None:
    """One step with the implicit-looking form, from inside outwards, is one step with old values only."""
    stencil, shape = moving_beam(1.35, 0.2, 150.0, 20e3, 60.0, 0.25, 1e-3, reach=2), (4, 4, 7)
    left, right = random_boundary(3, shape), random_boundary(4, shape).mirrored()
    rng = np.random.default_rng(0)
    old = rng.normal(size=(3, 20))
    new = np.zeros(20)
    weights = stencil.weights()
    for j in range(4, 16):
        new[j] = sum(weights[level] @ old[level, j - 4 : j + 5] for level in range(stencil.levels))
    for boundary, view in ((left, slice(None)), (right, slice(None, None, -1))):
        all_levels = np.concatenate([new[None], old])[:, view]
        for p in range(3, -1, -1):
            all_levels[0, p] = np.sum(boundary.coefficients[p] * all_levels[:, :7])
        new[view] = all_levels[0]
    matrix = transition(stencil, left, right, 20)
    assert np.allclose((matrix @ old.ravel())[:20], new, rtol=1e-12)
    assert edge_rows(stencil, left).shape == (4, 3, 11)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_verdicts_agree_with_long_runs(seed: int) -> None:
    """A run decays if the spectral radius is below 1, else it grows at the rate that the radius says, 2 %."""
    boundary = BoundaryStencil(mur(0.48).coefficients + 0.25 * random_boundary(seed, (1, 2, 2)).coefficients)
    rate = np.log(radius(STRING, boundary, None, 12))
    if abs(rate) < 0.02:
        return  # neither: a run of this length cannot tell
    count = min(4000, int(60.0 / abs(rate)))
    start = np.random.default_rng(seed).normal(size=12)
    peaks = growth_of(STRING, boundary, None, start, count, 4)
    assert (peaks[-1] > peaks[1]) == (rate > 0.0)
    measured = np.log(peaks[-1] / peaks[1]) / (2.0 * (count // 4))
    assert measured == pytest.approx(rate, rel=0.1, abs=2.0 / count)


def test_spectral_radius_of_a_clamped_string_is_one_and_its_modes_are_known() -> None:
    """Lossless and clamped: omega of the grid's standing waves, 1e-9; the boundary nodes' zeros come on top."""
    n = 14
    k = np.pi * np.arange(1, n - 1) / (n - 1)
    expected = 2.0 * np.arcsin(0.48 * np.sin(k / 2.0))
    found = eigenvalues(STRING, None, None, n)
    assert radius(STRING, None, None, n) == pytest.approx(1.0, abs=1e-9)
    angles = np.sort(np.angle(found[(np.abs(found) > 0.5) & (found.imag > 0)]))
    assert np.allclose(angles, np.sort(expected), atol=1e-9)


def test_spectral_radius_is_that_of_a_node_left_to_itself() -> None:
    """w_0 grows by itself, 5 % a step, whatever the rest does: a single real eigenvalue."""
    alone = BoundaryStencil(np.array([[[0.0], [1.05]]]))
    assert radius(STRING, alone, None) == pytest.approx(1.05, abs=1e-9)


def test_simulation_starts_from_rest_keeps_frames_and_takes_loads() -> None:
    bump = np.exp(-(((np.arange(101) - 50) / 6.0) ** 2))
    frames = run(COURANT_ONE, EXACT, EXACT.mirrored(), bump, 90, every=30)
    assert frames.shape == (4, 101)
    # d'Alembert at Courant number 1, from rest up to the half step that starting with two equal levels is off by.
    assert np.allclose(frames[1][20], 0.5, atol=0.02) and np.allclose(frames[1][80], 0.5, atol=0.02)
    assert np.abs(frames[3]).max() < 1e-12
    force = np.zeros(101)
    force[50] = 1.0
    loaded = run(COURANT_ONE, None, None, np.zeros(101), 1, load=lambda n: force)
    assert loaded[1][50] == pytest.approx(COURANT_ONE.dt**2)
    with pytest.raises(ValueError, match="blocks"):
        growth_of(STRING, None, None, bump, 3, 4)


def test_what_does_not_fit_is_refused() -> None:
    left = mur(0.5)
    with pytest.raises(ValueError, match="mirrored"):
        radius(STRING, None, left)
    with pytest.raises(ValueError, match="too small"):
        radius(STRING, left, None, 2)
    with pytest.raises(ValueError, match="cannot reach 2"):
        radius(BEAM, left, None)
    with pytest.raises(ValueError, match="space dimensions"):
        radius(wave_2d(1.0, 0.1, 0.01), None, None)
    with pytest.raises(ValueError, match="more than one dimension"):
        radius(STRING, BoundaryStencil(np.zeros((1, 2, 2, 3))), None)
    with pytest.raises(ValueError, match="above 0 and up to 250 Hz"):
        reflection(STRING, left, np.array([251.0]))
    with pytest.raises(ValueError, match="cannot determine 2"):
        reflection(BEAM, left, np.array([1.0]))
    with pytest.raises(ValueError, match="updates 1 nodes"):
        output_error(BEAM, left, np.array([1.0]))
    assert growth(STRING) == pytest.approx(1.0)
