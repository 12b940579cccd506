"""Waves of mesh and step, reflection from them, and wave packets in time that have to say the same."""

from dataclasses import replace

import numpy as np
import pytest

from catenary_model.boundary import AHEAD, BEHIND, Layer, impose
from catenary_model.boundary.control_design.dispersion import continuous_wave_number, travelling
from catenary_model.boundary.control_design.segment import newmark
from catenary_model.boundary.packets import echo, far
from catenary_model.boundary.reflection import reflection
from catenary_model.boundary.waves import waves
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Wire
from catenary_model.moving_frame import CONTACT, Mesh, MovingFrame, assemble, wire_elements

FAST = 320.0 / 3.6
LOSSLESS = replace(CONTACT_3_1, damping=0.0)


def frame(speed: float, h: float = 1.0, half: int = 40) -> MovingFrame:
    return assemble(Mesh(h, half), CARRIER_3_1, CONTACT_3_1, speed)


@pytest.mark.parametrize("speed", [0.0, 250.0 / 3.6, FAST])
def test_discretised_dispersion_is_that_of_a_long_periodic_mesh(speed: float) -> None:
    """Eigenvalues of the step matrix of a ring of 60 m against the wave numbers, 1e-7 of 1/m; lossless: both real."""
    n, h, step = 60, 1.0, Layer(ts=0.002, beta=0.25, gamma=0.5)
    ring = [np.zeros((2 * n, 2 * n)) for _ in range(3)]
    for matrix, element in zip(ring, wire_elements(LOSSLESS, h, speed), strict=True):
        for e in range(n):
            dof = (2 * e + np.arange(4)) % (2 * n)
            matrix[np.ix_(dof, dof)] += element
    z = np.linalg.eigvals(newmark(*ring, step)[0])
    z = z[np.abs(np.abs(z) - 1.0) < 1e-6]
    omega = np.unique(np.round(np.angle(z) / step.ts, 9))
    omega = omega[(omega > 2.0) & (omega < 2.0 * np.pi * 15.0)]
    assert omega.size >= 7
    free = waves(LOSSLESS, h, speed, omega, step)
    found = [free.wave_number(end, h).real * n * h / (2.0 * np.pi) for end in (BEHIND, AHEAD)]
    # every frequency of the ring fits a whole number of waves of one direction or the other into it
    off = np.min([np.abs(m - np.round(m)) for m in found], axis=0)
    assert np.max(off) < 1e-6
    # and the other way round: every number of waves that fits is a frequency of the ring
    fitting = {round(float(m)) for waves_of in found for m in waves_of if abs(m - round(m)) < 1e-6}
    assert fitting >= {1, 2, 3, -1, -2, -3}


@pytest.mark.parametrize("end", [BEHIND, AHEAD])
def test_both_dispersion_relations_meet_for_long_waves_and_part_for_short_ones(end: int) -> None:
    """1 Hz at 320 km/h: 1e-4 of the wave number; 30 Hz ahead on 1 m elements: more than 2 % apart."""
    frequency = np.array([1.0, 30.0])
    omega = 2.0 * np.pi * frequency
    exact = continuous_wave_number(CONTACT_3_1, FAST, end, omega)
    free = waves(CONTACT_3_1, 1.0, FAST, omega, Layer())
    mesh = free.wave_number(end, 1.0)
    assert mesh[0].real == pytest.approx(exact[0].real, rel=1e-3)
    towards = 1.0 if end == BEHIND else -1.0
    assert exact[0].real == pytest.approx(towards * omega[0] / (CONTACT_3_1.wave_speed + towards * FAST), rel=1e-3)
    difference = abs(np.exp(1j * (mesh[1].real - exact[1].real)) - 1.0)
    assert difference > (0.2 if end == AHEAD else 0.005)


def test_continuous_wave_numbers_solve_the_equation_of_motion() -> None:
    """(3.6) with w = exp(i (k x + omega t)), residual 1e-9 of its largest term, damping included."""
    omega = 2.0 * np.pi * np.geomspace(0.1, 60.0, 7)
    for end in (BEHIND, AHEAD):
        k = continuous_wave_number(CARRIER_3_1, FAST, end, omega)
        wire, own = CARRIER_3_1, omega - FAST * k
        inertia = -wire.mass_per_length * own**2 + 1j * wire.damping * own
        spring = wire.bending_stiffness * k**4 + wire.tension * k**2
        assert np.max(np.abs(inertia + spring) / np.abs(spring)) < 1e-9
        # it leaves: what dies out, dies out outwards
        assert np.all(k.imag > 0.0 if end == AHEAD else k.imag < 0.0)


@pytest.mark.parametrize("end", [BEHIND, AHEAD])
def test_a_harmonic_goes_on_by_its_phase_shift(end: int) -> None:
    """One step of the plant far from its ends is one phase shift (3.34), 1e-9, numerical damping included."""
    step = Layer()
    M, D, K = (np.zeros((160, 160)) for _ in range(3))
    for matrix, element in zip((M, D, K), wire_elements(CONTACT_3_1, 1.0, FAST), strict=True):
        for e in range(79):
            matrix[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += element
    A, _ = newmark(M, D, K, step)
    harmonics = travelling("discretised", CONTACT_3_1, 1.0, FAST, end, 80, np.array([2.0, 17.0, 30.0]), step)
    state = harmonics.state
    if end == AHEAD:  # nodes are counted from the end
        state = state.reshape(3, 80, 2, -1)[:, ::-1].reshape(state.shape)
    middle = np.concatenate([np.arange(70, 90) + 160 * i for i in range(3)])
    after = (A @ state)[middle]
    expected = (state * harmonics.shift)[middle]
    assert np.max(np.abs(after - expected) / np.max(np.abs(expected), axis=0)) < 1e-9


def test_a_dashpot_reflects_nothing_of_a_string_and_a_wrong_one_what_impedances_say() -> None:
    """EI to zero, fine mesh and step: |R| < 1e-4; a dashpot of twice the impedance returns 1/3, to 1e-3."""
    string = Wire(1.35, 0.2, 1e-4, 20e3)
    step = Layer(nodes=0, ts=1e-4, beta=0.25, gamma=0.5)
    frequency = np.array([2.0, 10.0, 20.0])
    for speed in (0.0, FAST):
        for end in (BEHIND, AHEAD):
            matched = assemble(Mesh(0.1, 10), string, string, speed)
            impose("matched_dashpot", matched, step)
            assert np.max(np.abs(reflection(matched, None, CONTACT, end, step, frequency))) < 1e-4
    double = assemble(Mesh(0.1, 10), string, string, 0.0)
    impose("matched_dashpot", double, step)
    Z = string.mass_per_length * string.wave_speed
    double.damping[2, 2] += Z
    R = reflection(double, None, CONTACT, BEHIND, step, frequency)
    assert np.real(R) == pytest.approx(-1.0 / 3.0, abs=2e-3)


@pytest.mark.parametrize("speed", [0.0, FAST])
def test_a_clamped_end_returns_all_the_energy(speed: float) -> None:
    """Lossless: opposite displacement for long waves (5 %: bending shifts the phase); both ends lose nothing."""
    step = Layer(nodes=0, beta=0.25, gamma=0.5)
    held = assemble(Mesh(1.0, 10), LOSSLESS, LOSSLESS, speed)
    impose("clamped", held, step)
    frequency = np.array([1.0, 10.0, 30.0])
    behind, ahead = (reflection(held, None, CONTACT, end, step, frequency) for end in (BEHIND, AHEAD))
    assert behind[0] == pytest.approx(-1.0, abs=0.05)
    # the flux of a wave is |w|^2 times a factor of its own: out and back through both ends it cancels
    assert np.abs(behind * ahead) == pytest.approx(1.0, abs=1e-6)


def test_a_sponge_absorbs_only_what_is_shorter_than_itself() -> None:
    layer = Layer(nodes=20)
    sponge = frame(0.0)
    impose("viscous_sponge", sponge, layer)
    R = np.abs(reflection(sponge, None, CONTACT, BEHIND, layer, np.array([0.5, 3.0, 20.0])))
    assert R[0] > 0.5
    assert np.max(R[1:]) < 0.1


@pytest.mark.parametrize("kind", ["matched_dashpot", "controlled"])
@pytest.mark.parametrize("end", [BEHIND, AHEAD])
@pytest.mark.slow
def test_packets_in_time_come_back_as_the_waves_say(kind: str, end: int) -> None:
    """10, 20, 30 Hz at 250 km/h, relative to clamped: 5 % and 0.01 % of the amplitude (a packet has a bandwidth)."""
    speed, frequency, layer = 250.0 / 3.6, np.array([10.0, 20.0, 30.0]), Layer(nodes=20)
    half = round(far(CONTACT_3_1, speed, frequency)) + 40
    unbounded = frame(speed, half=half)
    shares = {}
    for name, nodes in ((kind, 20), ("clamped", 0)):
        here = replace(layer, nodes=nodes)
        bounded = frame(speed, half=half)
        feedback = impose(name, bounded, here)
        exact = np.abs(reflection(bounded, feedback, CONTACT, end, here, frequency))
        measured = echo(bounded, feedback, unbounded, CONTACT, end, here, frequency).raw
        shares[name] = exact, measured
    exact, measured = (shares[kind][i] / shares["clamped"][i] for i in range(2))
    assert np.max(exact) < 0.02
    assert measured == pytest.approx(exact, rel=0.05, abs=1e-4)
