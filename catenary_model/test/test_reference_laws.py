"""Laws that the catenary-fixed line must keep."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Dropper, Line, Mast, Span, SteadyArm
from catenary_model.reference import Config, Reference, step
from catenary_model.reference.equilibrium import incidence, wire_matrices

SPAN = Span(
    50.0,
    tuple(Dropper(p, mass=0.5) for p in (5.0, 15.0, 25.0, 35.0, 45.0)),
    steady_arm=SteadyArm(stiffness=200.0, mass=1.0),
)
LINE = Line(spans=(SPAN,))
TS = 1e-3


def line_without_loss() -> Line:
    carrier, contact = (dataclasses.replace(wire, damping=0.0) for wire in (CARRIER_3_1, CONTACT_3_1))
    return dataclasses.replace(LINE, carrier=carrier, contact=contact)


def reference(**changes: object) -> Reference:
    given: dict = {"line": LINE, "speed": 0.0, "spans": 4, "element_length": 0.5, "time_step": TS}
    return Reference(Config(**{**given, **changes}))


def pulse(steps: int, force: float = 1.0) -> np.ndarray:
    """A smooth push of 60 ms."""
    t = TS * np.arange(1, steps + 1)
    return force * np.where(t < 0.06, np.sin(np.pi * t / 0.06) ** 2, 0.0)


def energy(r: Reference) -> float:
    """Kinetic and elastic energy of the deviation while all droppers are taut, J; with the links' own masses."""
    M, _, K = wire_matrices(r.config.line, r.mesh)
    q, v = (r.state.q[d].T.ravel() for d in (0, 1))
    total = 0.5 * v @ (M @ v) + 0.5 * q @ (K @ q)
    s = r.sites
    ones, zeros = np.ones(s.kind.size), np.zeros(s.kind.size)
    ca, co = incidence(r.mesh, s.position, ones, zeros), incidence(r.mesh, s.position, zeros, ones)
    between, carried = s.kind == 0, s.kind == 1
    stretch = np.where(between, (ca - co) @ q, np.where(carried, ca @ q, co @ q))
    total += 0.5 * (s.stiffness * stretch**2).sum()
    for mass, moved in ((s.carrier_mass, ca), (s.contact_mass, co)):
        total += 0.5 * (mass * (moved @ v) ** 2).sum()
    return float(total)


def test_energy_balance_of_every_step() -> None:
    """Newmark 1/4, 1/2 without damping, clamped: energy grows by the work of the mean force, to rounding."""
    r = reference(line=line_without_loss(), ends="clamped", start_position=87.3)
    forces = pulse(200, 20.0)
    before, height, worst, peak = 0.0, r.height(87.3), 0.0, 0.0
    for k in range(forces.size):
        record = r.push(forces[k : k + 1], fresh=k == 0)
        assert record.slack[0] == 0
        now = energy(r)
        mean = 0.5 * (forces[k] + (forces[k - 1] if k else 0.0))
        worst = max(worst, abs(now - before - mean * (record.w[0] - height)))
        before, height, peak = now, record.w[0], max(peak, now)
    assert peak > 0.01
    # displacements are kept to 1e-16 of 10 mm, and stiffness turns that into energy: 1e-9 is a thousandth of 1e-6
    assert worst < 1e-9 * peak + 1e-12


def test_energy_only_falls_with_damping_and_open_ends() -> None:
    """After the push nothing feeds the wires: the energy never rises, and waves leave through the matched ends."""
    r = reference(start_position=100.0, spans=4)
    r.push(pulse(80, 30.0))
    energies = []
    for _ in range(40):
        r.push(np.zeros(50), fresh=False)
        energies.append(energy(r))
    assert (np.diff(energies) < 0.0).all()
    assert energies[-1] < 0.2 * energies[0]


def test_symmetry_at_rest() -> None:
    """A symmetric line pushed in the middle of a span answers the same to either side, to rounding."""
    r = reference(spans=5, start_position=125.0)
    r.push(pulse(400, 80.0))
    q = r.state.q[0]
    scale = np.abs(q[[0, 2]]).max()
    np.testing.assert_allclose(q[[0, 2]], q[[0, 2], ::-1], atol=1e-10 * scale)
    np.testing.assert_allclose(q[[1, 3]], -q[[1, 3], ::-1], atol=1e-10 * scale)
    assert scale > 1e-3


@settings(max_examples=10)
@given(a=st.floats(60.0, 140.0), b=st.floats(60.0, 140.0))
@pytest.mark.slow
def test_reciprocity(a: float, b: float) -> None:
    """What b feels of a push at a is what a feels of the same push at b; droppers, masses, arms, dashpots included."""
    answers = []
    for here, there in ((a, b), (b, a)):
        r = reference(start_position=here)
        at_rest = r.height(there)
        felt = np.zeros(10)
        for k in range(felt.size):
            assert not r.push(pulse(300)[30 * k : 30 * k + 30], fresh=k == 0).slack.any()
            felt[k] = r.height(there) - at_rest
        answers.append(felt)
    np.testing.assert_allclose(answers[0], answers[1], atol=1e-10 * np.abs(answers).max() + 1e-15)


def test_linear_while_no_dropper_changes() -> None:
    """Twice the push, twice the answer, to rounding."""
    r = reference(start_position=80.0)
    r.push(pulse(200, 1.0))
    once = r.state.q.copy()
    r.push(pulse(200, 2.0))
    for twice, single in zip(r.state.q, once, strict=True):  # displacement, velocity, acceleration
        np.testing.assert_allclose(twice, 2.0 * single, atol=1e-9 * np.abs(single).max())


def test_static_deflection_of_a_tensioned_beam() -> None:
    """A constant force on a damped, clamped wire without droppers: w = F/(2 T) (L/2 - 2 lambda tanh(L/(4 lambda)))."""
    wire = dataclasses.replace(CONTACT_3_1, damping=30.0)
    line = Line(contact=wire, spans=(Span(30.0, ()),))
    r = Reference(
        Config(line=line, speed=0.0, spans=1, element_length=0.1, time_step=2e-3, start_position=15.0, ends="clamped")
    )
    force, lam = 100.0, math.sqrt(wire.bending_stiffness / wire.tension)
    record = r.push(np.full(3000, force))
    closed = force / (2.0 * wire.tension) * (15.0 - 2.0 * lam * math.tanh(30.0 / (4.0 * lam)))
    # damping decays with beta/(2 rhoA) = 11/s; 0.1 m elements resolve 9 cm of bending to some 1e-4
    assert record.w[-1] == pytest.approx(closed, rel=2e-4)


def test_static_deflection_of_the_line() -> None:
    """A constant force on the line, after the waves: the same as pushing every dropper's spring in a sparse solve."""
    damped = dataclasses.replace(
        LINE,
        carrier=dataclasses.replace(CARRIER_3_1, damping=20.0),
        contact=dataclasses.replace(CONTACT_3_1, damping=20.0),
        spans=(dataclasses.replace(SPAN, mast=Mast(stiffness=2e4)),),
    )
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import spsolve

    r = reference(line=damped, start_position=91.7, ends="clamped")
    record = r.push(np.full(6000, 10.0))
    assert record.slack[-1] == 0
    K = wire_matrices(damped, r.mesh)[2]
    s = r.sites
    g = incidence(r.mesh, s.position, (s.kind != 2).astype(float), np.choose(s.kind, [-1.0, 0.0, 1.0]))
    K = (K + g.T @ diags_array(s.stiffness) @ g).tocsc()
    inner = np.arange(4, K.shape[0] - 4)
    p = incidence(r.mesh, np.array([91.7]), np.zeros(1), np.ones(1)).toarray()[0]
    closed = p[inner] @ spsolve(K[inner][:, inner], 10.0 * p[inner])
    assert record.w[-1] - r.height_at_rest(91.7) == pytest.approx(closed, rel=1e-6)


@pytest.mark.parametrize(("name", "sizes", "order"), [("dx", (2.0, 1.5, 1.2), 4.5), ("dt", (4e-3, 2e-3, 1e-3), 2.0)])
def test_order_of_convergence(name: str, sizes: tuple[float, ...], order: float) -> None:
    """A smooth wave on a bare contact wire against its exact spectral solution: dx at least 4, dt 2."""
    line = Line(spans=(Span(60.0, ()),))
    wire, length, middle, width, time = CONTACT_3_1, 240.0, 120.0, 3.0, 0.2
    errors = []
    for size in sizes:
        h, ts = (size, 5e-5) if name == "dx" else (0.5, size)
        r = Reference(Config(line=line, speed=0.0, spans=4, element_length=h, time_step=ts, start_position=middle))
        n = r.mesh.elements
        k = 2 * np.pi * np.fft.rfftfreq(n, length / n)
        shape = np.fft.rfft(1e-2 * np.exp(-0.5 * ((length / n * np.arange(n) - middle) / width) ** 2))
        square = (wire.tension * k**2 + wire.bending_stiffness * k**4) / wire.mass_per_length
        half = 0.5 * wire.damping / wire.mass_per_length
        omega = np.sqrt(square - half**2 + 0j)
        swing = np.exp(-half * time) * (np.cos(omega * time) + half / omega * np.sin(omega * time)).real
        for d, part in ((0, np.ones_like(k)), (2, -square)):
            r.state.q[d, 2, :-1] = np.fft.irfft(part * shape, n)
            r.state.q[d, 3, :-1] = np.fft.irfft(1j * k * part * shape, n)
        r.push(np.zeros(round(time / ts)), fresh=False)
        exact = np.fft.irfft(swing * shape, n)
        errors.append(np.sqrt(((r.state.q[0, 2, :-1] - exact) ** 2).mean() / (exact**2).mean()))
    found = np.log(np.array(errors[:-1]) / errors[1:]) / np.log(np.array(sizes[:-1]) / sizes[1:])
    assert errors[-1] < 0.004
    if name == "dx":
        assert (found > order - 0.5).all()
    else:
        assert found == pytest.approx([order, order], abs=0.1)


def test_contact_stiffness_under_a_dropper_and_between() -> None:
    """The wire's compliance in one step is positive, and smaller where a clamp with its mass and spring holds it."""
    r = reference(start_position=75.0, time_step=5e-3)
    r.push(np.zeros(1))
    at_clamp = r.state.point[0, step.COMPLIANCE]
    r = reference(start_position=80.0, time_step=5e-3)
    r.push(np.zeros(1))
    assert 0.0 < at_clamp < r.state.point[0, step.COMPLIANCE]


def test_ends_do_not_disturb_the_middle() -> None:
    """Both kinds of ends give the same until a wave has been there and back: 100 m at 122 m/s is 0.8 s each way."""
    records = [
        reference(spans=6, ends=ends, start_position=130.0, speed=40.0).push(np.full(700, 60.0))
        for ends in ("matched_dashpot", "clamped")
    ]
    early = records[0].t < 0.7
    np.testing.assert_allclose(records[0].w[early], records[1].w[early], atol=2e-6)
