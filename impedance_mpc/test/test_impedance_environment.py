"""Environments that the controller simulates itself, against closed forms; and how a gap to them is closed."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from impedance_loop import TS, random_impedance

from impedance_mpc.approach import GENTLE, Approach
from impedance_mpc.controller import EnvironmentReading
from impedance_mpc.environment import LinearEnvironment, mass_spring_damper, standing_alone
from impedance_mpc.environment_parameters import MassSpringDamper, ReducedEnvironment
from impedance_mpc.plant import Impedance, newmark_state_space

MSD = MassSpringDamper(mass=20.0, stiffness=2000.0, damping=300.0)
NONE = np.zeros(0)


def at(w: float, v: float, f: float) -> EnvironmentReading:
    """Another environment of an unknown kind at this place."""
    return EnvironmentReading(NONE, NONE, NONE, NONE, w, v, f)


def wire(n: int = 21) -> Impedance:
    """A tensioned string of 2 m elements without any support: free to drift."""
    h, density, tension = 2.0, 1.35, 2e4
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e in range(n - 1):
        i = slice(e, e + 2)
        mass[i, i] += density * h / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
        stiffness[i, i] += tension / h * np.array([[1.0, -1.0], [-1.0, 1.0]])
    b = np.zeros(n)
    b[n // 2] = 1.0
    return Impedance(mass, 0.2 * mass, stiffness, b, b, TS, 0.28, 0.55, 2.6e-6)


def test_the_step_is_newmarks() -> None:
    """Against the matrices that the controller predicts with; 1e-9 relative is rounding of a few hundred steps."""
    model = random_impedance(5)
    own, reference = LinearEnvironment(model), newmark_state_space(model)
    own.begin(at(0.01, 0.2, 50.0), 80.0, at(0.01, 0.2, 50.0))
    start = own.reading()
    x = np.concatenate([start.displacement, start.velocity, start.acceleration])
    for k in range(300):
        force = 80.0 + 60.0 * math.sin(0.05 * k)
        held = own.reading().held.copy()
        own.step(force)
        x = reference.a @ x + reference.b * force + reference.b_force @ held
        found = own.reading()
        np.testing.assert_allclose([found.w, found.v], reference.c @ x, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.displacement, x[:5], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("model", [mass_spring_damper(MSD, TS), wire()], ids=["mass", "wire"])
def test_it_begins_where_the_other_one_is_and_rests_there_under_the_mean_force(model: Impedance) -> None:
    if model.n > 1:
        model = standing_alone(model, ReducedEnvironment(frequency_hz=1.0, damping_ratio=0.5))
    own = LinearEnvironment(model)
    own.begin(at(0.045, 0.3, 90.0), 120.0, at(0.045, 0.3, 90.0))
    begun = own.reading()
    assert (begun.w, begun.f, begun.work, begun.impulse) == (0.045, 90.0, 0.0, 0.0)
    assert begun.v == pytest.approx(0.3, rel=1e-12)
    # The equation of motion holds at the first instant.
    rest = model.mass @ begun.acceleration + model.damping @ begun.velocity + model.stiffness @ begun.displacement
    np.testing.assert_allclose(rest, begun.held + 90.0 * model.input, atol=1e-8 * np.abs(rest).max())
    for _ in range(10000):
        own.step(120.0)
    assert own.reading().w == pytest.approx(0.045, abs=1e-9)
    assert abs(own.reading().v) < 1e-9


def test_mass_spring_damper_answers_like_its_closed_form() -> None:
    """Step of 50 N, w = F/k (1 - e^(-s t) (cos w_d t + s/w_d sin w_d t)).

    The force comes up within a cycle, which is a delay by half of it; Newmark is off by (w Ts)^2 / 12 = 3e-5.
    """
    model = mass_spring_damper(MSD, TS)
    own = LinearEnvironment(model)
    own.begin(at(0.02, 0.0, 100.0), 100.0, at(0.02, 0.0, 100.0))
    sigma = MSD.damping / (2.0 * MSD.mass)
    omega = math.sqrt(MSD.stiffness / MSD.mass - sigma**2)
    for k in range(300):
        own.step(150.0)
        t = TS * (k + 0.5)
        swing = math.exp(-sigma * t) * (math.cos(omega * t) + sigma / omega * math.sin(omega * t))
        expected = 50.0 / MSD.stiffness * (1.0 - swing)
        assert own.reading().w - 0.02 == pytest.approx(expected, abs=1e-4 * 50.0 / MSD.stiffness)


def test_work_is_what_the_parts_have_taken() -> None:
    """No damping, Newmark 1/4, 1/2: the work of the force is in mass and spring; held force is part of the load."""
    model = mass_spring_damper(MassSpringDamper(mass=20.0, stiffness=2000.0, damping=0.0), TS)
    own = LinearEnvironment(model)
    own.begin(at(0.0, 0.0, 0.0), 0.0, at(0.0, 0.0, 0.0))
    impulse, before = 0.0, 0.0
    for k in range(500):
        force = 100.0 * math.sin(0.02 * k) ** 2
        own.step(force)
        impulse += 0.5 * TS * (before + force)
        before = force
    found = own.reading()
    assert found.work == pytest.approx(0.5 * 20.0 * found.v**2 + 0.5 * 2000.0 * found.w**2, rel=1e-9)
    assert found.impulse == pytest.approx(impulse, rel=1e-12)


def test_the_reduced_model_keeps_the_shape_of_the_segment_it_takes_over() -> None:
    model = wire()
    own = LinearEnvironment(standing_alone(model, ReducedEnvironment(frequency_hz=1.0, damping_ratio=0.3)))
    random = np.random.default_rng(3)
    q, qd = random.normal(scale=0.01, size=21), random.normal(scale=0.1, size=21)
    c = model.output
    segment = EnvironmentReading(q, qd, q, q, float(c @ q), float(c @ qd), 100.0)
    own.begin(segment, 120.0, segment)
    np.testing.assert_allclose(own.reading().displacement, q, atol=1e-15)
    np.testing.assert_allclose(own.reading().velocity, qd, atol=1e-14)


def test_the_reduced_model_alone_does_not_drift_away() -> None:
    """Without a spring the wire runs off under a force that is not the mean; with it, it goes to a new rest."""
    alone = standing_alone(wire(), ReducedEnvironment(frequency_hz=1.0, damping_ratio=0.3))
    own = LinearEnvironment(alone)
    own.begin(at(0.04, 0.0, 120.0), 120.0, at(0.04, 0.0, 120.0))
    for _ in range(10000):
        own.step(130.0)
    # Static deflection of the wire on its elastic bed under 10 N more.
    expected = 10.0 * alone.output @ np.linalg.solve(alone.stiffness, alone.input)
    assert own.reading().w - 0.04 == pytest.approx(float(expected), rel=1e-6)
    assert abs(own.reading().v) < 1e-9


def test_a_reduced_model_that_is_not_stable_is_refused_by_name() -> None:
    model = wire()
    unstable = Impedance(model.mass, -5.0 * model.mass, model.stiffness, model.input, model.output, TS, 0.28, 0.55)
    with pytest.raises(ValueError, match=r"environments\.reduced.*frequency_hz"):
        standing_alone(unstable, ReducedEnvironment(frequency_hz=0.1, damping_ratio=0.0))


# The gap -----------------------------------------------------------------------------------------------------------


@given(st.floats(-0.1, 0.1, allow_subnormal=False), st.floats(-0.5, 0.5, allow_subnormal=False), st.floats(0.05, 2.0))
@settings(max_examples=60)
def test_a_gap_is_closed_from_position_and_velocity_without_a_bump(gap: float, rate: float, duration: float) -> None:
    approach = Approach(duration, TS)
    approach.restart(gap, rate)
    offsets, drifts = np.array([approach.advance() for _ in range(math.ceil(duration / TS) + 3)]).T
    # (half of the smallest numbers is zero)
    assert offsets[0] == pytest.approx(gap, rel=1e-12, abs=1e-300)
    # (an approach without any velocity braking time ends the velocity at once)
    assert drifts[0] == pytest.approx(rate if abs(rate) > 0.0 else 0.0, abs=1e-12)
    assert offsets[-1] == drifts[-1] == 0.0
    assert approach.closed
    # Where the time suffices, what is left to the drive is gentle: pi^2 gap / 2 T^2 and the velocity's share.
    if 4.0 * abs(rate) / GENTLE < duration - TS:
        allowed = 0.5 * math.pi**2 * abs(gap) / duration**2 + GENTLE
        assert np.abs(np.diff(drifts)).max() / TS <= allowed * 1.001 + 1e-9
    # The rate is that of the offset: trapezoids are off by T_s^2 / 12 of the third derivative, at most 6 rate / T_v^2.
    braking = min(4.0 * abs(rate) / GENTLE, duration)
    if braking > 20 * TS:
        middle = 0.5 * (drifts[1:] + drifts[:-1])
        # where the velocity's share ends its acceleration of 2 rate / T_v falls away within one cycle
        bound = TS**2 / 12.0 * (10.0 * abs(rate) / braking**2 + 16.0 * abs(gap) / duration**3)
        bound += max(GENTLE, 2.0 * abs(rate) / braking) * TS
        np.testing.assert_allclose(np.diff(offsets) / TS, middle, atol=bound)


def test_no_approach_time_closes_the_gap_at_once() -> None:
    approach = Approach(0.0, TS)
    approach.restart(0.05, 0.1)
    assert approach.advance() == (0.0, 0.0)


def test_no_third_file_knows_the_names_of_the_environments() -> None:
    """The parameter, the switch and the message list the same environments in the same order."""
    from impedance_mpc.parameters import Parameters
    from impedance_mpc.switching import ENVIRONMENTS
    from phil_base.parameters import infos

    (choices,) = (info.choices for info in infos(Parameters) if info.name == "environment")
    assert choices == ENVIRONMENTS
    text = (Path(__file__).parents[2] / "interfaces/phil_interfaces/msg/ImpedanceCommand.msg").read_text(
        encoding="utf-8"
    )
    for number, name in enumerate(ENVIRONMENTS):
        assert f"ENVIRONMENT_{name.upper()} = {number} " in text
