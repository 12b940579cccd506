"""The coupled pantograph on wires whose answer is known: closed forms, contact loss and return."""

import math

import numpy as np
import pytest

from catenary_model import pantograph
from catenary_model.pantograph import Pantograph

EN50318 = Pantograph.of([15.0, 7.2], [[100.0, -10.0], [-10.0, 10.0]], [[4250.0, -4200.0], [-4200.0, 4200.0]], 120.0)


def run(p: Pantograph, wire: np.ndarray, ts: float, start: float = 0.0, compliance: float = 0.0) -> np.ndarray:
    """Force at every step on a wire that answers wire[k] + compliance F."""
    c, s = pantograph.constants(p, ts, 0.25, 0.5), pantograph.at_rest(p, start)
    s.y[2] = np.linalg.solve(p.mass, p.uplift - p.stiffness @ s.y[0])  # the uplift acts from the start
    forces = np.zeros(wire.size)
    for k, height in enumerate(wire):
        head = pantograph.free(c, s, 1.0)
        forces[k] = pantograph.contact_force(c, head, height, compliance)
        pantograph.finish(c, s, forces[k])
        # what was solved for holds: the spring's law at the new instant, one-sided
        gap = s.y[0, -1] - height - compliance * forces[k]
        assert forces[k] == pytest.approx(max(0.0, p.contact_stiffness * gap), rel=1e-6, abs=1e-6)
    return forces


@pytest.mark.slow
def test_static_force_on_a_rigid_wire() -> None:
    """At rest the force is what the frame's spring leaves of the uplift: F = f_up - k_1 y_1."""
    forces = run(EN50318, np.full(60_000, 0.05), 1e-3, start=0.05)
    K = EN50318.stiffness + np.diag([0.0, EN50318.contact_stiffness])
    y = np.linalg.solve(K, EN50318.uplift + np.array([0.0, EN50318.contact_stiffness * 0.05]))
    assert forces[-1] == pytest.approx(EN50318.contact_stiffness * (y[1] - 0.05), rel=1e-9)
    assert forces[-1] == pytest.approx(120.0 - 50.0 * y[0], rel=1e-9)


@pytest.mark.slow
def test_wavy_rigid_wire_converges_with_order_two() -> None:
    """Steady force on a sinusoidal wire against the complex amplitude; the error falls with the square of the step."""
    omega, amplitude = 2.0 * math.pi * 3.0, 1e-3
    n = EN50318.uplift.size
    dynamic = EN50318.stiffness + 1j * omega * EN50318.damping - omega**2 * EN50318.mass
    dynamic[n - 1, n - 1] += EN50318.contact_stiffness
    load = np.zeros(n, dtype=complex)
    load[n - 1] = EN50318.contact_stiffness * amplitude
    y = np.linalg.solve(dynamic, load)[n - 1]
    expected = EN50318.contact_stiffness * (y - amplitude)
    errors = []
    for ts in (2e-3, 1e-3, 5e-4):
        t = ts * (1 + np.arange(round(40.0 / ts)))
        forces = run(EN50318, amplitude * np.sin(omega * t), ts)
        last = t > 39.0
        basis = np.column_stack([np.sin(omega * t[last]), np.cos(omega * t[last]), np.ones(last.sum())])
        a, b, _ = np.linalg.lstsq(basis, forces[last], rcond=None)[0]
        errors.append(abs(a + 1j * b - expected) / abs(expected))
    assert errors[-1] < 0.01
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)


@pytest.mark.slow
def test_bounce_against_a_rigid_wire() -> None:
    """A mass thrown up by a constant force: time of impact, peak force and return as in the closed form."""
    m, f, k, d = 10.0, 100.0, 50e3, 0.02
    p = Pantograph.of([m], [[0.0]], [[0.0]], f, k)
    ts = 1e-5
    forces = run(p, np.zeros(40_000), ts, start=-d)
    contact = forces > 0.0
    starts = np.flatnonzero(contact[1:] & ~contact[:-1]) + 1
    speed = math.sqrt(2.0 * f * d / m)
    omega = math.sqrt(k / m)
    # in contact: x(t) = (f/k)(1 - cos) + (speed/omega) sin, back at x = 0 after `stay`, thrown back with -speed
    stay = (2.0 * math.pi - 2.0 * math.atan2(speed * omega * m, f)) / omega
    fall = speed * m / f
    assert starts[0] * ts == pytest.approx(fall, abs=2 * ts)
    assert starts[1] * ts == pytest.approx(3.0 * fall + stay, abs=5 * ts)
    assert forces.max() == pytest.approx(f + math.hypot(f, speed * omega * m), rel=1e-4)  # order 2 in omega ts = 7e-4


@pytest.mark.slow
def test_wire_that_drops_away_is_caught_again() -> None:
    """Contact is lost when the wire jumps up and comes back; the late force is the static one."""
    wire = np.zeros(40_000)
    wire[15_000:15_200] = 0.05
    forces = run(EN50318, wire, 1e-3)
    assert forces[14_990] > 100.0
    assert (forces[15_000:15_010] == 0.0).all()
    # its slowest mode decays with 0.6/s or faster: 15 s leave less than 1e-4 of the static force of 118.5 N
    assert forces[-1] == pytest.approx(forces[14_999], abs=0.02)


def test_compliant_wire_is_a_spring_in_series() -> None:
    """W = C F behind k_c is one spring of compliance 1/k_c + C: same forces step by step, to rounding."""
    soft = 3e-5
    series = Pantograph(EN50318.mass, EN50318.damping, EN50318.stiffness, EN50318.uplift, 1.0 / (1.0 / 50e3 + soft))
    wire = 2e-3 * np.sin(np.arange(3_000) * 0.02)
    np.testing.assert_allclose(run(EN50318, wire, 1e-3, compliance=soft), run(series, wire, 1e-3), atol=1e-6)


def test_rigid_head() -> None:
    """Infinite contact stiffness: the head is on the wire wherever there is force."""
    p = Pantograph.of([10.0], [[20.0]], [[100.0]], 50.0, math.inf)
    c, s = pantograph.constants(p, 1e-3, 0.25, 0.5), pantograph.at_rest(p, 0.0)
    for k in range(2_000):
        height = 1e-3 * (1.0 - math.cos(0.01 * k))  # 0.1 m/s^2 at most: 1 N of inertia beside 50 N
        force = pantograph.contact_force(c, pantograph.free(c, s, 1.0), height, 1e-6)
        pantograph.finish(c, s, force)
        assert force > 0.0
        assert s.y[0, 0] == pytest.approx(height + 1e-6 * force, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"contact_stiffness": 0.0}, "contact_stiffness"),
        ({"damping": np.zeros((1, 1))}, "damping has shape"),
        ({"mass": np.diag([1.0, 0.0])}, "mass must be positive"),
        ({"stiffness": np.full((2, 2), np.nan)}, "stiffness must be finite"),
    ],
)
def test_what_cannot_be_is_refused(change: dict, message: str) -> None:
    given = {"mass": np.eye(2), "damping": np.eye(2), "stiffness": np.eye(2), "uplift": np.zeros(2)}
    with pytest.raises(ValueError, match=message):
        Pantograph(**{**given, **change})
