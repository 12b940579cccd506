"""The compiled step against a plain dense one, and how the model behaves: rest, long rides, wrong settings."""

import dataclasses
import doctest

import numpy as np
import pytest
from dense_step import DenseStep
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model import boundary, layout, model, sites
from catenary_model.boundary import Feedback, Layer
from catenary_model.line import Dropper, Line, Mast, PointMass, Span, SteadyArm
from catenary_model.line_file import load_line, preset_names
from catenary_model.model import Catenary, Config
from catenary_model.moving_frame import MovingFrame

TS = 0.002

SHORT = Line(
    spans=(
        Span(20.0, tuple(Dropper(x) for x in (4.0, 10.0, 16.0)), mast=Mast(encumbrance=0.6)),
        Span(25.0, tuple(Dropper(x) for x in (4.0, 12.0, 21.0)), mast=Mast(2e5, 0.6), steady_arm=SteadyArm(2e3)),
    )
)
"""Two short uneven spans, so that a dense matrix is small and much passes in little time."""
SMALL = Config(
    line=SHORT,
    spans=1,
    element_length=1.0,
    layer_behind=10.0,
    layer_ahead=20.0,
    fading_length=10.0,
    segment_half_length=5.0,
    local_compliance=False,
    coupling_tolerance=1e-14,
)


def contact_force(k: int) -> float:
    """A force like that of a pantograph at 250 km/h: softly begun, span and dropper passing."""
    t = k * TS
    return min(1.0, t) * (120.0 + 30.0 * np.sin(2 * np.pi * 1.16 * t) + 12.0 * np.sin(2 * np.pi * 10.7 * t))


def difference(config: Config, cycles: int = 150, gain: float = 2.0) -> tuple[float, int]:
    """Largest deviation between kernel and dense step over the largest deviation, and the slack dropper-cycles seen."""
    catenary = Catenary(config)
    reference = DenseStep(catenary)
    slack = 0
    for k in range(cycles):
        force = gain * contact_force(k + 300)
        catenary.step(force)
        reference.cycle(force)
        slack += catenary.slack_droppers
        assert catenary.slack_droppers == reference.slack
    scale = np.abs(reference.q).max()
    assert scale > 0.01
    worst = np.abs(catenary.deviation[0].ravel() - reference.q).max() / scale
    speed = np.abs(catenary.deviation[1].ravel() - reference.v).max() / np.abs(reference.v).max()
    return max(worst, speed), slack


def pushed_everywhere(frame: MovingFrame, layer: Layer) -> Feedback:
    """A boundary with a gain of its own size for either wire and end: without meaning, small enough to be stable."""
    random = np.random.default_rng(1)
    boundary.BOUNDARIES["matched_dashpot"](frame, layer)
    scale = np.repeat([3.0, 0.03, 3e-4], 2)
    gain = [
        random.normal(size=(2 * inputs, 6 * states)) * np.repeat(scale, states)
        for inputs, states in ((1, 3), (2, 4), (3, 2), (2, 5))
    ]
    return Feedback(((gain[0], gain[1]), (gain[2], gain[3])))


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({}, id="half steps"),
        pytest.param({"substeps": 1, "newmark_beta": 0.28, "newmark_gamma": 0.55}, id="whole steps"),
        pytest.param({"substeps": 3, "start_position": -7.3}, id="thirds, from before the line's zero"),
        pytest.param({"boundary": "clamped"}, id="clamped"),
        pytest.param({"local_compliance": True}, id="local compliance"),
        pytest.param({"boundary": "pushed"}, id="state feedback"),
        pytest.param({"speed": 0.0}, id="standing"),
        pytest.param({"fading_length": 0.0}, id="no fading"),
    ],
)
def test_kernel_equals_dense_reference(changes: dict[str, object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Rounding only, 1e-9: droppers slack and taut in turn, droppers, masts and arms passing both ends.

    The kernel leaves out what sites do to each other below `coupling_tolerance`, here as good as nothing.
    """
    monkeypatch.setitem(boundary.BOUNDARIES, "pushed", pushed_everywhere)
    error, slack = difference(dataclasses.replace(SMALL, **changes))  # type: ignore[arg-type]
    assert slack > 10
    assert error < 1e-9


@pytest.mark.slow
def test_kernel_with_given_lengths_equals_dense_reference() -> None:
    """One dropper 1 cm too long, far more than it is stretched: slack at rest."""
    rest = Catenary(SMALL).statics
    lengths = rest.dropper_lengths.copy()
    lengths[1] += 0.01
    given = iter(lengths)
    spans = tuple(
        dataclasses.replace(span, droppers=tuple(dataclasses.replace(d, length=next(given)) for d in span.droppers))
        for span in SHORT.spans
    )
    error, slack = difference(dataclasses.replace(SMALL, line=dataclasses.replace(SHORT, spans=spans)))
    assert slack > 100
    assert error < 1e-9


@pytest.mark.slow
def test_kernel_with_masses_equals_dense_reference() -> None:
    """Droppers and arms with mass that run through the mesh and in and out at the ends: rounding only, 1e-9.

    The start is such that no mass stands exactly on a node, where the curvature that it follows jumps.
    """
    spans = tuple(
        dataclasses.replace(
            span,
            droppers=tuple(dataclasses.replace(d, mass=0.6, contact_clamp=0.2) for d in span.droppers),
            masses=(PointMass(7.0, "contact", 1.5), PointMass(13.0, "carrier", 3.0)),
            steady_arm=SteadyArm(500.0, 1.5),
        )
        for span in SHORT.spans
    )
    line = dataclasses.replace(SHORT, spans=spans)
    heavy = dataclasses.replace(SMALL, line=line, local_compliance=True, start_position=0.0137)
    error, _ = difference(heavy)
    assert error < 1e-9


@pytest.mark.slow
def test_what_the_default_leaves_out_between_sites_is_small() -> None:
    """Default tolerance 1e-3: within 1e-4 of the dense step (measured 1e-5), and the slack states agree."""
    error, slack = difference(dataclasses.replace(SMALL, coupling_tolerance=Config().coupling_tolerance))
    assert slack > 50
    assert error < 1e-4


@pytest.mark.slow
def test_rest_without_contact_force_is_exact_at_speed() -> None:
    """20 s at 250 km/h: no deviation at all, so the wire under the pantograph is the static one."""
    catenary = Catenary(Config())
    worst = 0.0
    for _ in range(10_000):
        catenary.step(0.0)
        expected = catenary.statics.contact(np.array([catenary.track_position]))[0]
        worst = max(worst, abs(catenary.w_cat - expected))
    assert np.abs(catenary.deviation).max() <= 1e-12
    assert worst < 2e-4  # the mesh's own rounding of the kinks at clamps, see lattice
    assert catenary.track_position == pytest.approx(10_000 * TS * 250 / 3.6, rel=1e-12)


def test_static_shape_moves_past_the_pantograph() -> None:
    """v_cat and a_cat are the derivatives of w_cat along the static shape: central differences over 2 steps.

    The curvature jumps where a clamp passes a node of the mesh; a difference across the jump is off by half of it.
    """
    catenary = Catenary(Config(speed=20.0, cycle_time=0.0005))
    rows = []
    for _ in range(4000):
        catenary.step(0.0)
        rows.append((catenary.w_cat, catenary.v_cat, catenary.a_cat))
    w, v, a = np.array(rows).T
    assert w.min() < -7e-3
    np.testing.assert_allclose((w[2:] - w[:-2]) / 0.001, v[1:-1], atol=1e-2 * np.abs(v).max())
    error = np.abs((v[2:] - v[:-2]) / 0.001 - a[1:-1])
    assert np.quantile(error, 0.97) < 0.01 * np.abs(a).max()
    assert error.max() < 0.6 * np.abs(a).max()


@pytest.mark.parametrize("speed_kmh", [0.0, 250.0, 320.0])
@pytest.mark.slow
def test_long_ride_stays_bounded(speed_kmh: float) -> None:
    catenary = Catenary(Config(speed=speed_kmh / 3.6))
    w = np.zeros(6000)
    for k in range(6000):
        catenary.step(contact_force(k))
        w[k] = catenary.w_cat
    assert np.isfinite(w).all()
    assert np.abs(w[3000:]).max() < 0.2
    # no growth: second half of the ride against the first, span passing allows 20 %
    assert np.ptp(w[4500:]) < 1.2 * np.ptp(w[2000:4500]) + 1e-3
    assert catenary.unsettled_steps == 0
    length = catenary.mesh.behind + catenary.mesh.ahead
    assert abs(catenary.droppers - 9 * length / 60.0) < 2


@pytest.mark.parametrize("name", [name for name in preset_names() if not load_line(name).stitched])
@pytest.mark.parametrize("speed_kmh", [0.0, 250.0])
@pytest.mark.slow
def test_every_preset_rides_and_comes_to_rest(name: str, speed_kmh: float) -> None:
    """2 s of contact with the default settings move the wires by less than 0.2 m; 10 s later 20 mm of it are left.

    What is left is trapped between masts and decays by the wires' damping alone; running on, the train leaves it behind
    (measured: 0.5 mm at 250 km/h, 5 to 12 mm at rest). No drift: 5 s more, and it is less.
    """
    catenary = Catenary(Config(line=load_line(name), speed=speed_kmh / 3.6, start_position=17.0))
    highest = 0.0
    for k in range(1000):
        catenary.step(contact_force(k))
        highest = max(highest, float(np.abs(catenary.deviation[0, :, :, 0]).max()))
    assert 0.01 < highest < 0.2
    left = []
    for _ in range(2):
        motion = np.zeros(1250)
        for k in range(6250):
            catenary.step(0.0)
            if k >= 5000:
                motion[k - 5000] = np.abs(catenary.deviation[0, :, :, 0]).max()
        left.append(motion.max())
    assert left[0] < 20e-3
    assert left[1] < 0.8 * left[0]
    assert catenary.unsettled_steps == 0


def test_slack_state_is_consistent_after_every_step() -> None:
    """A dropper is taut exactly when it is longer than unstressed, give or take the rounding of 1e-12 m.

    With local compliance the clamps have moved a little further than the mesh knows: by L F_s in favour of a slack one.
    """
    catenary = Catenary(Config(cycle_time=0.001, substeps=1))
    s, c = catenary.state, catenary.constants
    seen = 0
    for k in range(1500):
        catenary.step(2.0 * contact_force(k + 500))
        for i in range(s.counter[layout.SITES]):
            row = s.where[layout.ROW, i]
            if row < 0 or not c.site[row, layout.ONE_SIDED]:
                continue
            stretch = c.site[row, layout.ELONGATION] + sites.elongation(i, s.here, s.where, s.psi, s.q[0])
            stretch += s.here[layout.LOCAL, i] * c.site[row, layout.FORCE]
            taut = s.taut[s.where[layout.SLOT, i]] == 1
            # what sites far apart do to each other is left out: 1e-3 of some micrometres
            assert taut == (stretch > 0.0) or abs(stretch) < 1e-8
            seen += not taut
    assert seen > 100


def test_example_in_the_documentation() -> None:
    assert doctest.testmod(model).failed == 0


def test_too_few_iterations_are_counted() -> None:
    catenary = Catenary(Config(max_slack_iterations=1))
    for k in range(1500):
        catenary.step(2.0 * contact_force(k + 500))
    assert catenary.iterations == 1
    assert catenary.unsettled_steps > 0


@pytest.mark.parametrize("start", [6e5, -6e3])
def test_the_line_is_endless(start: float) -> None:
    """10 000 spans on, or behind zero, all is the same but for the rounding of positions (1e-10 m), 1e-6."""
    here, there = Catenary(Config()), Catenary(Config(start_position=start))
    for k in range(2000):
        here.step(contact_force(k + 500))
        there.step(contact_force(k + 500))
    assert there.slack_droppers == here.slack_droppers
    np.testing.assert_allclose(there.deviation[0], here.deviation[0], atol=1e-6 * np.abs(here.deviation[0]).max())


def test_wire_shape_shows_the_line_at_rest() -> None:
    catenary = Catenary(Config(start_position=17.3, layer_behind=0.0, layer_ahead=0.0))
    view, rest = catenary.wire_shape(), catenary.statics
    zeta = 17.3 + view.x.astype(np.float64)
    np.testing.assert_allclose(view.contact, rest.contact(zeta), atol=2e-4)  # mesh at clamps, see lattice
    np.testing.assert_allclose(view.carrier, rest.carrier(zeta), atol=5e-4)  # steep: a row of its table is 0.1 m long
    np.testing.assert_allclose(view.mast_x, [-17.3, 42.7], atol=1e-5)
    assert view.dropper_x.size == catenary.droppers == 18
    np.testing.assert_allclose(np.sort(view.dropper_force), np.sort(np.tile(rest.dropper_forces, 2)), rtol=1e-5)


@given(st.lists(st.floats(-50.0, 400.0), min_size=50, max_size=50))
@settings(max_examples=5, deadline=None)
def test_two_rides_are_equal_to_the_last_bit(forces: list[float]) -> None:
    first, second = Catenary(Config()), Catenary(Config())
    for _ in range(77):
        second.step(200.0)
    second.reset()
    for force in forces:
        first.step(force)
        second.step(force)
    for mine, other in zip(first.state, second.state, strict=True):
        np.testing.assert_array_equal(mine, other)


def test_steady_arm_holds_the_contact_wire() -> None:
    """A stiff arm at the mast above the standing pantograph: the wire gives way less."""
    heights = []
    for stiffness in (0.0, 5e3):
        span = dataclasses.replace(Line().spans[0], steady_arm=SteadyArm(stiffness))
        catenary = Catenary(Config(line=Line(spans=(span,)), speed=0.0))
        for k in range(3000):
            catenary.step(100.0 * min(1.0, k / 1000))
        heights.append(catenary.w_cat - catenary.statics.contact(np.zeros(1))[0])
    assert heights[1] < 0.75 * heights[0]
    # what the arm takes is missing to the rest: 100 N = k_rest w + k_arm w
    assert heights[1] == pytest.approx(100.0 / (100.0 / heights[0] + 5e3), rel=0.15)


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"cycle_time": 0.0}, "cycle_time"),
        ({"substeps": 0}, "substeps"),
        ({"spans": 0}, "spans"),
        ({"element_length": -1.0}, "element_length"),
        ({"speed": 130.0}, "speed"),
        ({"speed": -1.0}, "speed"),
        ({"start_position": float("nan")}, "start_position"),
        ({"newmark_beta": 0.0}, "newmark_beta"),
        ({"newmark_gamma": 0.4}, "newmark_gamma"),
        ({"fading_length": 500.0}, "fading_length"),
        ({"layer_behind": -1.0}, "layer_behind"),
        ({"layer_ahead": float("inf")}, "layer_ahead"),
        ({"boundary": "brick wall"}, "boundary"),
        ({"segment_half_length": 500.0}, "segment_half_length"),
        ({"max_slack_iterations": 0}, "max_slack_iterations"),
        ({"element_length": 60.0}, "element_length"),
    ],
)
def test_bad_configurations_are_refused_by_name(changes: dict[str, object], names: str) -> None:
    with pytest.raises(ValueError, match=names):
        Catenary(dataclasses.replace(Config(), **changes))
