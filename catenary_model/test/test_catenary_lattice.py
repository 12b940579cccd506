"""The static shape of the contact wire as a coarse mesh sees it."""

import numpy as np
import pytest

from catenary_model import elements, lattice, statics
from catenary_model.line import CONTACT_3_1, DROPPERS_3_1, Dropper, Line, Span

REST = statics.solve(Line())
AT = np.array(DROPPERS_3_1)


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


def test_table_covers_the_period_of_unequal_spans() -> None:
    """A span of an unequal line has its own stretch of the table; 0.2 mm as for one span (local compliance)."""
    short = Span(45.0, tuple(Dropper(at, mass=0.8) for at in (5.0, 15.0, 24.0, 33.0, 40.0)), pre_sag=0.02)
    rest = statics.solve(Line(spans=(short, *Line().spans)))
    table = lattice.static_table(rest, 1.0)
    zeta = np.linspace(0.0, 105.0, len(table))
    error = np.abs(table[:, 0] - rest.contact(zeta))
    away = np.abs(zeta[:, None] - rest.dropper_positions).min(axis=1) > 1.5
    assert error.max() < 2e-4
    assert error[away].max() < 2e-5
    np.testing.assert_array_equal(table[0], table[-1])


def test_repeating_the_spans_repeats_the_table() -> None:
    """Same line written as one and as three spans; 1e-12 relative is rounding."""
    once = lattice.static_table(REST, 1.0)
    thrice = lattice.static_table(statics.solve(Line(spans=Line().spans * 3)), 1.0)
    n = len(once) - 1
    for k in range(3):
        np.testing.assert_allclose(thrice[k * n : (k + 1) * n], once[:n], atol=1e-12)


def test_table_of_a_long_period_stays_small_and_right() -> None:
    """400 equal spans, 24 km, a sample every 30 mm: between them w is off by 1.2e-6 m, w' by 4e-5, phi by 1e-5."""
    line = Line(spans=Line().spans * 400)
    table, once = lattice.static_table(statics.solve(line), 0.75), lattice.static_table(REST, 0.75)
    assert table.nbytes < 50e6
    zeta = np.linspace(11.0, 23.9e3, 20_011)
    at, close = zeta / line.period * (len(table) - 1), zeta % 60.0 / 60.0 * (len(once) - 1)
    for column, most in ((0, 1.5e-6), (1, 6e-5), (3, 2e-5)):
        long = np.interp(at, np.arange(len(table)), table[:, column])
        short = np.interp(close, np.arange(len(once)), once[:, column])
        np.testing.assert_allclose(long, short, atol=most)


def test_line_without_droppers_has_a_level_table() -> None:
    table = lattice.static_table(statics.solve(Line(spans=(Span(60.0, ()),))), 1.0)
    assert table.shape[1] == 6
    assert not table.any()


@pytest.mark.parametrize("h", [1.0, 0.5])
def test_local_compliance_is_what_a_mesh_lacks(h: float) -> None:
    """Mid-span of a simply supported beam of 80 m: L/(4 T) - lambda/(2 T) less what a mesh of it gives; rounding."""
    wire, n = CONTACT_3_1, round(80.0 / h)
    K = np.zeros((2 * n + 2, 2 * n + 2))
    for e in range(n):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
    free = np.delete(np.arange(2 * n + 2), [0, 2 * n])
    load = np.zeros(2 * n + 2)
    load[n] = 1.0
    w = np.linalg.solve(K[np.ix_(free, free)], load[free])
    exact = 80.0 / (4 * wire.tension) - wire.bending_length / (2 * wire.tension)
    assert lattice.local_compliance(wire, h) == pytest.approx(exact - w[n - 1], abs=1e-11)
    assert lattice.local_compliance(wire, h) > 3e-7


def test_fine_mesh_lacks_no_compliance() -> None:
    """20 mm resolve lambda = 87 mm: the error of cubic elements falls with h^4, by 16 for half the length."""
    coarse, fine = (lattice.local_compliance(CONTACT_3_1, h) for h in (0.04, 0.02))
    assert 0.0 < fine < 1e-3 * CONTACT_3_1.bending_length / (2 * CONTACT_3_1.tension)
    assert coarse / fine == pytest.approx(16.0, rel=0.1)
