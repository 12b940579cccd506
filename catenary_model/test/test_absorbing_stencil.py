"""Interior schemes as stencils, their dispersion relation, and the file of boundary coefficients."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.absorbing import (
    BoundaryStencil,
    Stencil,
    Term,
    beam,
    centred,
    clamped,
    difference,
    from_terms,
    growth,
    moving_beam,
    read_file,
    spatial_roots,
    temporal_roots,
    unknowns,
    wave_1d,
    wave_2d,
    waves,
    write_file,
)
from catenary_model.absorbing.dispersion import group_velocity

BEAM = beam(1.35, 0.2, 150.0, 20e3, 0.25, 1e-3)
INSTANCES = {
    "wave_1d": wave_1d(120.0, 0.5, 2e-3),
    "damped wave": wave_1d(120.0, 0.5, 2e-3, damping=3.0),
    "beam": BEAM,
    "beam, fourth order, on springs": beam(1.35, 0.2, 150.0, 20e3, 0.25, 5e-4, accuracy=4, k=2e3),
    "moving beam": moving_beam(1.35, 0.2, 150.0, 20e3, 70.0, 0.25, 1e-3),
    "wave_2d": wave_2d(340.0, 0.1, 2e-4, dy=0.15),
}
angle = st.floats(-np.pi, np.pi, allow_subnormal=False)


@pytest.mark.parametrize("name", INSTANCES)
@given(angles=st.tuples(angle, angle))
@settings(max_examples=40, deadline=None)
def test_plane_waves_pass_the_interior_scheme(name: str, angles: tuple[float, float]) -> None:
    """The explicit update of e^{i(omega_x x + omega_t t)} is that wave one step on, to rounding of the sum."""
    stencil = INSTANCES[name]
    space = tuple(np.exp(1j * a) for a in angles[: stencil.dims])
    weights = stencil.weights()
    for z in np.ravel(temporal_roots(stencil, *space)):
        if abs(z) < 0.1:  # a spurious wave that is gone at once: dividing by it would only amplify rounding
            continue
        wave = z ** -np.arange(stencil.levels)
        for factor, (low, high) in zip(space, stencil.reach, strict=True):
            wave = wave[..., None] * factor ** np.arange(-low, high + 1)
        # A double root (no wave at all, or the grid's cut-off) is only known to the square root of rounding.
        assert abs(np.sum(weights * wave) - z) < 2e-7 * np.abs(weights).sum() / abs(z)
        if min(abs(a) for a in angles[: stencil.dims]) > 0.05 and max(abs(a) for a in angles) < 3.0:
            assert abs(np.sum(weights * wave) - z) < 1e-11 * np.abs(weights).sum() / abs(z)


@pytest.mark.parametrize("name", [n for n, s in INSTANCES.items() if s.dims == 1])
@pytest.mark.parametrize("side", ["left", "right"])
def test_roots_in_space_are_waves_of_the_scheme_sorted_by_direction(name: str, side: str) -> None:
    stencil = INSTANCES[name]
    z = np.exp(2j * np.pi * np.array([0.5, 3.0, 20.0]) * stencil.dt)
    modes = waves(stencil, z, side)
    sign = 1 if side == "left" else -1
    for factors in (modes.incident, modes.reflected):
        residual = stencil.symbol(factors**sign, z[:, None]) / np.abs(stencil.coefficients).sum()
        # Roots of degree 4 to 12, some of modulus 200: what is left is rounding times their largest power.
        assert np.all(np.abs(residual) < 1e-9 * np.maximum(np.abs(factors), 1 / np.abs(factors)) ** 6)
    if "springs" in name:
        return  # below its cut-off nothing propagates
    towards = sign * group_velocity(stencil, modes.incident[:, 0] ** sign, z)
    away = sign * group_velocity(stencil, modes.reflected[:, 0] ** sign, z)
    assert np.all(towards < 0.0) and np.all(away > 0.0)


def test_group_velocity_is_the_slope_of_the_dispersion_relation() -> None:
    """Against a difference quotient of the temporal root, 1e-6."""
    k, h = np.linspace(0.2, 8.0, 20), 1e-5
    roots = [temporal_roots(BEAM, np.exp(1j * x * BEAM.dx[0])) for x in (k - h, k, k + h)]
    left_going = [np.take_along_axis(r, np.argmax(np.angle(r), axis=1)[:, None], 1)[:, 0] for r in roots]
    slope = (np.angle(left_going[2]) - np.angle(left_going[0])) / BEAM.dt / (2.0 * h)
    found = group_velocity(BEAM, np.exp(1j * k * BEAM.dx[0]), left_going[1])
    assert np.allclose(found, -slope, rtol=1e-4)


def test_scheme_converges_to_the_dispersion_relation_of_the_beam() -> None:
    """Second order in dx at dt proportional to dx: the error falls fourfold when both are halved."""
    k = 2.0
    exact = np.sqrt((150.0 * k**4 + 20e3 * k**2) / 1.35)
    errors = []
    for dx in (0.2, 0.1, 0.05):
        dt = 1e-3 * dx / 0.5
        z = temporal_roots(beam(1.35, 0.0, 150.0, 20e3, dx, dt), np.exp(1j * k * dx))
        errors.append(abs(np.abs(np.angle(z)).max() / dt - exact))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.05)


def test_difference_weights() -> None:
    assert np.allclose(difference(2, (-1, 0, 1)), [1, -2, 1])
    assert np.allclose(difference(4, centred(4)), [1, -4, 6, -4, 1])
    assert np.allclose(difference(1, (-2, -1, 0)), [0.5, -2, 1.5])
    assert np.allclose(difference(2, centred(2, 4)), np.array([-1, 16, -30, 16, -1]) / 12)
    x = np.array([-3, -1, 0, 2, 5])
    assert difference(3, tuple(x)) @ (2.0 * x**3 - x**2) == pytest.approx(12.0)


def test_terms_of_the_wave_equation_make_the_leapfrog_scheme() -> None:
    stencil = from_terms([Term(1.0, time=2), Term(-9.0, space=(2,))], 1.0, 0.25)
    r = (3.0 * 0.25) ** 2
    assert np.allclose(stencil.weights(), [[r, 2 - 2 * r, r], [0, -1, 0]])
    assert stencil.reach == ((1, 1),) and stencil.levels == 2
    assert stencil.new_coefficient == pytest.approx(16.0)


@given(courant=st.floats(0.05, 1.0), number=st.floats(0.2, 3.0))
@settings(deadline=None)
def test_growth_is_von_neumanns_limit(courant: float, number: float) -> None:
    """The leapfrog scheme is neutral up to Courant number 1 and grows above it."""
    assert growth(wave_1d(number, 1.0, courant / number)) == pytest.approx(1.0, abs=1e-7)
    assert growth(wave_1d(number, 1.0, 1.02 / number)) > 1.1


def test_mirrored_stencil_swaps_the_sides() -> None:
    stencil = INSTANCES["moving beam"]
    z = np.exp(1j * np.array([0.01, 0.1]))
    assert np.allclose(
        np.sort(np.abs(spatial_roots(stencil.mirrored(), z))), np.sort(1 / np.abs(spatial_roots(stencil, z)))
    )
    assert np.allclose(waves(stencil, z, "right").incident, waves(stencil.mirrored(), z, "left").incident)


@pytest.mark.parametrize(
    ("offsets", "coefficients", "message"),
    [
        ([[0, 1], [1, 1], [0, 0]], [1.0, 1.0, 1.0], "new level"),
        ([[0, 0], [1, 0]], [1.0, 1.0], "new level"),
        ([[0, 2], [0, 0]], [1.0, 1.0], "new level"),
        ([[0.5, 1], [0, 0]], [1.0, 1.0], "integers"),
        ([[0, 1], [0, 0]], [1.0], "do not fit"),
        ([[0, 0, 1], [0, 0, 0]], [1.0, 1.0], "columns"),
        ([[0, 1], [0, 0]], [1.0, np.nan], "finite"),
    ],
)
def test_stencils_that_are_none_are_refused(
    offsets: list[list[float]], coefficients: list[float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Stencil(np.array(offsets), np.array(coefficients), (1.0,), 1.0)


def test_bad_input_is_refused_with_its_reason() -> None:
    with pytest.raises(ValueError, match="positive"):
        wave_1d(1.0, -0.1, 0.1)
    with pytest.raises(ValueError, match="repeat"):
        difference(1, (0, 0, 1))
    with pytest.raises(ValueError, match="at least 3 points"):
        difference(2, (0, 1))
    with pytest.raises(ValueError, match="even order"):
        centred(2, 3)
    with pytest.raises(ValueError, match="more space dimensions"):
        from_terms([Term(1.0, time=2), Term(1.0, space=(2, 2))], 0.1, 0.1)
    too_fast = Stencil(np.array([[0, 1], [0, 0], [1, 0]]), np.array([1.0, 0.5, -1.5]), (1.0,), 1.0)  # Courant 1.5
    with pytest.raises(ValueError, match="expected 0 waves away from the boundary and 1 towards"):
        waves(too_fast, np.exp(1j * np.linspace(0.01, 3.0, 40)))
    with pytest.raises(ValueError, match='"left" or "right"'):
        BEAM.nodes_at("top")
    with pytest.raises(ValueError, match="implicit"):
        BoundaryStencil(np.ones((2, 2, 3)))
    with pytest.raises(ValueError, match="odd"):
        BoundaryStencil(np.zeros((1, 2, 3, 4)))
    with pytest.raises(ValueError, match="shape"):
        BoundaryStencil(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="finite"):
        BoundaryStencil(np.full((1, 2, 1), np.nan) * unknowns((1, 2, 1)))


def test_names_of_unknowns_follow_their_order() -> None:
    boundary = clamped(BEAM, "left")
    names = boundary.names()
    assert len(names) == int(unknowns(boundary.coefficients.shape).sum()) == 5
    assert names[0] == "c[0]: w_n+1, node [1]" and names[-1] == "c[1]: w_n, node [1]"


def test_coefficient_file_keeps_every_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    shape = (2, 3, 4)
    made = [BoundaryStencil(rng.normal(size=shape) * unknowns(shape), side) for side in ("left", "right")]
    write_file(tmp_path / "c.json", BEAM, *made, objective="reflection", reached=0.1)
    stencil, found, info = read_file(tmp_path / "c.json")
    assert np.array_equal(stencil.coefficients, BEAM.coefficients) and np.array_equal(stencil.offsets, BEAM.offsets)
    assert (stencil.dx, stencil.dt, stencil.name, stencil.parameters) == (BEAM.dx, BEAM.dt, "beam", BEAM.parameters)
    for a, b in zip(made, found, strict=True):
        assert np.array_equal(a.coefficients, b.coefficients) and a.side == b.side
    assert info == {"objective": "reflection", "reached": 0.1}
    for text in ("", "[]", '{"format": "other"}', '{"format": "absorbing-boundary-1"}'):
        (tmp_path / "bad.json").write_text(text)
        with pytest.raises(ValueError, match="is not a file of absorbing boundaries"):
            read_file(tmp_path / "bad.json")
