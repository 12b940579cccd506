"""The compiled reference against one dense system of everything, written without any of its tricks."""

import dataclasses
import doctest

import numpy as np
import pytest

from catenary_model import elements
from catenary_model.line import Dropper, Line, Mast, PointMass, Span, SteadyArm
from catenary_model.reference import Config, Pantograph, Reference, model, step
from catenary_model.reference.ride import Ride
from catenary_model.statics import DROPPER, MAST, POINT_MASS

TS = 1e-3
LINE = Line(
    spans=(
        Span(20.0, tuple(Dropper(p, mass=0.6) for p in (4.3, 10.0, 15.9)), mast=Mast(1e5, 0.7)),
        Span(
            23.0,
            tuple(Dropper(p) for p in (3.9, 8.0, 14.0, 19.5)),
            mast=Mast(5e5, 0.7),
            steady_arm=SteadyArm(stiffness=300.0, mass=1.2),
        ),
    )
)
PANTOGRAPH = Pantograph.of([15.0, 7.2], [[100.0, -10.0], [-10.0, 10.0]], [[4250.0, -4200.0], [-4200.0, 4200.0]], 260.0)
CONFIG = Config(line=LINE, speed=60.0, spans=5, element_length=1.0, time_step=TS, start_position=35.0)


RAYLEIGH = dataclasses.replace(
    LINE,
    carrier=dataclasses.replace(LINE.carrier, stiffness_damping=2e-3),
    contact=dataclasses.replace(LINE.contact, stiffness_damping=1e-4),
)
"""Damping in proportion to stiffness, b omega/2 of critical: for the carrier twenty times the usual 1e-4 s."""
MASSES = (PointMass(11.3, "contact", 2.0), PointMass(14.0, "carrier", 3.0), PointMass(16.2, "carrier", 0.7))
LOADED = dataclasses.replace(LINE, spans=(*LINE.spans[:-1], dataclasses.replace(LINE.spans[-1], masses=MASSES)))


class DenseRide:
    """Total heights (not deviations) of both wires and the pantograph in one dense Newmark system."""

    def __init__(self, reference: Reference, ends: str) -> None:
        self.r, self.mesh = reference, reference.mesh
        n = 4 * self.mesh.nodes + 2
        line, h = reference.config.line, self.mesh.h
        M, D, K, f = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
        droppers = (reference.sites.kind == DROPPER).any()
        for e in range(self.mesh.elements):
            for which, wire in ((0, line.carrier), (1, line.contact)):
                at = 4 * e + 2 * which + np.array([0, 1, 4, 5])
                at = np.ix_(at, at)
                M[at] += wire.mass_per_length * elements.mass(h)
                stiffness = wire.bending_stiffness * elements.bending(h) + wire.tension * elements.tension(h)
                D[at] += wire.damping * elements.mass(h) + wire.stiffness_damping * stiffness
                K[at] += stiffness
                if which == 0 or droppers:
                    load = h * np.array([0.5, h / 12, 0.5, -h / 12]) * wire.mass_per_length * line.gravity
                    f[at[0].ravel()] -= load
        W = np.append(reference.equilibrium.nodal.T.ravel(), [0.0, 0.0])
        self.springs = []
        s = reference.sites
        for i, zeta in enumerate(s.position):
            ca, co = self.shape(zeta, 0), self.shape(zeta, 1)
            if s.kind[i] in (DROPPER, POINT_MASS):
                if s.kind[i] == DROPPER:
                    self.springs.append((s.stiffness[i], ca - co, (ca - co) @ W - s.elongation[i]))
                for g, mass in ((ca, s.carrier_mass[i]), (co, s.contact_mass[i])):
                    M += mass * np.outer(g, g)
                    f -= mass * line.gravity * g
            elif s.kind[i] == MAST:
                K += s.stiffness[i] * np.outer(ca, ca)
                f += s.stiffness[i] * (ca @ W) * ca
            else:
                K += s.stiffness[i] * np.outer(co, co)
                f += s.stiffness[i] * (co @ W) * co
                M += s.contact_mass[i] * np.outer(co, co)
        if ends == "matched_dashpot":
            for node in (0, self.mesh.nodes - 1):
                for which, wire in ((0, line.carrier), (1, line.contact)):
                    D[(4 * node + 2 * which,) * 2] += np.sqrt(wire.tension * wire.mass_per_length)
                    K[(4 * node + 2 * which,) * 2] += 0.5 * wire.damping * np.sqrt(wire.tension / wire.mass_per_length)
        p = PANTOGRAPH
        M[-2:, -2:], D[-2:, -2:], K[-2:, -2:] = p.mass, p.damping, p.stiffness
        self.held = np.zeros(0, dtype=int)
        if ends == "clamped":
            self.held = np.r_[0:4, n - 6 : n - 2]
        # the reaction that holds the wires' ends and the masts at rest
        pull = f - K @ W
        for k, g, rest in self.springs:
            pull -= max(0.0, k * (g @ W - rest)) * g
        pull[-2:] = 0.0
        self.M, self.D, self.K, self.f = M, D, K, f - pull
        self.pull = pull
        self.q, self.v, self.a = W.copy(), np.zeros(n), np.zeros(n)
        self.q[-2:] = reference.height(reference.start_position)
        self.a[-2:] = np.linalg.solve(p.mass, -p.stiffness @ self.q[-2:])
        self.taut = [True] * len(self.springs)
        self.contact = True

    def shape(self, zeta: float, which: int) -> np.ndarray:
        e, psi = self.mesh.locate(float(zeta))
        g = np.zeros(4 * self.mesh.nodes + 2)
        g[4 * e + 2 * which + np.array([0, 1, 4, 5])] = psi
        return g

    def step(self, k: int, ramp: float) -> tuple[float, float]:
        c, t = self.r.config, k * TS
        b, gm = c.newmark_beta, c.newmark_gamma
        co = self.shape(self.r.start_position + c.speed * t, 1)
        gap = -co
        gap[-1] = 1.0
        f = self.f.copy()
        f[-2] += PANTOGRAPH.uplift[0] * (0.5 - 0.5 * np.cos(np.pi * t / ramp) if t < ramp else 1.0)
        qp = self.q + TS * self.v + TS**2 * (0.5 - b) * self.a
        vp = self.v + TS * (1 - gm) * self.a
        free = np.setdiff1d(np.arange(f.size), self.held)
        for _ in range(30):
            K, load = self.K.copy(), f.copy()
            active = [(s, on) for s, on in zip(self.springs, self.taut, strict=True)]
            active.append(((PANTOGRAPH.contact_stiffness, gap, 0.0), self.contact))
            for (stiffness, g, rest), on in active:
                if on:
                    some = np.flatnonzero(g)
                    K[np.ix_(some, some)] += stiffness * np.outer(g[some], g[some])
                    load += stiffness * rest * g
            system = self.M + gm * TS * self.D + b * TS**2 * K
            right = load - self.D @ vp - K @ qp
            a = np.zeros(f.size)
            a[free] = np.linalg.solve(system[np.ix_(free, free)], right[free])
            q = qp + b * TS**2 * a
            found = [bool(g @ q > rest) for (_, g, rest), _ in active]
            if found[:-1] == self.taut and found[-1] == self.contact:
                break
            self.taut, self.contact = found[:-1], found[-1]
        else:
            raise AssertionError("no consistent state")
        self.q, self.v, self.a = q, vp + gm * TS * a, a
        return float(co @ q), max(0.0, PANTOGRAPH.contact_stiffness * float(gap @ q))


@pytest.mark.parametrize(
    ("ends", "line"),
    [
        ("matched_dashpot", LINE),
        ("clamped", LINE),
        ("matched_dashpot", RAYLEIGH),
        ("clamped", RAYLEIGH),
        ("matched_dashpot", LOADED),
    ],
)
@pytest.mark.slow
def test_ride_equals_dense_system(ends: str, line: Line) -> None:
    """Rounding only, with slack droppers, lumped masses, arms, both ends: 1e-8 of force and deviation over 0.25 s."""
    steps, ramp = 250, 0.1
    reference = Reference(Config(**{**CONFIG.__dict__, "ends": ends, "line": line}))
    dense = DenseRide(reference, ends)
    record = reference.ride(PANTOGRAPH, steps * TS, ramp=ramp)
    slack = np.zeros(steps, dtype=int)
    w, F = np.zeros(steps), np.zeros(steps)
    for k in range(steps):
        w[k], F[k] = dense.step(k + 1, ramp)
        slack[k] = dense.taut.count(False)
    assert reference.unsettled_steps == 0
    assert slack.max() >= 2
    assert F.max() > 250.0
    np.testing.assert_array_equal(record.slack, slack)
    np.testing.assert_allclose(record.F, F, atol=1e-8 * F.max())
    np.testing.assert_allclose(record.w, w, atol=1e-8 * np.abs(w).max())
    deviation = dense.q[:-2].reshape(-1, 4).T - reference.equilibrium.nodal
    np.testing.assert_allclose(reference.state.q[0], deviation, atol=1e-8 * np.abs(deviation).max())


def fast_ride(**changes: object) -> tuple[Reference, Ride]:
    reference = Reference(Config(**{**CONFIG.__dict__, **changes}))
    return reference, reference.ride(PANTOGRAPH, 0.4, ramp=0.1)


def test_two_rides_are_the_same_to_the_last_bit() -> None:
    reference, first = fast_ride()
    again = reference.ride(PANTOGRAPH, 0.4, ramp=0.1)
    np.testing.assert_array_equal(first.F, again.F)
    np.testing.assert_array_equal(first.w, again.w)


def test_rest_without_force_is_exact() -> None:
    """No deviation at all, however long and fast: the contact point reads the static wire."""
    reference = Reference(CONFIG)
    record = reference.push(np.zeros(500))
    assert not reference.state.q.any()
    expected = [reference.height(float(zeta)) for zeta in record.zeta[::50]]
    np.testing.assert_allclose(record.w[::50], expected, atol=1e-15)
    rise = np.cumsum(0.5 * (record.v[1:] + record.v[:-1])) * TS
    np.testing.assert_allclose(rise, record.w[1:] - record.w[0], atol=0.01 * np.ptp(record.w))


def test_velocity_is_the_rate_of_the_displacement() -> None:
    """W and v along the ride: the trapezoidal sum of v gives w back to 1 % of its range (order 2 in a 1 ms step)."""
    _, record = fast_ride()
    rise = np.cumsum(0.5 * (record.v[1:] + record.v[:-1])) * TS
    np.testing.assert_allclose(rise, record.w[1:] - record.w[0], atol=0.01 * np.ptp(record.w))


def test_push_with_the_forces_of_a_ride_repeats_it() -> None:
    """The wire does not know who pushes: to rounding of the force in the last bit."""
    reference, record = fast_ride()
    pushed = reference.push(record.F)
    np.testing.assert_allclose(pushed.w, record.w, atol=1e-12)
    np.testing.assert_array_equal(pushed.slack, record.slack)
    assert np.isnan(pushed.head).all()


def test_snapshots_and_progress() -> None:
    seen: list[float] = []
    reference = Reference(CONFIG)
    record = reference.ride(PANTOGRAPH, 0.1, ramp=0.1, snapshot_every=0.03, progress=seen.append)
    np.testing.assert_allclose(record.snapshot_t, [0.03, 0.06, 0.09, 0.1])
    assert record.snapshots.shape == (4, 2, reference.mesh.nodes)
    np.testing.assert_array_equal(record.snapshots[-1], reference.heights())
    assert seen[-1] == 1.0
    assert record.uplift.shape == (100, 6)
    between = record.between(36.0, 37.0)
    assert (record.zeta[between] >= 36.0).all() and (record.zeta[between] < 37.0).all() and between.any()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ends": "open"}, "ends"),
        ({"element_length": 0.0}, "element_length"),
        ({"speed": -1.0}, "speed"),
        ({"newmark_gamma": 0.4}, "newmark_gamma"),
        ({"spans": 0}, "spans"),
        ({"start_position": 0.5}, "contact point"),
    ],
)
def test_what_cannot_be_built_is_refused(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Reference(Config(**{**CONFIG.__dict__, **changes}))


def test_ride_off_the_mesh_is_refused() -> None:
    with pytest.raises(ValueError, match="contact point"):
        Reference(CONFIG).ride(PANTOGRAPH, 5.0)


def test_slack_dropper_gives_up_its_static_force() -> None:
    """Lifted hard enough the clamp is free: the state says so, and its force is -F_s beyond rest."""
    reference, record = fast_ride()
    k = int(record.slack.argmax())
    reference.push(record.F[: k + 1])
    slack = np.flatnonzero(reference.state.acting == 0)
    assert slack.size == record.slack[k] > 0
    np.testing.assert_array_equal(reference.state.force[1, slack], -reference.links.rest[slack, 1])
    stretch = [
        reference.links.rest[j, 0] + step.elongation(reference.links, j, reference.state.q[0]) for j in slack.tolist()
    ]
    assert max(stretch) <= 0.0


def test_example_in_the_documentation() -> None:
    result = doctest.testmod(model)
    assert result.attempted > 0
    assert result.failed == 0
