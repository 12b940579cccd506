"""Static equilibrium against closed forms, and as laws."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from odd_lines import uneven_line, with_lengths

from catenary_model import statics
from catenary_model.line import DROPPERS_3_1, Dropper, Line, Mast, PointMass, Span, SteadyArm, Wire
from catenary_model.statics import DROPPER, MAST, POINT_MASS, STEADY_ARM, Statics, StaticsError
from catenary_model.stiffness import PushedLine

Array = NDArray[np.float64]

REST = statics.solve(Line())
AT = np.array(DROPPERS_3_1)
SPAN = Line().spans[0]


# ---- closed forms -------------------------------------------------------------------------------------------------


def test_dropper_forces_of_table_3_1() -> None:
    # half of each neighbouring gap: 7.75 m at the outer droppers, 6 m at the second ones
    weight = 1.35 * 9.81
    assert REST.dropper_forces.max() == pytest.approx(weight * 7.75, rel=0.01)
    assert REST.dropper_forces.min() == pytest.approx(weight * 6.0, rel=0.01)
    assert REST.dropper_forces.sum() == pytest.approx(weight * 60.0, rel=1e-12)


def test_unstressed_lengths_of_table_3_1() -> None:
    # values of an independent prototype, printed to the millimetre, for this encumbrance
    line = Line(spans=(dataclasses.replace(SPAN, mast=Mast(encumbrance=1.0565)),))
    lengths = statics.solve(line).dropper_lengths
    np.testing.assert_allclose(lengths[:5], [0.845, 0.663, 0.507, 0.413, 0.381], atol=0.001)
    np.testing.assert_allclose(lengths, lengths[::-1], atol=1e-9)


def test_contact_wire_is_level_at_clamps_and_sags_between() -> None:
    np.testing.assert_allclose(REST.contact(AT), 0.0, atol=1e-12)
    # string between clamps: rhoA g L^2 / (8 T) = 8.28 mm over 10 m, 3.50 mm over 6.5 m; bending takes up to 8 % off
    assert REST.contact(np.array([0.0]))[0] == pytest.approx(-1.35 * 9.81 * 10**2 / (8 * 20e3), rel=0.05)
    assert REST.contact(np.array([26.75]))[0] == pytest.approx(-1.35 * 9.81 * 6.5**2 / (8 * 20e3), rel=0.08)


def test_carrier_alone_hangs_as_parabolas_from_mast_to_mast() -> None:
    """Without droppers and nearly without bending: rhoA g s (L - s)/(2 T) below the chord.

    Bending lifts by lambda R/(2 T) at a mast, 6 nanometres here.
    """
    carrier = Wire(1.07, 0.6, 1e-9, 16e3)
    line = Line(carrier, spans=(Span(60.0, (), mast=Mast(encumbrance=1.2)), Span(45.0, (), mast=Mast(encumbrance=1.5))))
    rest = statics.solve(line)
    s = np.linspace(0.0, 1.0, 23)
    sag = 1.07 * 9.81 / (2 * 16e3)
    np.testing.assert_allclose(rest.carrier(60 * s), 1.2 + 0.3 * s - sag * 60**2 * s * (1 - s), atol=1e-8)
    np.testing.assert_allclose(rest.carrier(60 + 45 * s), 1.5 - 0.3 * s - sag * 45**2 * s * (1 - s), atol=1e-8)
    # a mast carries half of either span, and what the kink of the chord adds
    kink = 16e3 * (0.3 / 60 + 0.3 / 45)
    weight = 1.07 * 9.81 * 52.5
    np.testing.assert_allclose(rest.sites.force, [weight - kink, weight + kink], rtol=1e-6)
    assert not rest.contact(s).any()


def test_carrier_passes_the_masts_and_carries_everything() -> None:
    assert REST.carrier(np.array([0.0, 60.0, -120.0])) == pytest.approx(1.05, abs=1e-12)
    # parabola of the spread weight of both wires: q L^2 / (8 T) = 0.667 m, droppers as points change it by 2 %
    sag = 1.05 - REST.carrier(np.array([30.0]))[0]
    assert sag == pytest.approx((1.07 + 1.35) * 9.81 * 60**2 / (8 * 16e3), rel=0.02)
    assert REST.sites.force[0] == pytest.approx((1.07 + 1.35) * 9.81 * 60, rel=1e-12)


def test_every_mast_has_its_encumbrance() -> None:
    rest = statics.solve(uneven_line())
    np.testing.assert_allclose(rest.carrier(np.array([0.0, 50.0, 110.0, 153.5])), [1.4, 1.3, 1.5, 1.4], atol=1e-12)


def test_pre_sag_is_met_span_by_span() -> None:
    line = uneven_line()
    rest = statics.solve(line)
    clamps = iter(rest.contact(rest.dropper_positions))
    for span in line.spans:
        for dropper in span.droppers:
            s = dropper.position / span.length
            assert next(clamps) == pytest.approx(-4 * span.pre_sag * s * (1 - s), abs=1e-12)


def test_slope_is_the_derivative_of_the_shape() -> None:
    for rest in (REST, statics.solve(uneven_line())):
        zeta, d = np.linspace(-170.0, 230.0, 777), 1e-5
        numeric = (rest.contact(zeta + d) - rest.contact(zeta - d)) / (2 * d)
        np.testing.assert_allclose(rest.contact_beam.slope(zeta), numeric, atol=1e-8)


# ---- droppers as they are built -----------------------------------------------------------------------------------

ROPE = {"axial_stiffness": 2e5, "mass_per_length": 0.117, "carrier_clamp": 0.195, "contact_clamp": 0.165}


def roped(at: float, **change: float) -> Dropper:
    return Dropper(at, **{**ROPE, **change})  # type: ignore[arg-type]


def test_clamps_hang_at_their_own_sags() -> None:
    sags = (0.0, 0.012, 0.03, 0.041, 0.044, 0.041, 0.03, 0.012, -0.002)
    span = Span(60.0, tuple(roped(at, sag=sag) for at, sag in zip(AT, sags, strict=True)), 0.3)
    rest = statics.solve(Line(spans=(span,)))
    np.testing.assert_allclose(rest.contact(AT), [-sag for sag in sags], atol=1e-12)


def test_parabola_from_the_first_dropper_to_the_last() -> None:
    span = Span(
        60.0, tuple(Dropper(at) for at in (5.0, 15.0, 32.5, 50.0, 60.0 - 1e-3)), 0.05, pre_sag_from="first_dropper"
    )
    last = span.droppers[-1].position
    wanted = [span.clamp_height(dropper) for dropper in span.droppers]
    assert (wanted[0], wanted[-1]) == (0.0, 0.0)
    s = (15.0 - 5.0) / (last - 5.0)
    assert wanted[1] == pytest.approx(-4 * 0.05 * s * (1 - s), rel=1e-12)
    assert Span(60.0, (Dropper(30.0),), 0.05, pre_sag_from="first_dropper").clamp_height(Dropper(30.0)) == -0.05


def test_ropes_are_cut_to_the_lengths_that_come_out() -> None:
    """k_d = EA/l_0, rope and clamps hang on either wire: all three hold to rounding once the lengths have settled."""
    line = Line(spans=(dataclasses.replace(SPAN, droppers=tuple(map(roped, DROPPERS_3_1)), pre_sag=0.03),))
    rest = statics.solve(line)
    sites, drop = rest.sites, rest.sites.kind == DROPPER
    assert rest.line is line
    np.testing.assert_allclose(sites.stiffness[drop], 2e5 / rest.dropper_lengths, rtol=1e-12)
    np.testing.assert_allclose(sites.carrier_mass[drop], 0.195 + 0.0585 * rest.dropper_lengths, rtol=1e-12)
    np.testing.assert_allclose(sites.contact_mass[drop], 0.165 + 0.0585 * rest.dropper_lengths, rtol=1e-12)
    weight = 1.35 * 60.0 + sites.contact_mass[drop].sum()
    assert rest.dropper_forces.sum() == pytest.approx(9.81 * weight, rel=1e-12)
    # the same line with stiffness and masses written down for every dropper
    written = statics.built(line)
    assert not any(dropper.needs_length for dropper in written.spans[0].droppers)
    same = statics.solve(written)
    np.testing.assert_allclose(same.dropper_lengths, rest.dropper_lengths, atol=1e-12)
    np.testing.assert_allclose(same.dropper_forces, rest.dropper_forces, rtol=1e-9)
    # and the line that was cut to these lengths hangs where they were computed for
    hung = statics.solve(with_lengths(line, rest.dropper_lengths))
    np.testing.assert_allclose(hung.contact(AT), rest.contact(AT), atol=1e-9)


def test_a_line_without_ropes_is_built_as_it_is() -> None:
    line = uneven_line()
    assert statics.built(line) is line


# ---- point masses -------------------------------------------------------------------------------------------------


def test_point_masses_hang_on_their_wires() -> None:
    """Weights are carried to the last newton; a mass in mid-gap bends the wire by what a string says, less bending."""
    masses = (PointMass(26.75, "contact", 4.0), PointMass(40.0, "carrier", 7.0), PointMass(30.0, "contact", 2.0))
    line = Line(spans=(dataclasses.replace(SPAN, masses=masses),))
    rest = statics.solve(line)
    g = line.gravity
    assert rest.dropper_forces.sum() == pytest.approx(g * (1.35 * 60.0 + 6.0), rel=1e-12)
    assert rest.sites.force[rest.sites.kind == MAST].sum() == pytest.approx(g * (2.42 * 60.0 + 13.0), rel=1e-12)
    np.testing.assert_allclose(rest.contact(AT), 0.0, atol=1e-12)
    # 2 kg at the dropper of 30 m pull on it alone; 4 kg half-way between two clamps 6.5 m apart
    sag = REST.contact(np.array([26.75]))[0] - rest.contact(np.array([26.75]))[0]
    assert 0.85 * 4.0 * g * 6.5 / (4 * 20e3) < sag < 4.0 * g * 6.5 / (4 * 20e3)
    assert rest.dropper_forces[4] - REST.dropper_forces[4] == pytest.approx(g * 4.0, rel=0.1)
    kinds = rest.sites.kind == POINT_MASS
    assert rest.sites.position[kinds].tolist() == [26.75, 30.0, 40.0]
    assert rest.sites.carrier_mass[kinds].tolist() == [0.0, 0.0, 7.0]
    assert rest.sites.contact_mass[kinds].tolist() == [4.0, 2.0, 0.0]


def test_a_point_mass_at_a_dropper_is_a_clamp() -> None:
    clamped = tuple(dataclasses.replace(d, contact_clamp=1.5 * (i == 3)) for i, d in enumerate(SPAN.droppers))
    clamp = statics.solve(Line(spans=(dataclasses.replace(SPAN, droppers=clamped),)))
    mass = (PointMass(SPAN.droppers[3].position, "contact", 1.5),)
    point = statics.solve(Line(spans=(dataclasses.replace(SPAN, masses=mass),)))
    np.testing.assert_allclose(point.dropper_forces, clamp.dropper_forces, rtol=1e-12)
    np.testing.assert_allclose(point.dropper_lengths, clamp.dropper_lengths, atol=1e-12)
    np.testing.assert_allclose(
        PushedLine(point).uplift(np.array([0.0, 30.0]), 100.0), PushedLine(clamp).uplift(np.array([0.0, 30.0]), 100.0)
    )


# ---- laws ---------------------------------------------------------------------------------------------------------


def test_sites_tell_the_whole_period_in_order() -> None:
    line = uneven_line()
    sites = statics.solve(line).sites
    assert sites.position.tolist() == sorted(sites.position)
    assert (sites.kind == DROPPER).sum() == 20
    np.testing.assert_allclose(sites.position[sites.kind == MAST], [0.0, 50.0, 110.0])
    assert sites.stiffness[sites.kind == MAST].tolist() == [4e5, 6e5, 5e5]
    arm = int(np.flatnonzero(sites.kind == STEADY_ARM)[0])
    assert (sites.position[arm], sites.kind[arm - 1]) == (50.0, MAST)
    assert (sites.stiffness[arm], sites.contact_mass[arm], sites.force[arm]) == (250.0, 1.0, 0.0)
    drop = sites.kind == DROPPER
    for half in (sites.carrier_mass, sites.contact_mass):
        assert half[drop].tolist() == [0.3] * 6 + [0.2] * 9 + [0.0] * 5
    np.testing.assert_allclose(sites.force[drop], sites.stiffness[drop] * sites.elongation[drop], rtol=1e-12)
    assert not sites.length[~drop].any()


def test_vertical_balance_with_dropper_masses() -> None:
    """Half of every dropper hangs on either wire: droppers carry contact wire + halves, masts carry everything."""
    line = uneven_line()
    sites = statics.solve(line).sites
    mass, g = 6 * 0.6 + 9 * 0.4, 9.81
    force = sites.force[sites.kind == DROPPER].sum()
    assert force == pytest.approx((1.35 * line.period + mass / 2) * g, rel=1e-12)
    assert sites.force[sites.kind == MAST].sum() == pytest.approx(((1.35 + 1.07) * line.period + mass) * g, rel=1e-12)


def test_mass_of_a_dropper_adds_half_its_weight_to_its_tension() -> None:
    """The clamps are held where they are, so each tension rises by exactly its own half weight."""
    heavy = dataclasses.replace(SPAN, droppers=tuple(dataclasses.replace(d, mass=0.8) for d in SPAN.droppers))
    rest = statics.solve(Line(spans=(heavy,)))
    np.testing.assert_allclose(rest.dropper_forces - REST.dropper_forces, 0.4 * 9.81, rtol=1e-9)


def test_symmetric_line_has_symmetric_forces() -> None:
    np.testing.assert_allclose(REST.dropper_forces, REST.dropper_forces[::-1], rtol=1e-10)
    zeta = np.linspace(0.0, 30.0, 100)
    np.testing.assert_allclose(REST.contact(zeta), REST.contact(60.0 - zeta), atol=1e-13)
    np.testing.assert_allclose(REST.carrier(zeta), REST.carrier(-zeta), atol=1e-12)


@pytest.mark.parametrize("times", [2, 3])
def test_writing_the_same_line_with_more_spans_changes_nothing(times: int) -> None:
    """Rounding grows with the period: 1e-10 of a force, 1e-12 m."""
    span = dataclasses.replace(SPAN, steady_arm=SteadyArm(100.0, 1.0), pre_sag=0.02)
    once, more = statics.solve(Line(spans=(span,))), statics.solve(Line(spans=(span,) * times))
    zeta = np.linspace(-50.0, 300.0, 501)
    np.testing.assert_allclose(more.dropper_forces, np.tile(once.dropper_forces, times), rtol=1e-10)
    np.testing.assert_allclose(more.dropper_lengths, np.tile(once.dropper_lengths, times), atol=1e-12)
    np.testing.assert_allclose(more.contact(zeta), once.contact(zeta), atol=1e-12)
    np.testing.assert_allclose(more.carrier(zeta), once.carrier(zeta), atol=1e-12)
    np.testing.assert_allclose(more.sites.force, np.tile(once.sites.force, times), rtol=1e-10)


@pytest.mark.parametrize("turn", [1, 2])
def test_beginning_with_another_span_only_moves_the_line(turn: int) -> None:
    line = uneven_line()
    turned = dataclasses.replace(line, spans=line.spans[turn:] + line.spans[:turn])
    a, b, moved = statics.solve(line), statics.solve(turned), line.span_starts[turn]
    zeta = np.linspace(0.0, 160.0, 301)
    np.testing.assert_allclose(b.contact(zeta), a.contact(zeta + moved), atol=1e-12)
    np.testing.assert_allclose(b.carrier(zeta), a.carrier(zeta + moved), atol=1e-12)
    first = sum(len(span.droppers) for span in line.spans[:turn])
    np.testing.assert_allclose(b.dropper_forces, np.roll(a.dropper_forces, -first), rtol=1e-10)
    np.testing.assert_allclose(b.dropper_lengths, np.roll(a.dropper_lengths, -first), atol=1e-12)


@given(
    gaps=st.lists(st.lists(st.floats(3.0, 12.0), min_size=3, max_size=9), min_size=1, max_size=4),
    tension=st.floats(8e3, 35e3),
    stiffness=st.floats(2e4, 1e6),
    mass=st.floats(0.0, 2.0),
    pre_sag=st.floats(-0.01, 0.03),
)
@settings(max_examples=30, deadline=None)
def test_equilibrium_of_any_layout(
    gaps: list[list[float]], tension: float, stiffness: float, mass: float, pre_sag: float
) -> None:
    """Balance, springs and clamps hold; a layout that would need a pushing dropper is refused, not returned."""
    spans = tuple(
        Span(
            float(np.sum(gap)),
            tuple(Dropper(float(at), stiffness, mass) for at in np.cumsum(gap)[:-1]),
            pre_sag,
            Mast(encumbrance=8.0),
        )
        for gap in gaps
    )
    line = Line(contact=Wire(1.2, 0.1, 120.0, tension), spans=spans)
    try:
        rest = statics.solve(line)
    except StaticsError as error:
        assert "push" in str(error)
        assert error.span is not None and error.dropper is not None
        return
    at, n = rest.dropper_positions, rest.dropper_positions.size
    assert rest.dropper_forces.min() > 0.0
    assert rest.dropper_forces.sum() == pytest.approx(9.81 * (1.2 * line.period + n * mass / 2), rel=1e-9)
    stretch = rest.carrier(at) - rest.contact(at) - rest.dropper_lengths
    np.testing.assert_allclose(stretch * stiffness, rest.dropper_forces, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(rest.carrier(np.array(line.span_starts)), 8.0, atol=1e-10)


# ---- given lengths, one-sidedness ---------------------------------------------------------------------------------


def check_springs(rest: Statics) -> None:
    """Every dropper obeys F = max(0, k_d e), e measured from the shapes (rounding of 1e-10 m at 1e5 N/m)."""
    at, sites = rest.dropper_positions, rest.sites
    stretch = rest.carrier(at) - rest.contact(at) - rest.dropper_lengths
    np.testing.assert_allclose(stretch, rest.dropper_elongations, atol=1e-10)
    k_d = sites.stiffness[sites.kind == DROPPER]
    np.testing.assert_allclose(rest.dropper_forces, np.maximum(0.0, k_d * stretch), atol=1e-4)
    line = rest.line
    half = 0.5 * sum(d.mass for span in line.spans for d in span.droppers)
    weight = (line.contact.mass_per_length * line.period + half) * line.gravity
    assert rest.dropper_forces.sum() == pytest.approx(weight, rel=1e-9)


@pytest.mark.parametrize("line", [Line(), uneven_line()])
def test_given_lengths_reproduce_the_equilibrium_they_come_from(line: Line) -> None:
    rest = statics.solve(line)
    again = statics.solve(with_lengths(line, rest.dropper_lengths))
    np.testing.assert_allclose(again.dropper_forces, rest.dropper_forces, rtol=1e-8)
    zeta = np.linspace(0.0, 150.0, 300)
    np.testing.assert_allclose(again.contact(zeta), rest.contact(zeta), atol=1e-11)


def test_given_and_computed_lengths_in_one_line() -> None:
    """Every second dropper is given what was computed for it: nothing changes. 3 mm shorter: it lifts, others hold."""
    line = uneven_line()
    rest = statics.solve(line)
    mixed: list[float | None] = [float(x) if i % 2 else None for i, x in enumerate(rest.dropper_lengths)]
    again = statics.solve(with_lengths(line, mixed))
    np.testing.assert_allclose(again.dropper_forces, rest.dropper_forces, rtol=1e-8)
    short = mixed[7]
    assert short is not None
    mixed[7] = short - 0.003
    lifted = statics.solve(with_lengths(line, mixed))
    check_springs(lifted)
    height = lifted.contact(lifted.dropper_positions)
    assert height[7] > rest.contact(rest.dropper_positions)[7] + 1e-3
    free = [i for i, x in enumerate(mixed) if x is None]
    np.testing.assert_allclose(height[free], rest.contact(rest.dropper_positions)[free], atol=1e-12)
    assert lifted.dropper_forces[7] > rest.dropper_forces[7]


def test_too_long_dropper_is_slack_and_its_neighbours_carry() -> None:
    lengths = REST.dropper_lengths.copy()
    lengths[4] += 0.1
    rest = statics.solve(with_lengths(Line(), lengths))
    check_springs(rest)
    assert rest.dropper_forces[4] == 0.0
    assert rest.dropper_elongations[4] < -0.01
    assert rest.dropper_forces[[3, 5]].min() > 1.2 * REST.dropper_forces[3]


def test_slack_dropper_beside_droppers_that_are_held() -> None:
    """Lengths of the others follow: the slack one counts as absent but for the half weights that it leaves."""
    mass = tuple(dataclasses.replace(d, mass=0.6) for d in SPAN.droppers)
    line = Line(spans=(dataclasses.replace(SPAN, droppers=mass),))
    rest = statics.solve(with_lengths(line, [None] * 4 + [0.6] + [None] * 4))
    check_springs(rest)
    assert rest.dropper_forces[4] == 0.0
    assert rest.dropper_lengths[4] == 0.6
    held = np.delete(np.arange(9), 4)
    np.testing.assert_allclose(rest.contact(AT[held]), 0.0, atol=1e-12)
    # string over 13 m with half a dropper (0.3 kg) in the middle: w L^2/(8 T) + 0.3 kg g L/(4 T)
    assert rest.contact(AT[[4]])[0] == pytest.approx(-(1.35 * 13**2 / 8 + 0.3 * 13 / 4) * 9.81 / 20e3, rel=0.03)


@given(extra=st.lists(st.floats(-0.02, 0.15), min_size=20, max_size=20))
@settings(max_examples=40, deadline=None)
@pytest.mark.slow
def test_any_lengths_give_a_one_sided_equilibrium(extra: list[float]) -> None:
    line = uneven_line()
    rest = statics.solve(with_lengths(line, statics.solve(line).dropper_lengths + np.array(extra)))
    check_springs(rest)
    assert rest.dropper_forces.min() >= 0.0


@pytest.mark.slow
def test_dropper_that_is_lengthened_slackens_steadily() -> None:
    """Half a millimetre at a time: less and less tension, then none and a growing gap; an equilibrium at every step."""
    tension, gap = [], []
    for extra in np.arange(0.0, 0.06, 0.0005):
        lengths = REST.dropper_lengths.copy()
        lengths[2] += extra
        rest = statics.solve(with_lengths(Line(), lengths))
        check_springs(rest)
        tension.append(rest.dropper_forces[2])
        gap.append(max(0.0, -rest.dropper_elongations[2]))
    assert tension[0] > 80.0 and tension[-1] == 0.0 and gap[-1] > 0.01
    assert (np.diff(tension) <= 0.0).all() and (np.diff(gap) >= 0.0).all()
    assert -np.diff(tension).min() < 4.0  # no jump: 0.5 mm against wires of some 5 kN/m


def test_droppers_never_push() -> None:
    """All but two droppers far too long: the two carry the wire, and not more than it weighs."""
    lengths = REST.dropper_lengths + 1.0
    lengths[[0, 8]] -= 1.0
    rest = statics.solve(with_lengths(Line(), lengths))
    check_springs(rest)
    assert np.flatnonzero(rest.dropper_forces).tolist() == [0, 8]
    np.testing.assert_allclose(rest.dropper_forces[[0, 8]], 1.35 * 9.81 * 30.0, rtol=1e-9)


def test_active_set_leaves_a_cycle() -> None:
    """Murty's matrix: flipping all that disagree runs in a circle of three states from here; x is 1/3 each."""
    matrix, side = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]]), np.ones(3)

    def try_out(taut: NDArray[np.bool_]) -> tuple[Array, Array]:
        x = np.zeros(3)
        x[taut] = np.linalg.solve(matrix[np.ix_(taut, taut)], side[taut])
        return x, np.where(taut, x, side - matrix @ x)

    taut, x = statics.one_sided(try_out, np.array([True, False, False]))
    np.testing.assert_allclose(x, 1 / 3, rtol=1e-12)
    assert taut.all()


def test_without_gravity_nothing_is_loaded() -> None:
    rest = statics.solve(Line(gravity=0.0))
    assert not rest.dropper_forces.any() and not rest.dropper_elongations.any()
    np.testing.assert_allclose(rest.dropper_lengths, 1.05, atol=1e-12)
    given = statics.solve(dataclasses.replace(with_lengths(Line(), REST.dropper_lengths), gravity=0.0))
    assert not given.dropper_forces.any()
    assert given.dropper_elongations.max() == pytest.approx(0.0, abs=1e-12)


# ---- refusals -----------------------------------------------------------------------------------------------------


def test_impossible_statics_name_the_dropper() -> None:
    spans = (SPAN, dataclasses.replace(SPAN, pre_sag=1.0))
    with pytest.raises(
        StaticsError, match=r"spans\[1\]\.droppers\[\d\]: would have to push .* pre_sag = 1 m"
    ) as caught:
        statics.solve(Line(spans=spans))
    assert caught.value.span == 1
    low = dataclasses.replace(SPAN, mast=Mast(encumbrance=0.6))
    with pytest.raises(StaticsError, match=r"spans\[0\]\.droppers\[\d\]: .* long: .* encumbrance = 0.6 m"):
        statics.solve(Line(spans=(low, low, low)))


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: Span(-1.0, ()), "length"),
        (lambda: Span(60.0, (Dropper(5.0), Dropper(5.0))), r"droppers\[1\].position"),
        (lambda: Span(60.0, (Dropper(5.0), Dropper(60.0))), r"droppers\[1\].position"),
        (lambda: Span(60.0, (), pre_sag=float("inf")), "pre_sag"),
        (lambda: Dropper(5.0, stiffness=0.0), "stiffness"),
        (lambda: Dropper(5.0, length=-1.0), "length"),
        (lambda: Dropper(0.0), "position"),
        (lambda: Mast(encumbrance=float("nan")), "encumbrance"),
        (lambda: SteadyArm(stiffness=-1.0), "stiffness"),
        (lambda: Line(spans=()), "spans"),
        (lambda: Wire(1.0, 0.0, 100.0, 0.0), "tension"),
    ],
)
def test_bad_lines_are_refused_by_name(make: object, names: str) -> None:
    assert callable(make)
    with pytest.raises(ValueError, match=names):
        make()
