"""The equilibrium on the mesh against the closed form of the statics."""

import dataclasses

import numpy as np
import pytest

from catenary_model import statics
from catenary_model.line import Dropper, Line, Mast, Span, SteadyArm
from catenary_model.reference import equilibrium
from catenary_model.reference.mesh import mesh_spans, span_start
from catenary_model.reference.sites import repeated
from catenary_model.statics import DROPPER, MAST

UNEVEN = Line(
    spans=(
        Span(52.3, tuple(Dropper(p, mass=0.4) for p in (5.0, 13.0, 22.1, 31.0, 40.0, 47.7)), pre_sag=0.02),
        Span(
            61.1, tuple(Dropper(p) for p in (4.7, 12.0, 21.0, 30.3, 40.0, 50.0, 56.2)), steady_arm=SteadyArm(100.0, 1.0)
        ),
    )
)


def at_rest(line: Line, h: float, first: int = -1, spans: int = 5):
    rest = statics.solve(line)
    mesh = mesh_spans(line, first, spans, h)
    return rest, mesh, repeated(rest, mesh)


@pytest.mark.parametrize("line", [Line(), UNEVEN], ids=["even", "uneven"])
def test_forces_and_shape_of_the_closed_form(line: Line) -> None:
    """Lengths given: forces to 0.4 N and heights to 0.5 mm at 0.25 m (the kink at masts), much better at 0.125 m."""
    errors = []
    for h in (0.25, 0.125):
        rest, mesh, sites = at_rest(line, h)
        solved = equilibrium.solve(rest, mesh, sites)
        drop = sites.kind == DROPPER
        errors.append(
            (
                np.abs(solved.force - sites.force)[drop].max(),
                np.abs(solved.nodal[2] - rest.contact(mesh.zeta)).max(),
                np.abs(solved.nodal[0] - rest.carrier(mesh.zeta)).max(),
            )
        )
    assert (np.array(errors[0]) < (0.4, 5e-4, 5e-4)).all()
    # bending over 8 to 9 cm is only just resolved: between the order 2 of a coarse mesh and 4
    orders = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert ((orders > 1.8) & (orders < 5.0)).all()


@pytest.mark.parametrize("line", [Line(), UNEVEN], ids=["even", "uneven"])
def test_exact_forces_leave_only_the_mesh_at_the_clamps(line: Line) -> None:
    """Forces given: the contact wire within 0.2 mm on 1 m elements and 0.02 mm on 0.25 m; it is where rides start."""
    for h, tolerance in ((1.0, 2e-4), (0.25, 2e-5)):
        rest, mesh, sites = at_rest(line, h)
        carried = equilibrium.carry(rest, mesh, sites)
        np.testing.assert_allclose(carried.nodal[2], rest.contact(mesh.zeta), atol=tolerance)
        np.testing.assert_array_equal(carried.force[sites.kind == DROPPER], sites.force[sites.kind == DROPPER])


def test_masts_carry_the_weight() -> None:
    """Balance of a span: what a mast inside carries is the weight of both wires and of the droppers of one span."""
    line = dataclasses.replace(Line(), spans=(Span(60.0, tuple(Dropper(p, mass=1.5) for p in (10.0, 30.0, 50.0))),))
    rest, mesh, sites = at_rest(line, 0.5)
    carried = equilibrium.carry(rest, mesh, sites)
    weight = 9.81 * (60.0 * (1.07 + 1.35) + 3 * 1.5)
    inner = carried.force[sites.kind == MAST][1:-1]
    np.testing.assert_allclose(inner, weight, rtol=1e-6)


def test_given_length_that_is_too_long_is_slack() -> None:
    """One-sided: the same dropper is slack on the mesh and in the closed form, the others agree to 0.5 N."""
    spans = []
    lengths = statics.solve(Line()).dropper_lengths
    for i, (position, length) in enumerate(zip(range(9), lengths, strict=True)):
        at = Line().spans[0].droppers[position].position
        spans.append(Dropper(at, length=float(length) + (0.05 if i == 4 else 0.0)))
    line = dataclasses.replace(Line(), spans=(Span(60.0, tuple(spans)),))
    rest, mesh, sites = at_rest(line, 0.25)
    solved = equilibrium.solve(rest, mesh, sites)
    drop = sites.kind == DROPPER
    assert (solved.force[drop][4::9] == 0.0).all()
    assert (solved.elongation[drop][4::9] < 0.0).all()
    np.testing.assert_allclose(solved.force[drop], sites.force[drop], atol=0.5)


def test_sites_of_an_endless_line() -> None:
    """Spans of any running number: masts where the sequence puts them, both ends included, droppers between."""
    _, mesh, sites = at_rest(UNEVEN, 0.5, first=-3, spans=4)
    masts = sites.position[sites.kind == MAST]
    np.testing.assert_allclose(masts, [span_start(UNEVEN, i) for i in range(-3, 2)], atol=1e-9)
    np.testing.assert_allclose(np.diff(masts), [61.1, 52.3, 61.1, 52.3])
    assert (mesh.start, mesh.end) == pytest.approx((masts[0], masts[-1]))
    assert (sites.kind == DROPPER).sum() == 2 * (6 + 7)


def test_mast_height_may_differ() -> None:
    """Every mast holds the carrier at its own encumbrance."""
    span = Span(50.0, (Dropper(12.0), Dropper(25.0), Dropper(38.0)))
    low = dataclasses.replace(span, mast=Mast(encumbrance=0.95))
    rest, mesh, sites = at_rest(Line(spans=(span, low)), 0.5, first=0, spans=4)
    carried = equilibrium.carry(rest, mesh, sites)
    e = [mesh.locate(float(zeta)) for zeta in sites.position[sites.kind == MAST]]
    heights = [psi @ carried.nodal[:2, i : i + 2].T.ravel() for i, psi in e]
    np.testing.assert_allclose(heights, [1.05, 0.95, 1.05, 0.95, 1.05], atol=1e-9)
