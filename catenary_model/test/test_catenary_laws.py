"""Laws that the moving model must keep: superposition, energy, symmetry, reciprocity, order of convergence."""

import dataclasses
import itertools

import numpy as np
import pytest
from dense_step import place, sites_at
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line, Span, SteadyArm, Wire
from catenary_model.line_file import load_line
from catenary_model.model import Catenary, Config
from catenary_model.moving_frame import dense

TS = 0.002
EN = Line()
FREE = Line(spans=(Span(60.0, ()),), name="free wires")
ARMS = Line(spans=(dataclasses.replace(EN.spans[0], steady_arm=SteadyArm(400.0)),))
UNDAMPED = dataclasses.replace(
    ARMS, carrier=dataclasses.replace(CARRIER_3_1, damping=0.0), contact=dataclasses.replace(CONTACT_3_1, damping=0.0)
)


def contact_force(k: int) -> float:
    t = k * TS
    return min(1.0, t) * (120.0 + 30.0 * np.sin(2 * np.pi * 1.16 * t) + 12.0 * np.sin(2 * np.pi * 10.7 * t))


def push_at(catenary: Catenary, x: float, force: float) -> None:
    """Put a force on the contact wire at x (m, relative to the pantograph) of the next step."""
    e, psi = place(catenary, x)
    catenary.external_load[:] = 0.0
    catenary.external_load[e : e + 2, 1] = force * psi.reshape(2, 2)


def look_at(catenary: Catenary, x: float) -> float:
    """Deviation of the contact wire at x (m, relative to the pantograph)."""
    e, psi = place(catenary, x)
    return float((catenary.deviation[0, e : e + 2, 1] * psi.reshape(2, 2)).sum())


@settings(max_examples=8, deadline=None)
@given(
    speed_kmh=st.floats(0.0, 330.0),
    gain=st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    boundary=st.sampled_from(["matched_dashpot", "clamped"]),
)
@pytest.mark.slow
def test_linear_without_droppers(speed_kmh: float, gain: tuple[float, float], boundary: str) -> None:
    """Superposition to rounding: the response to a sum of two forces is the sum of responses. Masts are linear."""
    rides = []
    for a, b in ((1.0, 0.0), (0.0, 1.0), gain):
        catenary = Catenary(Config(line=FREE, speed=speed_kmh / 3.6, boundary=boundary))
        for k in range(300):
            catenary.step(a * contact_force(k + 300) + b * 50.0 * np.sin(0.05 * k))
        rides.append(catenary.deviation.copy())
    scale = max(np.abs(ride).max() for ride in rides)
    np.testing.assert_allclose(rides[2], gain[0] * rides[0] + gain[1] * rides[1], atol=1e-10 * scale)


def energy(catenary: Catenary) -> float:
    """Energy of the deviation: kinetic, of the wires' stretch, and the potential of droppers, masts and arms, J."""
    frame = catenary.frame
    q, v = catenary.deviation[0].ravel(), catenary.deviation[1].ravel()
    wires = 0.5 * (v @ dense(frame.mass) @ v + q @ dense(frame.stiffness) @ q)
    return float(wires + sum(s.energy(float(s.g @ q)) for s in sites_at(catenary, catenary.track_position)))


def test_energy_balance_of_every_step() -> None:
    """Trapezoidal Newmark without damping, clamped, at rest: the energy grows by the work of the force, step by step.

    Exact, to 1e-11 of the energy, also with slack droppers: their potential goes on as a straight line. Only in a step
    in which a dropper changes its state the trapezoid of its force is not its work: some per cent of the energy in all.
    """
    config = Config(
        line=UNDAMPED,
        spans=1,
        layer_behind=15.0,
        layer_ahead=15.0,
        speed=0.0,
        start_position=22.0,
        boundary="clamped",
        newmark_beta=0.25,
        newmark_gamma=0.5,
        substeps=1,
        local_compliance=False,
        coupling_tolerance=1e-14,
    )
    catenary = Catenary(config)
    f_before, w_before, e_before, slack_before = 0.0, catenary.w_cat, 0.0, set[int]()
    exact, switched, error_of_switches = 0, 0, 0.0
    for k in range(400):
        force = 2.0 * contact_force(k + 200)
        catenary.step(force)
        sites = sites_at(catenary, catenary.track_position)
        q = catenary.deviation[0].ravel()
        slack = {i for i, s in enumerate(sites) if s.one_sided and s.elongation + s.g @ q <= 0.0}
        e = energy(catenary)
        work = 0.5 * (force + f_before) * (catenary.w_cat - w_before)
        if slack == slack_before:
            assert e - e_before == pytest.approx(work, abs=1e-11 * max(e, 1.0))
            exact += bool(slack)
        else:
            switched += 1
            error_of_switches += e - e_before - work
        f_before, w_before, e_before, slack_before = force, catenary.w_cat, e, slack
    assert exact > 50
    assert switched > 5
    assert e_before > 1.0
    assert abs(error_of_switches) < 0.05 * e_before


def test_energy_decays_without_input() -> None:
    """Damping, dissipation of gamma > 1/2 and dashpots only take energy: every sample 0.1 s on is lower.

    The numerical energy of gamma > 1/2 may lag by a percent.
    """
    catenary = Catenary(Config(speed=0.0, start_position=20.0, local_compliance=False))
    for k in range(300):
        catenary.step(40.0 * np.sin(np.pi * k / 300.0))  # small: droppers stay taut
    assert catenary.slack_droppers == 0
    energies = []
    for _ in range(20):
        for _ in range(50):
            catenary.step(0.0)
        energies.append(energy(catenary))
    assert energies[-1] < 0.6 * energies[0]
    assert all(b <= 1.01 * a for a, b in itertools.pairwise(energies))


@pytest.mark.parametrize("boundary", ["matched_dashpot", "viscous_sponge", "clamped"])
@pytest.mark.parametrize("start", [0.0, 30.0])
def test_mirror_symmetry_at_rest(start: float, boundary: str) -> None:
    """Pushed under a mast or in mid-span of a symmetric line, both sides move alike: w even, phi odd, to rounding.

    Slack droppers included. 1e-9: the elimination runs from one end to the other.
    """
    config = Config(
        line=ARMS, speed=0.0, start_position=start, layer_behind=45.0, layer_ahead=45.0, boundary=boundary, spans=2
    )
    catenary = Catenary(config)
    slack = 0
    for k in range(600):
        catenary.step(2.0 * contact_force(k + 400))
        slack += catenary.slack_droppers
    q = catenary.deviation[0]
    mirrored = q[::-1] * np.array([1.0, -1.0])
    assert slack > 100
    np.testing.assert_allclose(q, mirrored, atol=1e-9 * np.abs(q).max())


@settings(max_examples=8, deadline=None)
@given(a=st.floats(-55.0, 55.0), b=st.floats(-55.0, 55.0), line=st.sampled_from(["en50318_2002", "alternating_spans"]))
@pytest.mark.slow
def test_reciprocity_at_rest(a: float, b: float, line: str) -> None:
    """What a push at a does at b, the same push at b does at a, at every instant (small: droppers taut); 1e-9.

    M, D and K are symmetric at v = 0, the dashpots included.
    """
    seen = []
    for pushed, observed in ((a, b), (b, a)):
        catenary = Catenary(Config(line=load_line(line), speed=0.0, start_position=13.0, coupling_tolerance=1e-12))
        w = []
        for k in range(250):
            push_at(catenary, pushed, 20.0 * np.sin(np.pi * k / 50.0) ** 2 if k < 50 else 0.0)
            catenary.step(0.0)
            w.append(look_at(catenary, observed))
            assert catenary.slack_droppers == 0
        seen.append(np.array(w))
    np.testing.assert_allclose(seen[0], seen[1], rtol=0.0, atol=1e-9 * np.abs(seen[0]).max() + 1e-15)


@pytest.mark.parametrize(("gamma", "beta", "order"), [(0.5, 0.25, 2.0), (0.53, 0.16, 1.0), (0.55, 0.28, 1.0)])
@pytest.mark.parametrize("speed_kmh", [0.0, 250.0])
@pytest.mark.slow
def test_order_in_the_time_step(speed_kmh: float, gamma: float, beta: float, order: float) -> None:
    """Halving the step divides the error by 2^order: 2 with gamma = 1/2, else 1; within 0.3 of it.

    Cycles of 4 ms, so the force is the same for all; free wires, as a dropper that switches is not smooth.
    """
    ends = []
    for substeps in (4, 8, 16, 128):
        config = Config(
            line=FREE,
            speed=speed_kmh / 3.6,
            cycle_time=0.004,
            substeps=substeps,
            element_length=3.0,
            newmark_beta=beta,
            newmark_gamma=gamma,
            segment_half_length=9.0,
        )
        catenary = Catenary(config)
        for k in range(100):
            catenary.step(100.0 * np.sin(np.pi * (k + 1) / 100.0) ** 4)
        ends.append(catenary.deviation[0, :, :, 0].copy())
    *coarse, fine = ends
    errors = [np.abs(end - fine).max() for end in coarse]
    measured = np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])
    np.testing.assert_allclose(measured, order, atol=0.3)


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0])
def test_order_in_the_mesh(speed_kmh: float) -> None:
    """Hermite elements on a wire stiff enough to be resolved (sqrt(EI/T) = 1.4 m): order 4 in w, at least 3.5.

    The push is at a node, so the jump of w_xxx under it is no error.
    """
    stiff = Wire(1.35, 0.2, 40e3, 20e3)
    ends = []
    for h in (3.0, 1.5, 0.375):
        config = Config(
            line=Line(carrier=stiff, contact=stiff, spans=(Span(60.0, ()),)),
            speed=speed_kmh / 3.6,
            spans=1,
            layer_behind=36.0,
            layer_ahead=36.0,
            element_length=h,
            substeps=8,
            newmark_beta=0.25,
            newmark_gamma=0.5,
            segment_half_length=9.0,
            local_compliance=False,
        )
        catenary = Catenary(config)
        for k in range(120):
            catenary.step(100.0 * np.sin(np.pi * k / 100.0) ** 4 if k < 100 else 0.0)
        stations = np.flatnonzero(np.isclose(np.mod(catenary.mesh.x + 0.5, 3.0), 0.5))
        ends.append(catenary.deviation[0, stations, 1, 0].copy())
    coarse, middle, fine = ends
    errors = [np.abs(end - fine).max() for end in (coarse, middle)]
    assert errors[0] < 0.1 * np.abs(fine).max()
    assert np.log2(errors[0] / errors[1]) > 3.5


def test_an_external_load_outlives_a_reset_as_an_array() -> None:
    """A reset takes the load away; who has kept the array may write into it again."""
    catenary = Catenary(Config(spans=2))
    load = catenary.external_load
    load[catenary.mesh.middle, 1, 0] = 100.0
    catenary.step(0.0)
    pushed = catenary.w_cat
    catenary.reset()
    catenary.step(0.0)
    assert abs(pushed - catenary.w_cat) > 1e-5
    catenary.reset()
    load[catenary.mesh.middle, 1, 0] = 100.0
    catenary.step(0.0)
    assert catenary.w_cat == pushed
