"""Designs in one dimension: least squares, refinement, fronts, cache, and the beam of the published case."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from catenary_model.absorbing import (
    J_OE,
    BoundaryStencil,
    Demands,
    Design,
    Settings,
    Stencil,
    Sweep,
    Term,
    Weighting,
    band,
    beam,
    broadband,
    cached_design,
    cached_pair,
    clamped,
    design,
    design_pair,
    from_terms,
    moving_beam,
    radius,
    read_design,
    refine,
    reflection,
    run,
    unknowns,
    wave_1d,
    wave_2d,
)
from catenary_model.absorbing.figures import fronts_figure, reflection_figure, snapshots_figure
from catenary_model.absorbing.judge import judge
from catenary_model.absorbing.least_squares import mode_weights, rows, solve
from catenary_model.absorbing.pareto import choose, nondominated, size_points, stability_points, write_front
from catenary_model.absorbing.simulate import growth_of

pytestmark = pytest.mark.slow

CONTACT = beam(1.35, 0.2, 150.0, 20e3, 0.25, 1e-3)
BAND = band(0.5, 30.0, outside=1e-3)
SMALL = Sweep(tikhonov=(1e-5, 1e-3), outside=(1e-3,), leak=(1e-5, 1e-4), iterations=2)
COURANT_ONE = wave_1d(10.0, 0.1, 0.01)


def as_start(boundary: BoundaryStencil) -> Design:
    bench = judge(COURANT_ONE, BAND, boundary.side)
    return Design(COURANT_ONE, boundary, BAND, *bench.figures(boundary), radius(COURANT_ONE, boundary), ())


@pytest.fixture(scope="module")
def contact() -> Design:
    return design(CONTACT, "left", 4, 3, BAND)


@pytest.mark.parametrize("objective", ["reflection", "output_error"])
def test_exact_wave_comes_out_of_a_bad_start(objective: str) -> None:
    """At Courant number 1 w_0^{n+1} = w_1^n is the only boundary without reflection: found to 1e-9."""
    bad = as_start(BoundaryStencil(np.array([[[0.0, 0.3], [0.4, 0.3]]])))
    assert bad.reflection > 0.3
    made = refine(bad, Demands(margin=-1e-9), Settings(rounds=2), objective=objective)
    assert np.allclose(made.boundary.coefficients, [[[0.0, 0.0], [0.0, 1.0]]], atol=1e-9)
    assert made.reflection < 1e-9 and J_OE(COURANT_ONE, made.boundary, BAND) < 1e-9


def test_exact_wave_comes_out_of_one_least_squares_problem() -> None:
    sweep = Sweep((1e-9,), (1e-3,), (0.0,), 0)
    made = design(COURANT_ONE, "right", 2, 1, BAND, sweep=sweep, demands=Demands(margin=-1e-9))
    assert made.boundary.side == "right"
    assert np.allclose(made.boundary.coefficients, [[[0.0, 0.0], [0.0, 1.0]]], atol=1e-8)


def test_least_squares_solution_against_brute_force() -> None:
    """The same sum of squares under the same fixed sums, by a general minimiser: no lower value, 1e-6 of it."""
    shape, tikhonov, static = (1, 2, 2), 1e-2, 0.999
    stencil = wave_1d(120.0, 0.5, 2e-3)
    bench = judge(stencil, BAND, "left")
    matrix = np.ones((len(bench.modes.z), 1, 1), complex)
    A, b = rows(bench.modes, shape, matrix, bench.weights[:, None] * mode_weights(1))
    found = solve(A, b, shape, "left", tikhonov, static).coefficients[unknowns(shape)]

    def cost(x: np.ndarray) -> float:
        return float(np.sum((A @ x - b) ** 2) + tikhonov**2 * x @ x)

    brute = minimize(
        cost,
        np.full(3, 0.33),
        method="SLSQP",
        constraints={"type": "eq", "fun": lambda x: x.sum() - static},
        options={"ftol": 1e-14, "maxiter": 400},
    )
    assert found.sum() == pytest.approx(static, abs=1e-12)
    assert cost(found) <= brute.fun * (1.0 + 1e-9)
    assert np.allclose(found, brute.x, atol=1e-4)


def test_beam_under_tension_reflects_less_than_half_a_percent(contact: Design) -> None:
    """Goal of the case: at most 0.5 % from 0.5 to 30 Hz by the dispersion relation and in a run, and stable."""
    f = np.geomspace(0.5, 30.0, 40)
    assert np.abs(reflection(CONTACT, contact.boundary, f)).max() < 5e-4
    assert broadband(CONTACT, contact.boundary, f).max() < 5e-3
    for nodes in (13, 30, 101):
        assert radius(CONTACT, contact.boundary, None, nodes) < 1.0
        assert radius(CONTACT, contact.boundary, contact.boundary.mirrored(), nodes) < 1.0
    assert contact.gain <= 1.0
    assert refine(contact, settings=Settings(rounds=1, evaluations=1)) is contact  # no step made, nothing better


def test_gain_is_a_demand_of_its_own(contact: Design) -> None:
    """A design that reflects too much at some frequency outside the band is passed over, though it is stable."""
    limit = 0.9 * contact.gain
    other = design(CONTACT, "left", 4, 3, BAND, demands=Demands(gain=limit))
    assert other.gain <= limit and other.reflection >= contact.reflection


def test_bump_leaves_a_beam_as_if_it_went_on(contact: Design) -> None:
    """100 m, deflection 0.5, clamped at the right: against 300 m more to the left, 1e-3 of the deflection."""
    x = np.arange(401) * 0.25
    start = 0.5 * np.exp(-(((x - 50.0) / 2.0) ** 2))
    frames = run(CONTACT, contact.boundary, None, start, 1500, every=50)
    exact = run(CONTACT, None, None, np.concatenate([np.zeros(1200), start]), 1500, every=50)[:, 1200:]
    assert np.abs(frames - exact).max() < 5e-4
    assert np.abs(frames[10][200:]).max() > 0.2  # one half is still on its way back from the clamped end
    assert np.abs(frames[-1]).max() < 0.01
    figure = snapshots_figure(x, np.array([0.0, 0.5]), frames[[0, 10]], exact[[0, 10]])
    assert len(figure.axes) == 2


def test_lossless_beam_is_stable_on_its_own() -> None:
    """Without damping nothing but the boundary takes energy: still below 1, and a long run never grows."""
    stencil = beam(1.35, 0.0, 150.0, 20e3, 0.25, 1e-3)
    made = design(stencil, "left", 4, 3, BAND, demands=Demands(margin=1e-9), sweep=SMALL)
    assert radius(stencil, made.boundary, None, 201) < 1.0
    peaks = growth_of(
        stencil, made.boundary, made.boundary.mirrored(), np.random.default_rng(0).normal(size=24), 40_000, 8
    )
    assert np.all(np.diff(peaks) < 0.0)


def test_refinement_improves_and_keeps_what_is_demanded() -> None:
    small = design(CONTACT, "left", 3, 1, BAND, sweep=SMALL)
    better = refine(small, settings=Settings(rounds=3))
    assert better.reflection < 0.2 * small.reflection
    assert better.radius < 1.0 and better.gain <= 1.0
    assert dict(better.origin)["refined"] >= 1.0
    leaks = [1.0 - d.boundary.coefficients.sum(axis=(1, 2)) for d in (small, better)]
    assert np.all(leaks[1] > 0.09 * leaks[0])  # a constant displacement still dies out
    assert refine(better, Demands(gain=1e-6), Settings(rounds=1, evaluations=3)) is better  # nothing can be that good
    with pytest.raises(ValueError, match="objective is"):
        refine(small, objective="energy")


def test_refinement_for_the_output_error_lowers_it() -> None:
    start = design(CONTACT, "left", 4, 2, BAND, sweep=SMALL)
    better = refine(start, settings=Settings(rounds=2, evaluations=15), objective="output_error")
    assert J_OE(CONTACT, better.boundary, BAND) < 0.8 * J_OE(CONTACT, start.boundary, BAND)
    assert better.radius < 1.0


def test_pair_of_a_moving_beam_is_stable_together() -> None:
    """Six nodes a side, different waves ahead and behind: below 1 % from 1 to 30 Hz, and coupled radius below 1."""
    stencil = moving_beam(1.35, 0.2, 150.0, 20e3, 70.0, 0.25, 1e-3)
    sweep = Sweep((1e-5, 1e-4), (1e-3,), (1e-6, 1e-5), 0)
    left, right = design_pair(stencil, 10, 2, band(1.0, 30.0, 1e-3), sweep=sweep)
    f = np.geomspace(1.0, 30.0, 20)
    for made in (left, right):
        assert np.abs(reflection(stencil, made.boundary, f)).max() < 0.01
    for nodes in (24, 61):
        assert radius(stencil, left.boundary, right.boundary, nodes) < 1.0


def test_a_pde_of_ones_own_in_a_few_lines() -> None:
    """Klein-Gordon: a string on springs; the boundary absorbs above the cut-off of 0.48 Hz."""
    scheme = from_terms([Term(1.0, time=2), Term(-(50.0**2), space=(2,)), Term(9.0)], dx=0.5, dt=0.005)
    made = design(scheme, "left", 3, 3, band(2.0, 12.0))
    assert np.abs(reflection(scheme, made.boundary, made.weighting.inside())).max() < 0.02
    assert radius(scheme, made.boundary, None) < 1.0


def test_fronts_and_their_files(tmp_path: Path, contact: Design) -> None:
    told: list[str] = []
    points = stability_points(CONTACT, "left", 4, 3, BAND, sweep=SMALL)
    assert {p.size for p in points} == {2 * 4 * 3 + 3 + 2}
    for p in points[::4]:
        both = max(radius(CONTACT, p.boundary, None, 12), radius(CONTACT, p.boundary, p.boundary.mirrored(), 12))
        assert p.radius == pytest.approx(both)
    designs = size_points(
        CONTACT, "left", (1, 3, 4), (1, 3), BAND, sweep=SMALL, progress=lambda i, n, t: told.append(t)
    )
    assert len(told) == 4
    chosen = choose(designs, 2e-3)
    assert chosen.reflection <= 2e-3
    with pytest.raises(ValueError, match="no design reflects"):
        choose(designs, 1e-9)
    write_front(tmp_path / "front.json", designs, chosen)
    assert np.array_equal(read_front(tmp_path / "front.json"), chosen.boundary.coefficients)
    figure = fronts_figure(points, designs, chosen)
    figure.savefig(tmp_path / "fronts.png")
    f = np.geomspace(0.1, 400.0, 60)
    reflection_figure(CONTACT, {"a": contact.boundary}, f, {"run": (f, f)}, (0.5, 30.0)).savefig(tmp_path / "r.png")
    assert (tmp_path / "fronts.png").stat().st_size > 10_000 and (tmp_path / "r.png").stat().st_size > 5_000


def read_front(path: Path) -> np.ndarray:
    from catenary_model.absorbing import read_file

    return read_file(path)[1][0].coefficients


def test_nondominated_against_its_definition() -> None:
    costs = np.random.default_rng(4).integers(0, 8, size=(60, 2)).astype(float)
    for row, marked in zip(costs, nondominated(costs), strict=True):
        beaten = any(np.all(other <= row) and np.any(other < row) for other in costs)
        assert marked == (not beaten)


def test_designs_are_kept_in_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stencil = wave_1d(120.0, 0.5, 2e-3)
    first = cached_design(stencil, "left", 2, 2, BAND, sweep=SMALL, folder=tmp_path)
    with monkeypatch.context() as patched:
        patched.setattr("catenary_model.absorbing.cache.design", lambda *a, **k: pytest.fail("designed again"))
        again = cached_design(stencil, "left", 2, 2, BAND, sweep=SMALL, folder=tmp_path)
    assert np.array_equal(first.boundary.coefficients, again.boundary.coefficients)
    assert (first.reflection, first.gain, first.radius, first.origin) == (
        again.reflection,
        again.gain,
        again.radius,
        again.origin,
    )
    assert again.weighting == BAND
    (only,) = tmp_path.iterdir()
    only.write_text("half a fi")
    assert np.allclose(
        cached_design(stencil, "left", 2, 2, BAND, sweep=SMALL, folder=tmp_path).boundary.coefficients,
        first.boundary.coefficients,
    )
    left, right = cached_pair(stencil, 2, 2, BAND, sweep=SMALL, folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 3 and (left.boundary.side, right.boundary.side) == ("left", "right")
    cached_design(stencil, "left", 2, 2, BAND, sweep=SMALL, demands=Demands(margin=1e-8), folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 4
    cached_design(replace(stencil, dt=1.9e-3), "left", 2, 2, BAND, sweep=SMALL, folder=tmp_path)
    assert len(list(tmp_path.iterdir())) == 5


def test_bad_input_is_refused_with_its_reason(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="choose a smaller dt"):
        design(wave_1d(1.0, 0.1, 0.2), weighting=band(0.1, 1.0))
    with pytest.raises(ValueError, match="space dimensions"):
        design(wave_2d(1.0, 0.1, 0.01))
    one_way = Stencil(np.array([[0, 1], [0, 0], [1, 0]]), np.array([1.0, -0.5, -0.5]), (1.0,), 1.0)
    with pytest.raises(ValueError, match="nothing to be designed"):
        design(one_way, "left")
    with pytest.raises(ValueError, match="N_x >= 2"):
        design(CONTACT, n_x=1, weighting=BAND)
    with pytest.raises(ValueError, match="half the rate of the steps is 500 Hz"):
        design(CONTACT, weighting=band(1.0, 600.0))
    with pytest.raises(ValueError, match="is stable with margin"):
        design(CONTACT, weighting=BAND, demands=Demands(margin=0.5), sweep=SMALL)
    for bad in (((1.0, 1.0), (1.0, 1.0)), ((1.0,), (1.0, 2.0)), ((1.0,), (-1.0,)), ((-1.0,), (1.0,))):
        with pytest.raises(ValueError, match="weight"):
            Weighting(bad[0], bad[1], (1.0, 2.0))
    with pytest.raises(ValueError, match="band"):
        Weighting((1.0,), (1.0,), (2.0, 1.0))
    clamped_only = tmp_path / "c.json"
    from catenary_model.absorbing import write_file

    write_file(clamped_only, CONTACT, clamped(CONTACT))
    with pytest.raises(ValueError, match="no design"):
        read_design(clamped_only)
