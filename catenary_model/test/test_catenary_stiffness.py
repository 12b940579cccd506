"""Static deflection under a point force: closed forms of a wire on supports, and laws of the whole line."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model import statics
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm, Wire
from catenary_model.line_file import load_line, preset_names
from catenary_model.stiffness import PushedLine

TABLE_3_1 = PushedLine(statics.solve(Line()))
SPAN = Line().spans[0]


def bare(tension: float, length: float, stiffness: float, bending_stiffness: float = 1e-9) -> PushedLine:
    """A contact wire without droppers on springs at the masts."""
    wire = Wire(1.35, 0.2, bending_stiffness, tension)
    return PushedLine(statics.solve(Line(contact=wire, spans=(Span(length, (), steady_arm=SteadyArm(stiffness)),))))


@given(tension=st.floats(8e3, 35e3), length=st.floats(20.0, 80.0), stiffness=st.floats(300.0, 1e7))
@settings(max_examples=25, deadline=None)
@pytest.mark.slow
def test_string_on_equal_springs(tension: float, length: float, stiffness: float) -> None:
    """T (u_1 - 2 u_0 + u_-1)/L = k u_0 - F: u_n = F mu^n/(k + 2 T (1 - mu)/L), mu + 1/mu = 2 + k L/T.

    A force in mid-span is half of it on either mast, and bends the string by F L/(4 T) in between. The domain was
    chosen for 1e-5; bending adds lambda/(2 T), below 1e-6 of the compliance.
    """
    line = bare(tension, length, stiffness)
    r = stiffness * length / tension
    mu = 1 + r / 2 - math.sqrt(r + r * r / 4)
    at_mast = 1 / (stiffness + 2 * tension * (1 - mu) / length)
    mid = 0.5 * at_mast * (1 + mu) + length / (4 * tension)
    compliance = line.uplift(np.array([0.0, length / 2]), 1.0)
    np.testing.assert_allclose(compliance, [at_mast, mid], rtol=2e-5)


def test_beam_between_rigid_supports() -> None:
    """L/(4 T) less lambda/(2 T) under the force, less lambda/(4 T) for the kinks over the supports next to it.

    The kink of F/2 over either support is rounded as well, by (F/2) lambda/(2 T), which lowers the wire in between.
    Terms of (lambda/L)^2 = 2e-6 are left out.
    """
    wire = Wire(1.35, 0.2, 150.0, 20e3)
    line = bare(20e3, 60.0, 1e9, bending_stiffness=150.0)
    expected = 60.0 / (4 * 20e3) - wire.bending_length / (2 * 20e3) - wire.bending_length / (4 * 20e3)
    assert line.uplift(np.array([30.0]), 1.0)[0] == pytest.approx(expected, rel=1e-5)


def test_wire_that_hangs_from_nothing_has_no_stiffness() -> None:
    with pytest.raises(statics.StaticsError, match="hangs from nothing"):
        PushedLine(statics.solve(Line(spans=(Span(60.0, (), steady_arm=SteadyArm(0.0, 1.0)),))))


def test_wire_that_is_held_too_softly_is_refused() -> None:
    with pytest.raises(statics.StaticsError, match="so soft"):
        bare(20e3, 60.0, 1e-6)


def test_mid_span_lies_between_string_and_rigid_masts() -> None:
    """Both wires as one string between the masts, 4 (T_ca + T_co)/L = 2400 N/m, is what an engineer expects.

    Real droppers let each wire bend alone and the contact wire passes the mast: softer, by less than a fifth.
    """
    k = TABLE_3_1.stiffness(np.array([30.0]), 10.0)[0]
    assert 0.8 * 2400.0 < k < 2400.0


def test_small_forces_act_linearly_and_both_ways() -> None:
    positions = np.array([3.0, 26.0, 30.0])
    up, down = TABLE_3_1.uplift(positions, 20.0), TABLE_3_1.uplift(positions, -40.0)
    np.testing.assert_allclose(down, -2.0 * up, rtol=1e-9)


def test_stiffness_is_symmetric_and_periodic() -> None:
    positions = np.array([0.0, 4.0, 11.0, 25.0])
    k = TABLE_3_1.stiffness(positions, 100.0)
    np.testing.assert_allclose(TABLE_3_1.stiffness(60.0 - positions, 100.0), k, rtol=1e-9)
    np.testing.assert_allclose(TABLE_3_1.stiffness(positions - 180.0, 100.0), k, rtol=1e-9)


@given(a=st.floats(0.0, 110.0), b=st.floats(0.0, 110.0))
@settings(max_examples=20, deadline=None)
def test_reciprocity(a: float, b: float) -> None:
    """As long as no dropper slackens, a push at a lifts b as much as the same push at b lifts a; rounding."""
    line = ALTERNATING
    there = line.push(a, 10.0).contact(np.array(b))
    back = line.push(b, 10.0).contact(np.array(a))
    assert there == pytest.approx(back, rel=1e-7, abs=1e-12)


ALTERNATING = PushedLine(statics.solve(load_line("alternating_spans")))


def test_strong_push_beside_a_dropper_slackens_it_and_softens_the_line() -> None:
    at = np.array([5.0])
    soft, hard = TABLE_3_1.push(5.0, 400.0), TABLE_3_1.push(5.0, 50.0)
    assert hard.dropper_forces.min() > 0.0
    assert soft.dropper_forces.min() == 0.0
    assert TABLE_3_1.stiffness(at, 400.0)[0] < 0.9 * TABLE_3_1.stiffness(at, 50.0)[0]


def test_the_force_is_taken_by_droppers_and_arms() -> None:
    """Vertical balance of the contact wire: what the droppers lose and the arms push down is the force."""
    line = Line(spans=(dataclasses.replace(SPAN, steady_arm=SteadyArm(300.0)),))
    rest = statics.solve(line)
    pushed = PushedLine(rest)
    push = pushed.push(20.0, 300.0)
    masts = np.arange(0.0, pushed.length, 60.0)
    arms = 300.0 * push.contact(masts).sum()
    copies = round(pushed.length / 60.0)
    assert rest.dropper_forces.sum() * copies - push.dropper_forces.sum() + arms == pytest.approx(300.0, rel=1e-8)


def test_softer_masts_and_no_arms_give_more_uplift() -> None:
    def uplift(mast: float, arm: float) -> float:
        span = dataclasses.replace(SPAN, mast=Mast(stiffness=mast), steady_arm=SteadyArm(arm))
        return float(PushedLine(statics.solve(Line(spans=(span,)))).uplift(np.array([0.0]), 100.0)[0])

    assert uplift(5e4, 0.0) > 1.01 * uplift(5e5, 0.0)
    assert uplift(5e5, 1000.0) < 0.9 * uplift(5e5, 0.0)


def test_more_droppers_far_away_do_not_matter() -> None:
    """Writing the line with twice the spans doubles the domain: same answer to the tolerance of the domain."""
    twice = PushedLine(statics.solve(Line(spans=(SPAN, SPAN))))
    positions = np.array([0.0, 30.0])
    np.testing.assert_allclose(twice.uplift(positions, 150.0), TABLE_3_1.uplift(positions, 150.0), rtol=1e-5)


@pytest.mark.parametrize("name", preset_names())
def test_presets_have_sensible_stiffness(name: str) -> None:
    """Static elasticity of main lines is some 0.2 to 0.6 mm/N: 1700 to 5500 N/m; softest away from the masts.

    48 kN on short spans (china_27_21) are stiffer than 36 and 38 kN on long ones: tension over span counts.
    """
    rest = statics.solve(load_line(name))
    line = PushedLine(rest)
    zeta = np.linspace(0.0, rest.line.period, 56)
    k = line.stiffness(zeta, 100.0)
    line_tension = rest.line.carrier.tension + rest.line.contact.tension
    assert 1700.0 < k.min() < max(2600.0, 3.5 * line_tension / rest.line.spans[0].length)
    assert k.max() < max(6000.0, 7.5 * line_tension / rest.line.spans[0].length)
    from_mast = np.abs(zeta[k.argmin()] - np.array([*rest.line.span_starts, rest.line.period])).min()
    assert from_mast > 15.0


def test_push_on_a_slack_dropper_at_rest() -> None:
    """A dropper that is slack at rest stays so under a push up, and under a pull that does not close its gap."""
    lengths = statics.solve(Line()).dropper_lengths
    droppers = tuple(Dropper(d.position, length=float(x)) for d, x in zip(SPAN.droppers, lengths, strict=True))
    droppers = (*droppers[:4], dataclasses.replace(droppers[4], length=float(lengths[4]) + 0.06), *droppers[5:])
    rest = statics.solve(Line(spans=(dataclasses.replace(SPAN, droppers=droppers),)))
    assert rest.dropper_elongations[4] < 0.0
    line = PushedLine(rest)
    here = int(np.flatnonzero(line.dropper_positions == 30.0)[0])
    assert line.push(30.0, 50.0).dropper_forces[here] == 0.0
    assert line.push(30.0, -1.0).dropper_forces[here] == 0.0
    assert line.push(30.0, -300.0).dropper_forces[here] > 50.0


def test_push_right_under_a_dropper_is_the_limit_of_pushes_beside_it() -> None:
    """Two loads at one place: 1 nm beside it the uplift differs by its slope, below 1e-2, times 1 nm."""
    here, beside = TABLE_3_1.push(17.0, 100.0), TABLE_3_1.push(17.0 + 1e-9, 100.0)
    assert here.uplift == pytest.approx(beside.uplift, abs=2e-11)
    zeta = np.linspace(15.0, 19.0, 41)
    np.testing.assert_allclose(here.contact(zeta), beside.contact(zeta), atol=2e-11)
