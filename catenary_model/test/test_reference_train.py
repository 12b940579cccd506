"""Several pantographs on the catenary-fixed line, coupled within the step."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh
from scipy.sparse import diags_array
from scipy.sparse.linalg import spsolve
from test_reference_laws import LINE, TS, energy, line_without_loss, pulse, reference
from test_reference_step import CONFIG, PANTOGRAPH

from catenary_model import elements
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Wire
from catenary_model.pantograph import Pantograph
from catenary_model.reference import Config, Mounted, Reference, train
from catenary_model.reference.equilibrium import incidence, wire_matrices
from catenary_model.travel import over_time

THREE = Pantograph.of(
    [6.0, 9.0, 7.5],
    [[100.1, -0.1, 0.0], [-0.1, 0.2, -0.1], [0.0, -0.1, 0.1]],
    [[15660.0, -15500.0, 0.0], [-15500.0, 22500.0, -7000.0], [0.0, -7000.0, 7000.0]],
    157.0,
    30e3,
)


def of_table(**changes: object) -> Reference:
    """Table 3.1's line, coarse."""
    given: dict = {"spans": 12, "speed": 60.0, "element_length": 1.0, "time_step": 1e-3, "start_position": 420.0}
    return Reference(Config(**{**given, **changes}))


def test_one_pantograph_is_the_ride_to_the_last_bit() -> None:
    """By itself, with its static force said anew, and behind another one whose force is held at nothing."""
    r = Reference(dataclasses.replace(CONFIG, start_position=45.0))
    alone = r.ride(PANTOGRAPH, 0.4, ramp=0.1)
    (mounted,) = r.ride_together([(PANTOGRAPH, 0.0, 260.0)], 0.4, ramp=0.1)
    for name in ("F", "w", "v", "head", "slack", "uplift"):
        np.testing.assert_array_equal(getattr(mounted, name), getattr(alone, name))
    given = np.column_stack([alone.F, np.zeros(400)])
    pushed, felt = r.push_together(given, [0.0, 12.0])
    np.testing.assert_array_equal(pushed.w, r.push(alone.F).w)
    np.testing.assert_array_equal(felt.F, 0.0)
    np.testing.assert_allclose(felt.zeta, alone.zeta - 12.0, rtol=1e-15)


def test_two_far_apart_are_two_rides_alone() -> None:
    """300 m at 204 m/s (below) towards a train at 60 m/s take 1.14 s; until then places differ by their rounding."""
    r = of_table()
    front, back = r.ride_together([(PANTOGRAPH, 0.0, None), (THREE, 300.0, None)], 1.0, ramp=0.3)
    for record, kind, start in ((front, PANTOGRAPH, 420.0), (back, THREE, 120.0)):
        alone = of_table(start_position=start).ride(kind, 1.0, ramp=0.3)
        np.testing.assert_allclose(record.F, alone.F, atol=1e-7)
        np.testing.assert_allclose(record.w, alone.w, atol=1e-11)
        np.testing.assert_allclose(record.head, alone.head, atol=1e-11)
        assert alone.F.max() > 150.0


def fastest(wire: Wire, h: float, ts: float) -> float:
    """Highest group velocity of the free wire's elements and time step, both branches of Hermite's, m/s."""
    angle = np.linspace(1e-3, math.pi - 1e-3, 2001)
    blocks = (
        wire.mass_per_length * elements.mass(h),
        (wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)),
    )
    omega = []
    for mu in angle:
        z = np.exp(1j * mu)
        M, K = (A[:2, :2] + A[2:, 2:] + z * A[:2, 2:] + A[2:, :2] / z for A in blocks)
        omega.append(2.0 / ts * np.arctan(0.5 * ts * np.sqrt(eigh(K, M, eigvals_only=True))))
    return float(np.abs(np.gradient(np.array(omega), angle / h, axis=0)).max())


@pytest.mark.parametrize("distance", [60.0, 85.0, 110.0])
def test_the_trailing_one_feels_nothing_before_a_wave_can_come(distance: float) -> None:
    """The fastest wave that mesh and step know runs with 204 m/s, its first forerunners a little earlier (10 %).

    What carries a force are long waves: the first newton comes with c = 121.7 m/s, give or take how steeply it rises.
    """
    most = max(fastest(wire, 1.0, 1e-3) for wire in (CARRIER_3_1, CONTACT_3_1))
    assert most == pytest.approx(204.0, abs=1.0)
    r = of_table()
    _, back = r.ride_together([(PANTOGRAPH, 0.0, None), (PANTOGRAPH, distance, None)], 1.2, ramp=0.05)
    alone = of_table(start_position=420.0 - distance).ride(PANTOGRAPH, 1.2, ramp=0.05)
    felt = np.abs(back.F - alone.F)
    assert felt[alone.t < 0.9 * distance / (most + 60.0)].max() < 1e-8
    first = alone.t[np.argmax(felt > 1.0)]
    assert first == pytest.approx(distance / (CONTACT_3_1.wave_speed + 60.0), rel=0.15)


@pytest.mark.parametrize("places", [(0.0, 2.0), (0.0, 2.0, 25.0), (0.0, 1.0, 3.0, 4.5)])
def test_every_contact_keeps_its_law_and_the_wire_its_answer(places: tuple[float, ...]) -> None:
    """F = k_c (head - w) or nothing at every contact and step, and pushing with these forces gives these heights.

    Heads and heights are of the state after all forces: contacts 1 m apart, which feel each other within the step, are
    solved together. k_c = 50 kN/m makes 1e-13 m 5e-9 N.
    """
    r = of_table(speed=70.0, time_step=2e-3)
    kinds = (PANTOGRAPH, THREE, PANTOGRAPH, THREE)
    entries = [Mounted(kind, behind) for kind, behind in zip(kinds, places, strict=False)]
    records = r.ride_together(entries, 1.5, ramp=0.1)
    assert r.unsettled_steps == 0
    lost = 0
    for record, entry in zip(records, entries, strict=True):
        law = np.maximum(0.0, entry.pantograph.contact_stiffness * (record.head - record.w))
        np.testing.assert_allclose(record.F, law, atol=1e-6)
        lost += int((record.F == 0.0).sum())
    assert lost > 0
    pushed = r.push_together(np.column_stack([record.F for record in records]), places)
    for record, given_force in zip(records, pushed, strict=True):
        np.testing.assert_allclose(given_force.w, record.w, atol=1e-11)
        np.testing.assert_allclose(given_force.v, record.v, atol=1e-8)
    assert abs(r.state.between[0, 1]) > 1e-3 * r.state.between[0, 0]


def test_order_does_not_matter() -> None:
    """Whoever is named first: each keeps its place and its record, to the last bit."""
    entries = [Mounted(PANTOGRAPH, 0.0), Mounted(THREE, 12.0), Mounted(PANTOGRAPH, 47.0, 150.0)]
    r = of_table()
    records = r.ride_together(entries, 0.5, ramp=0.1)
    for order in itertools.permutations(range(3)):
        again = r.ride_together([entries[i] for i in order], 0.5, ramp=0.1)
        for i, record in zip(order, again, strict=True):
            np.testing.assert_array_equal(record.F, records[i].F)
            np.testing.assert_array_equal(record.zeta, records[i].zeta)


@given(data=st.data(), n=st.integers(1, 4))
def test_contacts_are_the_one_set_of_forces_that_keeps_all_signs(data: st.DataObject, n: int) -> None:
    """Against all 2^n states: no force below 0, no head without force above the wire."""
    numbers = st.floats(-1.0, 1.0)
    L = np.array(data.draw(st.lists(st.lists(numbers, min_size=n, max_size=n), min_size=n, max_size=n)))
    wire = 1e-5 * (L @ L.T)
    free = 1e-3 * np.array(data.draw(st.lists(numbers, min_size=n, max_size=n)))
    small = Reference(Config(spans=4, element_length=2.0, time_step=2e-3))
    small.push_together(np.zeros((1, n)), [2.0 * p for p in range(n)])
    t = train.train([Mounted(THREE, 2.0 * p) for p in range(n)], [0.0] * n, 2e-3, 0.25, 0.5)
    own = 0.25 * 2e-3**2 * np.array([t.constants.inverse[h, h] for h in t.head])
    t.free[:] = free
    small.state.between[:] = wire
    small.state.point[:, 3] = 0.0  # w_free
    train.push(t, small.state)
    A = wire + np.diag(own + t.flexibility)
    found = []
    for on in itertools.product([False, True], repeat=n):
        some, force = np.flatnonzero(on), np.zeros(n)
        force[some] = np.linalg.solve(A[np.ix_(some, some)], free[some])
        if (force >= -1e-12).all() and (free - A @ force <= 1e-15)[~np.array(on)].all():
            found.append(force)
    assert found
    for force in found:  # several only where a force is nothing
        np.testing.assert_allclose(t.force, np.maximum(force, 0.0), atol=1e-9)


def test_energy_balance_of_every_step_with_two() -> None:
    """As with one: the line gains the mean of each force times the wire's displacement at its place, to rounding."""
    journey = over_time([0.0, 0.08, 0.2], [5.0, 60.0, 20.0])
    r = reference(line=line_without_loss(), ends="clamped", start_position=87.3, travel=journey)
    apart = np.array([0.0, 6.5])
    forces = np.column_stack([pulse(200, 20.0), pulse(200, -12.0)])

    def lift(zeta: np.ndarray) -> np.ndarray:
        return np.array([r.height(x) - r.height_at_rest(x) for x in zeta.tolist()])

    before, zeta, last, worst, work = 0.0, 87.3 - apart, np.zeros(2), 0.0, 0.0
    r.push_together(np.zeros((1, 2)), apart.tolist())
    r.reset()
    for k, force in enumerate(forces):
        now = 87.3 + journey.at(TS * (k + 1))[0] - apart
        old = lift(zeta), lift(now)
        records = r.push_together(force[np.newaxis], apart.tolist(), fresh=False)
        assert records[0].slack[0] == 0
        assert [record.zeta[0] for record in records] == now.tolist()
        done = float(0.5 * (last @ (lift(zeta) - old[0]) + force @ (lift(now) - old[1])))
        total = energy(r)
        worst = max(worst, abs(total - before - done))
        before, zeta, last, work = total, now, force, work + done
    assert before > 0.01
    assert work == pytest.approx(before, rel=1e-9)
    assert worst < 1e-9 * before + 1e-12


def test_energy_that_two_heads_give_while_the_train_stands() -> None:
    """At speed 0, without damping: wires and contact springs hold what both heads gave them, to rounding."""
    lossless = [
        dataclasses.replace(kind, damping=0.0 * kind.damping, uplift=0.1 * kind.uplift) for kind in (PANTOGRAPH, THREE)
    ]
    r = reference(line=line_without_loss(), ends="clamped", start_position=110.0)
    records = r.ride_together([Mounted(lossless[0]), Mounted(lossless[1], 3.0)], 0.3, ramp=0.2)
    assert not records[0].slack.any()
    gained = energy(r)
    given_to_wire = 0.0
    for record, start in zip(records, (110.0, 107.0), strict=True):
        w = np.concatenate([[r.height_at_rest(start)], record.w])
        F = np.concatenate([[0.0], record.F])
        given_to_wire += float((0.5 * (F[1:] + F[:-1]) * np.diff(w)).sum())
        # the spring between takes the rest of what the head gives
        head = np.concatenate([[r.height_at_rest(start)], record.head])
        spring = float((0.5 * (F[1:] + F[:-1]) * np.diff(head - w)).sum())
        k = lossless[0].contact_stiffness if start == 110.0 else lossless[1].contact_stiffness
        assert (record.F > 0.0).all()
        assert spring == pytest.approx(0.5 * F[-1] ** 2 / k, rel=1e-6)
    assert gained == pytest.approx(given_to_wire, rel=1e-8)
    assert gained > 0.01


@pytest.mark.slow
def test_a_span_apart_at_rest_both_find_the_same() -> None:
    """In the middle of two neighbouring spans: equal forces and heights, those of the statics under both forces."""
    damped = dataclasses.replace(
        LINE,
        carrier=dataclasses.replace(CARRIER_3_1, damping=20.0),
        contact=dataclasses.replace(CONTACT_3_1, damping=20.0),
    )
    kind = dataclasses.replace(PANTOGRAPH, uplift=0.25 * PANTOGRAPH.uplift)
    r = reference(line=damped, spans=4, start_position=125.0, ends="clamped")
    front, back = r.ride_together([Mounted(kind), Mounted(kind, 50.0)], 15.0)
    assert front.slack[-1] == 0
    np.testing.assert_allclose(front.F, back.F, atol=1e-7)
    np.testing.assert_allclose(front.w, back.w, atol=1e-11)
    frame = (65.0 + 4200.0 * front.head[-1]) / 4250.0
    assert front.F[-1] == pytest.approx(65.0 - 50.0 * frame, abs=0.02)
    K = wire_matrices(damped, r.mesh)[2]
    s = r.sites
    g = incidence(r.mesh, s.position, (s.kind != 2).astype(float), np.choose(s.kind, [-1.0, 0.0, 1.0]))
    K = (K + g.T @ diags_array(s.stiffness) @ g).tocsc()
    inner = np.arange(4, K.shape[0] - 4)
    points = incidence(r.mesh, np.array([125.0, 75.0]), np.zeros(2), np.ones(2)).toarray()[:, inner]
    lift = spsolve(K[inner][:, inner], points.T @ [front.F[-1], back.F[-1]])
    assert points[0] @ lift == pytest.approx(front.w[-1] - r.height_at_rest(125.0), rel=1e-4)


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ((0.0, -5.0), r"pantographs\[1\].behind = -5 m: allowed is 0 m \(the leading one\) or more"),
        ((0.0, math.nan), r"pantographs\[1\].behind = nan m: allowed is 0 m"),
        ((0.0, 0.0), r"pantographs\[1\].behind = 0 m: allowed is at least 1 m \(an element of the mesh\)"),
        (
            (0.0, 50.0, 49.4),
            r"pantographs\[2\].behind = 49.4 m: allowed is at least 1 m .* from pantographs\[1\] at 50 m",
        ),
        ((0.0, 500.0), r"pantographs\[1\].behind = 500 m: allowed is at most 3\d\d.* m, where the meshed track begins"),
        ((20.0, 10.0), "pantographs: the first is 10 m behind; allowed is 0 m for the one that leads"),
        ((), "pantographs: there are none"),
    ],
)
def test_a_place_on_the_train_that_is_not_allowed_is_named(places: tuple[float, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        of_table().ride_together([(PANTOGRAPH, behind, None) for behind in places], 0.1)


def test_forces_that_do_not_fit_are_refused() -> None:
    r = of_table()
    with pytest.raises(ValueError, match=r"force has shape \(5, 1\); allowed is \(steps, 2\)"):
        r.push_together(np.zeros((5, 1)), [0.0, 10.0])
    with pytest.raises(ValueError, match=r"behind\[1\] = 500 m: allowed is at most"):
        r.push_together(np.zeros((5, 2)), [0.0, 500.0])
    with pytest.raises(ValueError, match="distances that rise from 0 m on"):
        r.push_together(np.zeros((5, 2)), [10.0, 0.0])
    with pytest.raises(ValueError, match=r"pantographs\[0\].static_force = nan N"):
        r.ride_together([(PANTOGRAPH, 0.0, math.nan)], 0.1)
