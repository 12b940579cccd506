"""Static equilibrium against closed-form values, against an independent finite-element solve, and as laws."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model import elements, lattice, statics
from catenary_model.line import CONTACT_3_1, DROPPERS_3_1, Line, Wire

REST = statics.solve(Line())
AT = np.array(DROPPERS_3_1)


def test_dropper_forces_of_table_3_1() -> None:
    # half of each neighbouring gap: 7.75 m at the outer droppers, 6 m at the second ones
    weight = 1.35 * 9.81
    assert REST.dropper_forces.max() == pytest.approx(weight * 7.75, rel=0.01)
    assert REST.dropper_forces.min() == pytest.approx(weight * 6.0, rel=0.01)
    assert 79.0 < REST.dropper_forces.min() < REST.dropper_forces.max() < 103.0
    assert REST.dropper_forces.sum() == pytest.approx(weight * 60.0, rel=1e-12)


def test_unstressed_lengths_of_table_3_1() -> None:
    # values of an independent prototype, printed to the millimetre, for this encumbrance
    lengths = statics.solve(Line(encumbrance=1.0565)).dropper_lengths
    np.testing.assert_allclose(lengths[:5], [0.845, 0.663, 0.507, 0.413, 0.381], atol=0.001)
    np.testing.assert_allclose(lengths, lengths[::-1], atol=1e-9)


def test_contact_wire_is_level_at_clamps_and_sags_between() -> None:
    np.testing.assert_allclose(REST.contact(AT), 0.0, atol=1e-12)
    # string between clamps: rhoA g L^2 / (8 T) = 8.28 mm over 10 m, 3.50 mm over 6.5 m; bending takes up to 8 % off
    assert REST.contact(np.array([0.0]))[0] == pytest.approx(-1.35 * 9.81 * 10**2 / (8 * 20e3), rel=0.05)
    assert REST.contact(np.array([26.75]))[0] == pytest.approx(-1.35 * 9.81 * 6.5**2 / (8 * 20e3), rel=0.08)


def test_carrier_passes_the_masts_and_carries_everything() -> None:
    assert REST.carrier(np.array([0.0, 60.0, -120.0])) == pytest.approx(1.05, abs=1e-12)
    # parabola of the spread weight of both wires: q L^2 / (8 T) = 0.667 m, droppers as points change it by 2 %
    sag = 1.05 - REST.carrier(np.array([30.0]))[0]
    assert sag == pytest.approx((1.07 + 1.35) * 9.81 * 60**2 / (8 * 16e3), rel=0.02)


def test_pre_sag_is_met() -> None:
    rest = statics.solve(Line(pre_sag=0.03))
    s = AT / 60.0
    np.testing.assert_allclose(rest.contact(AT), -0.12 * s * (1 - s), atol=1e-12)


def test_slope_is_the_derivative_of_the_shape() -> None:
    zeta, d = np.linspace(-70.0, 130.0, 777), 1e-5
    numeric = (REST.contact(zeta + d) - REST.contact(zeta - d)) / (2 * d)
    np.testing.assert_allclose(REST.contact_slope(zeta), numeric, atol=1e-8)


def test_shape_against_fine_finite_elements() -> None:
    """One periodic span in 0.05 m elements that carries weight and dropper forces; 1 micrometre."""
    wire, h = CONTACT_3_1, 0.05
    n = 1200
    K = np.zeros((2 * n, 2 * n))
    block = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
    load = np.zeros(2 * n)
    weight = -wire.mass_per_length * 9.81 * np.array([h / 2, h * h / 12, h / 2, -h * h / 12])
    for e in range(n):
        dofs = np.array([2 * e, 2 * e + 1, 2 * ((e + 1) % n), 2 * ((e + 1) % n) + 1])
        K[np.ix_(dofs, dofs)] += block
        load[dofs] += weight
    for at, force in zip(AT, REST.dropper_forces, strict=True):
        load[2 * round(at / h)] += force
    held = 2 * round(AT[0] / h)
    free = np.setdiff1d(np.arange(2 * n), [held])
    w = np.zeros(2 * n)
    w[free] = np.linalg.solve(K[np.ix_(free, free)], load[free])
    np.testing.assert_allclose(w[::2], REST.contact(h * np.arange(n)), atol=1e-6)


def test_given_lengths_reproduce_the_computed_ones() -> None:
    again = statics.solve(Line(dropper_lengths=tuple(REST.dropper_lengths)))
    np.testing.assert_allclose(again.dropper_forces, REST.dropper_forces, rtol=1e-9)


def test_too_long_dropper_is_slack_and_its_neighbours_carry() -> None:
    lengths = REST.dropper_lengths.copy()
    lengths[4] += 0.1
    rest = statics.solve(Line(dropper_lengths=tuple(lengths)))
    assert rest.dropper_forces[4] == 0.0
    assert rest.dropper_elongations[4] < 0.0
    assert rest.dropper_forces.sum() == pytest.approx(1.35 * 9.81 * 60.0, rel=1e-9)
    taut = rest.dropper_forces > 0.0
    np.testing.assert_allclose(rest.dropper_forces[taut], 1e5 * rest.dropper_elongations[taut], rtol=1e-6)
    measured = rest.carrier(AT) - rest.contact(AT) - lengths
    np.testing.assert_allclose(measured, rest.dropper_elongations, atol=1e-9)


@given(
    gaps=st.lists(st.floats(2.0, 12.0), min_size=3, max_size=10),
    tension=st.floats(8e3, 35e3),
    stiffness=st.floats(2e4, 1e6),
)
@settings(max_examples=25, deadline=None)
def test_droppers_carry_the_weight_for_any_layout(gaps: list[float], tension: float, stiffness: float) -> None:
    positions = tuple(np.cumsum(gaps)[:-1])
    line = Line(
        contact=Wire(1.2, 0.1, 120.0, tension),
        span_length=float(np.sum(gaps)),
        dropper_positions=positions,
        dropper_stiffness=stiffness,
        encumbrance=6.0,
    )
    try:
        rest = statics.solve(line)
    except ValueError as error:  # a very uneven layout would need a pushing dropper: refused, not returned
        assert "push" in str(error)
        return
    assert rest.dropper_forces.sum() == pytest.approx(1.2 * 9.81 * line.span_length, rel=1e-9)
    np.testing.assert_allclose(rest.contact(np.array(positions)), 0.0, atol=1e-10)
    stretch = rest.carrier(np.array(positions)) - rest.contact(np.array(positions)) - rest.dropper_lengths
    np.testing.assert_allclose(stretch * stiffness, rest.dropper_forces, rtol=1e-6, atol=1e-6)


def test_mesh_shape_is_the_exact_one_away_from_clamps() -> None:
    """0.2 mm everywhere for 1 m elements (local compliance of a clamp), 0.02 mm beyond 1.5 elements from one."""
    table = lattice.static_table(REST, 1.0)
    zeta = np.linspace(0.0, 60.0, len(table))
    error = np.abs(table[:, 0] - REST.contact(zeta))
    away = np.abs(zeta[:, None] - AT).min(axis=1) > 1.5
    assert error.max() < 2e-4
    assert error[away].max() < 2e-5
    fine = lattice.static_table(REST, 0.05)
    assert np.abs(fine[:, 0] - REST.contact(zeta)).max() < 2e-6


def test_mesh_shape_equals_a_mesh_that_is_solved() -> None:
    """A periodic span of 1 m elements with its droppers inside elements, solved; both DoFs to 2e-7 (table step)."""
    wire, h, n, phase = CONTACT_3_1, 1.0, 60, 0.37
    K = np.zeros((2 * n, 2 * n))
    block = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
    weight = -wire.mass_per_length * 9.81 * np.array([h / 2, h * h / 12, h / 2, -h * h / 12])
    load = np.zeros(2 * n)
    psi = np.zeros(4)
    for e in range(n):
        dofs = np.array([2 * e, 2 * e + 1, 2 * ((e + 1) % n), 2 * ((e + 1) % n) + 1])
        K[np.ix_(dofs, dofs)] += block
        load[dofs] += weight
        for at, force in zip(AT - phase, REST.dropper_forces, strict=True):
            if int(at // h) == e:
                elements.shape_functions(at - e * h, h, psi)
                load[dofs] += force * psi
    w = np.linalg.lstsq(K, load, rcond=None)[0].reshape(n, 2)
    table = lattice.static_table(REST, h)
    at_nodes = np.linspace(0.0, 60.0, len(table))
    nodes = phase + h * np.arange(n)
    expected = np.column_stack([np.interp(nodes, at_nodes, table[:, j]) for j in (0, 3)])
    offset = (expected[:, 0] - w[:, 0]).mean()
    np.testing.assert_allclose(w[:, 0] + offset, expected[:, 0], atol=2e-7)
    np.testing.assert_allclose(w[:, 1], expected[:, 1], atol=2e-7)


def test_table_derivatives_are_consistent() -> None:
    table = lattice.static_table(REST, 1.0)
    step = 60.0 / (len(table) - 1)
    for first in (0, 3):
        for column in (first, first + 1):
            numeric = np.diff(table[:, column]) / step
            middle = 0.5 * (table[1:, column + 1] + table[:-1, column + 1])
            # the second derivative of the rotation jumps where a clamp passes a node: at most one sample each
            close = np.abs(numeric - middle) <= 1e-3 * np.abs(table[:, column + 1]).max()
            assert close.mean() > 0.99


@pytest.mark.parametrize(
    ("changes", "names"),
    [
        ({"span_length": -1.0}, "span_length"),
        ({"dropper_positions": (5.0, 5.0)}, "dropper_positions"),
        ({"dropper_positions": (5.0, 60.0)}, "dropper_positions"),
        ({"dropper_stiffness": 0.0}, "dropper_stiffness"),
        ({"encumbrance": float("nan")}, "encumbrance"),
        ({"steady_arm_stiffness": -1.0}, "steady_arm_stiffness"),
        ({"pre_sag": float("inf")}, "pre_sag"),
        ({"dropper_lengths": (1.0,)}, "dropper_lengths"),
        ({"dropper_lengths": (-1.0,) * 9}, "dropper_lengths"),
    ],
)
def test_bad_lines_are_refused_by_name(changes: dict[str, object], names: str) -> None:
    with pytest.raises(ValueError, match=names):
        dataclasses.replace(Line(), **changes)


def test_impossible_statics_are_refused() -> None:
    with pytest.raises(ValueError, match="encumbrance"):
        statics.solve(Line(encumbrance=0.5))
    with pytest.raises(ValueError, match="pre_sag"):
        statics.solve(Line(pre_sag=1.0))
    with pytest.raises(ValueError, match="tension"):
        Wire(1.0, 0.0, 100.0, 0.0)
