"""Motion and statics of every kind of pantograph against closed forms."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import njit

from test_rig_sim.contact import Contact, contact_force
from test_rig_sim.mounting import mount
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.linear import linear_pantograph, realise
from test_rig_sim.pantographs.motion import CONTACT, Pantograph, bodies, head_position, head_velocity, rate, states
from test_rig_sim.pantographs.statics import equilibrium, set_up
from test_rig_sim.rig import Rig

CHAINS = {
    "en50318": ([15.0, 7.2], [50.0, 4200.0], [90.0, 10.0]),
    "three_mass": ([6.0, 9.0, 7.5], [160.0, 15500.0, 7000.0], [100.0, 0.1, 0.1]),
    "benchmark": ([6.0, 9.0, 7.5], [160.0, 15500.0, 7000.0], [100.0, 0.1, 45.0]),
    "dsa380": ([5.80, 6.00, 7.12], [0.1, 14100.0, 9430.0], [70.0, 0.0, 0.0]),
    "dsa250": ([4.645, 5.855, 7.51], [80.0, 6200.0, 8380.0], [70.0, 0.0, 0.0]),
}
Array = np.ndarray


@njit
def ride_on_fixed_drive(p: Pantograph, contact: Contact, x: Array, lift: float, h: float, steps: int) -> Array:
    """Runge-Kutta steps of h (s) under a drive at rest at 0; gives head, its velocity and force, (steps + 1, 3)."""
    shown = np.empty((steps + 1, 3))
    slopes = np.empty((4, x.size))
    shares = (0.0, 0.5, 0.5, 1.0)
    for k in range(steps + 1):
        shown[k, 0], shown[k, 1] = head_position(p, x), head_velocity(p, x)
        shown[k, 2] = contact_force(contact, shown[k, 0], shown[k, 1])
        for i in range(4):
            stage = x + shares[i] * h * slopes[i - 1] if i > 0 else x.copy()
            f = contact_force(contact, head_position(p, stage), head_velocity(p, stage))
            rate(p, stage, lift, 0.0, 0.0, f, slopes[i])
        x += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
    return shown


def system(p: Pantograph) -> tuple[Array, Array]:
    """Return A (m, m) and the columns (lift, base, base_rate, contact) of B (m, 4), read off `rate`."""
    m = states(p)
    out, constant = np.empty(m), np.empty(m)
    rate(p, np.zeros(m), 0.0, 0.0, 0.0, 0.0, constant)
    A, B = np.empty((m, m)), np.empty((m, 4))
    for i, x in enumerate(np.eye(m)):
        rate(p, x, 0.0, 0.0, 0.0, 0.0, out)
        A[:, i] = out - constant
    for i, u in enumerate(np.eye(4)):
        rate(p, np.zeros(m), *u, out)
        B[:, i] = out - constant
    return A, B


def head(p: Pantograph) -> Array:
    return np.array([head_position(p, x) for x in np.eye(states(p))])


def transfer(p: Pantograph, s: complex) -> Array:
    """Return the head's answer to (lift, base with its rate, contact) at s."""
    A, B = system(p)
    answer = head(p) @ np.linalg.solve(s * np.eye(A.shape[0]) - A, B)
    return np.array([answer[0], answer[1] + s * answer[2], answer[3]])


@pytest.mark.parametrize("name", CHAINS)
def test_poles_are_the_roots_of_the_chain_s_characteristic_polynomial(name: str) -> None:
    # det(M s^2 + D s + K) of a tridiagonal matrix by its recurrence: p_i = (m s^2 + (d + d') s + k + k') p_(i-1)
    # - (d s + k)^2 p_(i-2), links d, k below and d', k' above body i. Roots of a polynomial of degree 6: 1e-9.
    masses, springs, dashpots = CHAINS[name]
    links = [np.poly1d([d, k]) for d, k in zip(dashpots, springs, strict=True)]
    before, polynomial = np.poly1d([0.0]), np.poly1d([1.0])
    for i, mass in enumerate(masses):
        diagonal = np.poly1d([mass, 0.0, 0.0]) + links[i] + (links[i + 1] if i + 1 < len(masses) else np.poly1d([0.0]))
        before, polynomial = polynomial, diagonal * polynomial - (links[i] * links[i] * before if i else np.poly1d([0]))
    found = np.linalg.eigvals(system(PANTOGRAPHS[name]())[0])
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(polynomial.roots), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", PANTOGRAPHS)
def test_the_head_s_velocity_is_the_rate_of_its_place(rig_parameters: Any, name: str) -> None:
    # Whatever acts: contact, lift and car body must not enter. Places are linear in the state, so rounding is all.
    p = mount(rig_parameters({"pantograph": name}))
    random = np.random.default_rng(0)
    for _ in range(20):
        x, out = random.uniform(-0.1, 0.1, states(p)), np.empty(states(p))
        rate(p, x, *random.uniform(-100.0, 100.0, 4), out)
        assert head_position(p, out) == pytest.approx(head_velocity(p, x), rel=1e-9, abs=1e-9)


def test_the_shipped_file_is_the_chain_of_en_50318() -> None:
    # The same answers at all frequencies of interest; rounding of the polynomials' coefficients.
    file, same = PANTOGRAPHS["state_space"](), PANTOGRAPHS["en50318"]()
    assert (states(file), bodies(file)) == (4, 1)
    for frequency in (0.01, 0.3, 1.0, 2.8, 4.0, 20.0, 200.0):
        s = 2j * math.pi * frequency
        assert transfer(file, s) == pytest.approx(transfer(same, s), rel=1e-10)


def test_a_ride_on_the_file_is_a_ride_on_the_chain(rig_parameters: Any) -> None:
    # Drive and car body move, contact is lost at the start and comes back; without the encoder's steps nothing
    # magnifies the rounding of 20000 integration steps.
    changes = {"car_body.bounce_amplitude": 0.01, "encoder_resolution": 0.0}

    def ride(name: str) -> Array:
        rig = Rig(rig_parameters({"pantograph": name, **changes}))
        found = []
        for k in range(1000):
            rig.advance(0.01 * math.sin(0.02 * k), 0.01 * math.sin(0.02 * (k + 1)))
            found.append(rig.state.f_contact)
        return np.array(found)

    chained = ride("en50318")
    assert chained.min() == 0.0
    assert chained.max() > 125.0
    assert ride("state_space") == pytest.approx(chained, abs=1e-9)


def test_state_space_matrices_may_have_any_coordinates() -> None:
    # The chain's own matrices, in coordinates mixed at random, give the same head.
    chained = PANTOGRAPHS["three_mass"]()
    A, B = system(chained)
    mix = np.random.default_rng(3).normal(size=A.shape) + 3.0 * np.eye(A.shape[0])
    back = np.linalg.inv(mix)
    mixed = linear_pantograph(mix @ A @ back, mix @ B, head(chained) @ back)
    for frequency in (0.1, 1.0, 5.0, 50.0):
        s = 2j * math.pi * frequency
        # The head's own relative degree is zero but for the rounding of the mixing, magnified by its condition.
        assert transfer(mixed, s) == pytest.approx(transfer(chained, s), rel=1e-7)


@pytest.mark.parametrize("modes", [2, 5, 10])
def test_a_measured_compliance_of_many_modes_keeps_its_digits(modes: int) -> None:
    # Sum of modes from 0.5 to 150 Hz as one fraction of polynomials, whose coefficients span 50 powers of ten.
    omega = 2.0 * math.pi * np.geomspace(0.5, 150.0, modes)
    factors = [np.array([1.0, 0.06 * w, w * w]) for w in omega]
    denominator, numerator = np.array([1.0]), np.zeros(1)
    for i, factor in enumerate(factors):
        denominator = np.polymul(denominator, factor)
        others = np.array([1.0 / (7.0 + i)])
        for j, other in enumerate(factors):
            others = np.polymul(others, other) if j != i else others
        numerator = np.polyadd(numerator, others)
    p = linear_pantograph(*realise(denominator, numerator, numerator, np.zeros(0)))
    for frequency in np.geomspace(0.1, 300.0, 20):
        s = 2j * math.pi * frequency
        expected = sum(1.0 / (7.0 + i) / np.polyval(factor, s) for i, factor in enumerate(factors))
        answer = np.linalg.solve(s * np.eye(p.states) - p.A, p.B[:, CONTACT])[p.head]
        assert answer == pytest.approx(-expected, rel=1e-9)


@pytest.mark.parametrize("name", PANTOGRAPHS)
@pytest.mark.parametrize("uplift", [60.0, 120.0, 200.0])
def test_operating_point_and_equilibrium_of_every_pantograph(rig_parameters: Any, name: str, uplift: float) -> None:
    stiffness = 5e4
    p = set_up(mount(rig_parameters({"pantograph": name})), uplift, stiffness)
    out = np.empty(states(p))
    for height in (-0.1, 0.0, 0.1):
        x = equilibrium(p, uplift, stiffness, height)
        force = stiffness * (head_position(p, x) - height)
        rate(p, x, uplift, 0.0, 0.0, force, out)
        # At rest: accelerations of 1e-8 m/s^2 stand for forces of 1e-7 N.
        assert out == pytest.approx(0.0, abs=1e-8)
        if height == 0.0:
            assert force == pytest.approx(uplift + p.frame.air, rel=1e-9)
        else:
            # Whatever holds the frame, the force falls with height.
            assert (force - uplift - p.frame.air) * height < 0.0


@pytest.mark.parametrize("name", PANTOGRAPHS)
def test_without_enough_lift_the_head_hangs_below_the_drive(rig_parameters: Any, name: str) -> None:
    p = set_up(mount(rig_parameters({"pantograph": name})), 120.0, 5e4)
    x, out = equilibrium(p, 0.0, 5e4, 0.6), np.empty(states(p))
    assert head_position(p, x) < 0.6
    rate(p, x, 0.0, 0.0, 0.0, 0.0, out)
    assert out == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("name", PANTOGRAPHS)
def test_a_pantograph_without_lift_hangs_where_its_frame_rests(rig_parameters: Any, name: str) -> None:
    # No force passes through the chain: all bodies stand at the place where the frame's spring is unloaded, which is as
    # far above the drive as the chain was pressed together by the whole lift.
    bare = mount(rig_parameters({"pantograph": name}))
    p = set_up(bare, 120.0, 5e4)
    force = 120.0 + p.frame.air
    pressed = force / 5e4 + sum(force / k for k in CHAINS.get(name, CHAINS["en50318"])[1][1:])
    assert head_position(p, equilibrium(p, -p.frame.air, 5e4, 100.0)) == pytest.approx(pressed, rel=1e-6)


def test_a_frame_that_nothing_holds_finds_no_rest() -> None:
    loose = set_up(chain([15.0, 7.2], [0.0, 4200.0], [60.0, 10.0]), 120.0, 5e4)
    assert head_position(loose, equilibrium(loose, 120.0, 5e4, 0.3)) == pytest.approx(0.3 + 120.0 / 5e4)
    with pytest.raises(ValueError, match=r"no place to rest under a lift of -5"):
        equilibrium(loose, -5.0, 5e4)
    # The same as a linear system.
    A, B = system(loose)
    same = set_up(linear_pantograph(A, B, head(loose)), 120.0, 5e4)
    assert head_position(same, equilibrium(same, 120.0, 5e4, 0.3)) == pytest.approx(0.3 + 120.0 / 5e4)
    with pytest.raises(ValueError, match=r"nothing holds the pantograph under a lift of -5"):
        equilibrium(same, -5.0, 5e4)


@pytest.mark.parametrize("name", ["en50318", "state_space"])
@pytest.mark.slow
def test_car_body_reaches_the_head_as_the_closed_form_says(rig_parameters: Any, name: str) -> None:
    # head / base of two masses: (d0 s + k0)(d1 s + k1) / det(M s^2 + D s + K). Without contact. After 30 s the slowest
    # pole (0.68 1/s) has left 1e-9; holding the base within 0.2 ms costs (w h)^2 / 24 = 1e-7 of the amplitude.
    frequency, amplitude = 1.7, 0.02
    changes = {"pantograph": name, "car_body.bounce_amplitude": amplitude, "car_body.bounce_frequency_hz": frequency}
    rig = Rig(rig_parameters({**changes, "run_in": 0.0, "initial_force_share": 1.0}), contact=False)
    w, cycles = 2.0 * math.pi * frequency, 17000
    place = np.empty(cycles)
    for k in range(cycles):
        rig.advance(0.0, 0.0)
        place[k] = rig.pantograph_state()[0][-1]
    t = 0.002 * np.arange(1, cycles + 1)[-2000:]
    basis = np.stack([np.sin(w * t), np.cos(w * t), np.ones_like(t)], axis=1)
    sine, cosine, _ = np.linalg.lstsq(basis, place[-2000:], rcond=None)[0]
    s = 1j * w
    expected = (90.0 * s + 50.0) * (10.0 * s + 4200.0) / np.polyval([108.0, 870.0, 94500.0, 378500.0, 210000.0], s)
    assert complex(sine, cosine) == pytest.approx(amplitude * expected, rel=1e-5)


@pytest.mark.parametrize("speed", [0.0, 160.0, 320.0])
def test_aerodynamic_lift_goes_with_the_square_of_the_speed(rig_parameters: Any, speed: float) -> None:
    changes = {"pantograph": "nonlinear", "speed_kmh": speed, "nonlinear_frame.aerodynamic_lift": 0.008}
    rig = Rig(rig_parameters({**changes, "nonlinear_frame.friction": 0.0, "load_cell.noise": 0.0}))
    # The run-in brings the whole lift up, with what the air contributes: it begins as softly as without air. The
    # bellows adds up to 0.4 N: the frame stands some 30 mm lower as long as the head's spring is hardly pressed.
    assert rig.state.f_contact == pytest.approx(0.1 * (120.0 + 0.008 * (speed / 3.6) ** 2), abs=0.5)
    for _ in range(2500):
        rig.advance(0.0, 0.0)
    # Without friction, which would let the frame creep for long; the drive holds 0 to its encoder's last digits.
    assert rig.state.f_contact == pytest.approx(120.0 + 0.008 * (speed / 3.6) ** 2, abs=0.05)


@pytest.mark.slow
def test_contact_lost_and_found_is_symmetric_in_time() -> None:
    # One mass without friction under a constant lift F, thrown off a fixed drive at speed v: free flight of
    # 2 m v / F, back at the same speed, then the contact spring throws it off again after less than a period. A change
    # of contact within a step of 0.02 ms costs at most k v h^2 / m = 3e-6 m/s.
    mass, lift, speed, k, h = 7.2, 120.0, 0.6, 5e4, 2e-5
    p = chain([mass], [0.0], [0.0])
    shown = ride_on_fixed_drive(p, Contact(k, 0.0), np.array([0.0, -speed]), lift, h, 8000)
    place, velocity, force = shown.T
    t = h * np.arange(place.size)
    apart = place <= 0.0
    assert np.array_equal(force == 0.0, apart)
    back = int(np.argmax(~apart))
    assert t[back] == pytest.approx(2.0 * mass * speed / lift, abs=2.0 * h)
    assert velocity[back] == pytest.approx(speed, abs=1e-3)
    flight, mirrored = place[:back], place[:back][::-1]
    assert flight == pytest.approx(mirrored, abs=2.0 * speed * h)
    gone = back + int(np.argmax(apart[back:]))
    pressed = force[back:gone]
    assert pressed == pytest.approx(pressed[::-1], abs=k * speed * 2.0 * h)
    # Under the lift the oscillation about F / k: the head is in contact for 2 (pi - atan(w m v / F)) / w.
    w = math.sqrt(k / mass)
    assert t[gone] - t[back] == pytest.approx(2.0 * (math.pi - math.atan2(w * mass * speed, lift)) / w, abs=2.0 * h)
    energy = 0.5 * mass * velocity**2 - lift * place + 0.5 * k * np.maximum(place, 0.0) ** 2
    assert energy == pytest.approx(energy[0], abs=1e-5)
    assert velocity[gone] == pytest.approx(-speed, abs=1e-3)


def test_the_example_s_polynomials_are_those_of_its_masses() -> None:
    # The example is what docs/pantographs.md explains; its polynomials are derived here once more.
    text = (
        Path(__file__)
        .parents[2]
        .joinpath("test_rig_sim", "test_rig_sim", "config", "pantograph_en50318.yaml")
        .read_text()
    )
    frame, head_, link = np.poly1d([15.0, 100.0, 4250.0]), np.poly1d([7.2, 10.0, 4200.0]), np.poly1d([10.0, 4200.0])
    denominator = (frame * head_ - link * link).coeffs
    base = (np.poly1d([90.0, 50.0]) * link).coeffs
    for key, value in (("denominator", denominator), ("contact", frame.coeffs), ("lift", link.coeffs), ("base", base)):
        listed = next(line for line in text.splitlines() if line.startswith(f"{key}:"))
        numbers = [float(number) for number in listed.split("[")[1].split("]")[0].split(",")]
        assert numbers == pytest.approx(value, rel=1e-12)


def test_dry_friction_makes_a_loop_of_force_over_height(rig_parameters: Any) -> None:
    # The drive goes slowly up and down by 0.1 m and the head follows. In the middle, at the speed v, the frame's joints
    # and its dashpot of 60 N s/m take their force from the contact on the way up and add it on the way down; bellows,
    # springs and inertia are the same both ways. 0.15 N: the drive lags a little behind its reference.
    amplitude, period, cycles = 0.1, 8.0, 8000
    speed = 2.0 * math.pi * amplitude / period
    rig = Rig(rig_parameters({"pantograph": "nonlinear", "load_cell.noise": 0.0, "contact.damping": 200.0}))
    frame, force = rig.plant.pantograph.frame, np.empty(cycles)
    u = amplitude * np.sin(2.0 * math.pi / period * 0.002 * np.arange(cycles + 1))
    for k in range(cycles):
        rig.advance(float(u[k]), float(u[k + 1]))
        force[k] = rig.state.f_contact
    down, up = force[6000 - 1], force[8000 - 1]
    dry = (5.0 + 2.0 * math.exp(-((speed / 0.05) ** 2))) * math.tanh(speed / 0.01)
    assert (frame.friction, frame.breakaway, frame.stribeck_speed, frame.friction_speed) == (5.0, 7.0, 0.05, 0.01)
    assert down - up == pytest.approx(2.0 * (dry + 60.0 * speed), abs=0.15)
