"""The whole catenary by finite differences: rest, superposition, repetition, rides, and what is refused."""

import dataclasses

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from catenary_model import model
from catenary_model.build import Config, MovingCatenary, build, check
from catenary_model.finite_difference import Catenary, ends
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm
from catenary_model.line_file import load_line
from catenary_model.pantograph import Pantograph
from catenary_model.reduced import discretise
from catenary_model.ride import Coupled, push, ride
from test_rig_sim.pantographs import PANTOGRAPHS

TS = 0.002


def setting(**changes: object) -> Config:
    """Finite differences with ends that need no design."""
    base = Config(discretisation="fd", grid_boundary="one_way", start_position=30.0)
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


def force(k: int) -> float:
    t = k * TS
    return min(1.0, t) * (120.0 + 30.0 * np.sin(2 * np.pi * 1.16 * t) + 12.0 * np.sin(2 * np.pi * 10.7 * t))


def rider() -> Pantograph:
    chain = PANTOGRAPHS["en50318"]()
    return Pantograph.of(chain.mass, chain.damping, chain.stiffness, 120.0)


@pytest.mark.parametrize("line", ["en50318_2002", "pre_sag_steady_arm", "alternating_spans"])
@pytest.mark.parametrize("speed_kmh", [0.0, 320.0])
@pytest.mark.slow
def test_at_rest_it_stays_at_rest(line: str, speed_kmh: float) -> None:
    """Without contact force the deviation is exactly zero, whatever moves through the domain."""
    catenary = Catenary(setting(line=load_line(line), speed=speed_kmh / 3.6))
    for _ in range(400):
        catenary.step(0.0)
    assert not catenary.deviation.any()
    assert catenary.work == catenary.impulse == 0.0
    static = float(catenary.statics.contact(np.array([catenary.track_position]))[0])
    # within an element of a clamp the grid rounds the kink
    assert catenary.w_cat == pytest.approx(static, abs=3e-5)


@settings(max_examples=5, deadline=None, phases=(Phase.generate,))
@given(
    speed_kmh=st.floats(0.0, 330.0, allow_subnormal=False),
    gain=st.tuples(st.floats(-3.0, 3.0, allow_subnormal=False), st.floats(-3.0, 3.0, allow_subnormal=False)),
)
@pytest.mark.slow
def test_linear_with_linear_droppers(speed_kmh: float, gain: tuple[float, float]) -> None:
    """Linear and time-varying: the response to a sum of two forces is the sum of the responses, to rounding."""
    rides = []
    for a, b in ((1.0, 0.0), (0.0, 1.0), gain):
        catenary = Catenary(setting(speed=speed_kmh / 3.6, one_sided_droppers=False))
        for k in range(250):
            catenary.step(a * 3.0 * force(k + 300) + b * 150.0 * np.sin(0.05 * k))
        rides.append(catenary.deviation.copy())
    scale = np.abs(rides[:2]).max(axis=(0, 2, 3), keepdims=True)[0]
    assert (np.abs(rides[2] - gain[0] * rides[0] - gain[1] * rides[1]) <= 1e-9 * scale).all()


@pytest.mark.slow
def test_both_discretisations_know_linear_droppers() -> None:
    """A push that slackens droppers, 0.8 s: linear ones hold the wire down by some mm, in either discretisation alike.

    2 % of the displacement for different meshes; nothing is slack.
    """
    lift: dict[tuple[str, bool], np.ndarray] = {}
    for kind in ("fe", "fd"):
        for one_sided in (True, False):
            base = setting() if kind == "fd" else Config(start_position=30.0)
            catenary = build(dataclasses.replace(base, one_sided_droppers=one_sided))
            slack, w = 0, []
            for k in range(400):
                catenary.step(1.5 * force(k + 200))
                slack += catenary.slack_droppers
                w.append(catenary.w_cat)
            assert (slack > 0) == one_sided
            lift[kind, one_sided] = np.array(w)
        assert np.abs(lift[kind, True] - lift[kind, False]).max() > 2e-3
    for one_sided in (True, False):
        assert np.abs(lift["fd", one_sided] - lift["fe", one_sided]).max() < 0.02 * lift["fe", one_sided].max()


@pytest.mark.slow
def test_two_rides_and_a_reset_give_the_same_bits() -> None:
    first, second = Catenary(setting(line=load_line("pre_sag_steady_arm"))), None
    for k in range(300):
        first.step(force(k))
    state = [np.array(array) for array in first.state]
    first.step(50.0)
    first.reset()
    second = Catenary(first.config)
    for catenary in (first, second):
        for k in range(300):
            catenary.step(force(k))
        for mine, other in zip(catenary.state, state, strict=True):
            np.testing.assert_array_equal(mine, other)


@pytest.mark.parametrize("speed_kmh", [160.0, 250.0])
@pytest.mark.slow
def test_a_ride_agrees_with_the_finite_elements(speed_kmh: float) -> None:
    """Same pantograph, 5 s, the last 2 s: displacement to 2 % of its deviation, mean force to 0.3 N.

    The finite elements themselves are about 1.5 % off the reference (0.18 of 12 mm), these 1 %.
    """
    records = []
    for config in (Config(start_position=30.0, speed=speed_kmh / 3.6), setting(speed=speed_kmh / 3.6)):
        catenary = build(config)
        record = ride(catenary, rider(), 5.0)
        assert record.F.min() >= 0.0
        records.append((record.w[1500:], record.F[1500:], catenary))
    (w, F, fe), (w_fd, F_fd, fd) = records
    assert np.sqrt(np.mean((w_fd - w) ** 2)) < 0.02 * w.std()
    assert F_fd.mean() == pytest.approx(F.mean(), abs=0.3)
    assert (fd.cycle, fd.track_position) == (fe.cycle, fe.track_position)
    assert fd.droppers == pytest.approx(fe.droppers, abs=2)
    np.testing.assert_array_equal(fd.reduced.x, fe.reduced.x)
    # the controller's segment: the elements' nodes move alike
    assert np.abs(fd.segment_displacement[::2] - fe.segment_displacement[::2]).max() < 2e-3
    assert np.abs(fd.segment_displacement[1::2] - fe.segment_displacement[1::2]).max() < 2e-3
    shape, other = fd.wire_shape(), fe.wire_shape()
    inside = (other.x > other.x[0] + 3.0) & (other.x < other.x[-1] - 3.0)  # the ends are of different kinds
    for mine, its in ((shape.contact, other.contact), (shape.carrier, other.carrier)):
        np.testing.assert_allclose(np.interp(other.x, shape.x, mine)[inside], its[inside], atol=3e-3)
    np.testing.assert_allclose(shape.mast_x, other.mast_x[other.mast_x < 215.0], atol=1e-4)


def test_held_forces_make_the_reduced_model_predict_a_cycle() -> None:
    """(3.41) from the grid's state: one cycle ahead to 0.03 mm rms where the wire moves 0.3 mm, 10 to 0.6 mm of 3.

    What waves too short for the elements do is left; the point values of the grid in place of the projection would
    give four times as much after five cycles.
    """
    catenary = Catenary(setting())
    A, B, H = discretise(catenary.reduced, TS)
    n, b, dC = catenary.reduced.n, catenary.reduced.b, catenary.local_compliance
    error: dict[int, list[float]] = {1: [], 5: []}
    way: dict[int, list[float]] = {1: [], 5: []}
    waiting: list[tuple[int, int, float, float]] = []
    for k in range(900):
        catenary.step(force(k))
        for _, ahead, expected, w in [entry for entry in waiting if entry[0] == k]:
            error[ahead].append(catenary.w_cat - expected)
            way[ahead].append(catenary.w_cat - w)
        waiting = [entry for entry in waiting if entry[0] > k]
        if k > 500 and k % 3 == 0:
            q, v, a, held = (np.array(row) for row in catenary.state.segment)
            bias = catenary.w_cat - b @ q - dC * force(k)
            x = np.concatenate((q, v, a))
            for ahead in range(1, 6):
                x = A @ x + B * force(k + ahead) + H @ held
                if ahead in error:
                    w = float(b @ x[:n] + dC * force(k + ahead) + bias)
                    waiting.append((k + ahead, ahead, w, catenary.w_cat))
    rms = {ahead: float(np.sqrt(np.mean(np.square(error[ahead])))) for ahead in error}
    moved = {ahead: float(np.sqrt(np.mean(np.square(way[ahead])))) for ahead in error}
    assert rms[1] < 3e-5 < 0.2 * moved[1]
    assert rms[5] < 1.2e-4 < 0.2 * moved[5]


def test_work_with_one_step_a_cycle_is_force_over_way() -> None:
    """One trapezoid a cycle, from outside and from inside: equal to rounding."""
    catenary = Catenary(setting(cycle_time=0.001, grid_substeps=1))
    work = impulse = before = 0.0
    for k in range(1, 500):
        w, now = catenary.w_cat, force(k)
        catenary.step(now)
        work += 0.5 * (before + now) * (catenary.w_cat - w)
        impulse += 0.5 * 0.001 * (before + now)
        before = now
    assert catenary.work == pytest.approx(work, rel=1e-10)
    assert catenary.impulse == pytest.approx(impulse, rel=1e-10)


@pytest.mark.slow
def test_coupling_and_pushing_are_the_same_wire() -> None:
    """A ride's contact force, pushed again cycle by cycle: the same but for the force within a cycle; 0.02 mm."""
    catenary: MovingCatenary = Catenary(setting())
    train = Coupled(catenary, rider(), 0.5)
    ridden = train.go_on(800)
    assert ridden.F[-1] > 0.0
    assert catenary.f_cat == ridden.F[-1]
    again = Catenary(setting())
    pushed = push(again, ridden.F)
    assert np.abs(pushed.w - ridden.w).max() < 2e-5
    assert again.work == pytest.approx(catenary.work, rel=0.02)
    held = train.go_on(50, 90.0)
    np.testing.assert_array_equal(held.F, 90.0)


def test_no_force_acts_where_the_boundary_stencils_read() -> None:
    """A stencil takes what it reads for free wire; a dropper there made the ends of a ride grow within 10 s."""
    catenary = Catenary(setting(fading_length=0.0))
    push(catenary, np.full(200, 100.0))
    x = catenary.state.here[0, : catenary.state.counter[3]]
    read = catenary.mesh.h * catenary.constants.edge.shape[3]
    assert -catenary.mesh.behind + read < x.min() < x.max() < catenary.mesh.ahead - read
    assert catenary.droppers > 40


def with_span(**changes: object) -> Line:
    span = dataclasses.replace(Line().spans[0], **changes)  # type: ignore[arg-type]
    return Line(spans=(span,))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"discretisation": "spectral"}, "discretisation = 'spectral' must be one of fe, fd"),
        ({"grid_boundary": "dashpot"}, "grid_boundary = 'dashpot' must be one of absorbing, one_way, clamped"),
        ({"boundary": "controlled"}, "boundary = controlled belongs to discretisation 'fe'"),
        ({"newmark_gamma": 0.6}, "newmark_gamma = 0.6 belongs to discretisation 'fe'"),
        ({"substeps": 4}, "substeps = 4 belongs to discretisation 'fe'"),
        ({"grid_substeps": 1}, r"cycle_time / grid_substeps = 2 ms, grid_spacing = 0.25 m: .*unstable"),
        ({"grid_reach": 1}, "grid_reach = 1 must be at least 2"),
        ({"grid_spacing": 0.0}, "grid_spacing = 0.0 must be finite and above 0"),
        ({"element_length": 0.2}, "element_length = 0.2 m, the controller's, is below grid_spacing"),
        ({"speed": 120.0}, "exceeds 95 % of the"),
        ({"segment_half_length": 134.0}, "segment_half_length = 134.0 m exceeds"),
        ({"line": with_span(mast=Mast(stiffness=2e6))}, r"spans\[0\].mast.stiffness.*choose more grid_substeps"),
        ({"line": with_span(steady_arm=SteadyArm(2e6))}, r"spans\[0\].steady_arm.stiffness"),
        ({"line": Line(spans=(Span(60.0, (Dropper(30.0, 1e6),)),))}, r"spans\[0\].droppers\[0\].stiffness"),
    ],
)
def test_bad_settings_are_refused_by_name(changes: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check(setting(**changes))


def test_what_belongs_to_the_grid_is_refused_with_elements() -> None:
    with pytest.raises(ValueError, match=r"grid_spacing = 0\.5 belongs to discretisation 'fd'"):
        Config(grid_spacing=0.5)
    with pytest.raises(ValueError, match="must be 'fd'"):
        Catenary(Config())
    assert isinstance(build(Config()), model.Catenary)


def test_ends_that_would_grow_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pair that passes its own design but not the two-sided check: the message names parameters and the factor."""
    config = setting(speed=0.0)
    catenary = Catenary(config)
    left, right = catenary.ends[1]
    loud = dataclasses.replace(left, coefficients=1.05 * left.coefficients)
    monkeypatch.setitem(ends.ENDS, "one_way", lambda *_: (loud, right))
    with pytest.raises(ValueError, match=r"grid_boundary = 'one_way' at speed = 0 m/s.*grows by a factor of 1\.0"):
        ends.design(config, config.line.contact, catenary.stencils[1])


def test_very_stiff_masts_at_the_limit_stay_stable() -> None:
    """Just below the stiffness that is refused, moving through the grid: nothing grows in 4 s without a force."""
    with pytest.raises(ValueError, match="at most") as refused:
        check(setting(line=with_span(mast=Mast(stiffness=1e8))))
    most = float(str(refused.value).split("at most ")[1].split(" N/m")[0])
    catenary = Catenary(setting(line=with_span(mast=Mast(stiffness=0.99 * most))))
    push(catenary, np.array([force(k) for k in range(1000)]))
    lively = np.abs(catenary.deviation[1]).max()
    push(catenary, np.zeros(2000))
    assert np.abs(catenary.deviation[1]).max() < 0.3 * lively
