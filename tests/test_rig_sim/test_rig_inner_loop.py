"""The inner position loop: design, PT2 behaviour, tracking, disturbance, current limit."""

from typing import Any

import numpy as np
import pytest

from test_rig_sim import inner_loop
from test_rig_sim.drive import Drive
from test_rig_sim.identify import excitation, identify, pt2_matrices, ride, simulate_pt2
from test_rig_sim.rig import Rig

DRIVE = Drive(8.0, 40.0, 30.0, 9.81, 0.0, 0.01, 0.0, 0.0, 0.02)
NOISE = inner_loop.Noise(220.0, 1e-6)
PERIOD = 2e-4


def test_default_weights_give_forty_hertz(rig_parameters: Any) -> None:
    # The documented values; 1 % is how far round weights were rounded.
    loop = Rig(rig_parameters()).plant.loop
    frequency, damping = inner_loop.pt2_of_poles(inner_loop.loop_poles(loop), PERIOD)
    assert frequency == pytest.approx(40.0, rel=0.01)
    assert damping == pytest.approx(0.8, rel=0.01)


@pytest.mark.parametrize(("frequency", "damping"), [(20.0, 0.75), (40.0, 0.8), (60.0, 1.0)])
def test_weights_for_a_wanted_pt2(frequency: float, damping: float) -> None:
    # The formula is that of continuous time: off by the order of omega T / 2 = 4 % at 60 Hz.
    weights = inner_loop.weights_for(DRIVE, frequency, damping, 1e6)
    loop = inner_loop.design(DRIVE, weights, NOISE, PERIOD)
    found = inner_loop.pt2_of_poles(inner_loop.loop_poles(loop), PERIOD)
    assert found == pytest.approx((frequency, damping), rel=0.05)


def test_damping_below_the_reach_of_the_lqr_is_refused() -> None:
    with pytest.raises(ValueError, match=r"0\.707"):
        inner_loop.weights_for(DRIVE, 40.0, 0.5, 1e6)


def test_observer_poles_follow_the_noise_ratio() -> None:
    # Third-order Butterworth pattern at (q / (m r sqrt(T)))^(1/3), continuous-time formula, good to 5 % here.
    loop = inner_loop.design(DRIVE, inner_loop.weights_for(DRIVE, 40.0, 0.8, 1e6), NOISE, PERIOD)
    expected = (220.0 / 8.0 / (1e-6 * PERIOD**0.5)) ** (1.0 / 3.0)
    assert np.abs(np.log(inner_loop.observer_poles(loop))) / PERIOD == pytest.approx(expected, rel=0.05)


def test_observer_sees_a_constant_force() -> None:
    loop = inner_loop.design(DRIVE, inner_loop.weights_for(DRIVE, 40.0, 0.8, 1e6), NOISE, PERIOD)
    estimate = np.zeros(3)
    force, t = 30.0, 0.0
    for _ in range(500):
        t += PERIOD
        # Weight is carried, 30 N that nobody told accelerate the slider.
        inner_loop.observe(loop, estimate, loop.weight_force / 40.0, 0.0, 0.5 * force / 8.0 * t**2)
    assert estimate == pytest.approx([0.5 * force / 8.0 * t**2, force / 8.0 * t, force], rel=1e-6)


def test_pt2_matrices_hold_a_ramp_exactly() -> None:
    # A PT2 follows a ramp at the distance 2 zeta / omega times its slope.
    a, b_0, b_1 = pt2_matrices(40.0, 0.8, 0.002)
    omega = 2.0 * np.pi * 40.0
    x = np.array([-2.0 * 0.8 / omega, 1.0])
    assert a @ x + b_0 * 0.0 + b_1 * 0.002 == pytest.approx([0.002 - 2.0 * 0.8 / omega, 1.0], abs=1e-12)


def test_linear_rig_is_a_pt2(rig_parameters: Any, frictionless: dict[str, Any]) -> None:
    # Without friction and cogging nothing but the sampling at 5 kHz separates the loop from a PT2: 0.1 %.
    found = identify(rig_parameters({**frictionless, "drive.viscous_friction": 0.0}), duration=2.0)
    assert (found.natural_frequency_hz, found.damping) == pytest.approx((40.0, 0.8), rel=0.01)
    assert found.gain == pytest.approx(1.0, abs=1e-4)
    assert found.residual < 1e-3
    assert found.velocity_residual < 2e-3


def test_default_rig_is_a_pt2_but_for_friction(rig_parameters: Any) -> None:
    # Coulomb friction and cogging act faster than the observer: 5 % of the frequency, 0.5 % of position and 3 % of
    # velocity stay unexplained.
    found = identify(rig_parameters(), duration=2.0)
    assert (found.natural_frequency_hz, found.damping) == pytest.approx((40.0, 0.8), rel=0.05)
    assert found.gain == pytest.approx(1.0, abs=1e-3)
    assert found.residual < 0.005
    assert found.velocity_residual < 0.03


def test_step_of_the_reference(rig_parameters: Any) -> None:
    # A PT2 of damping 0.8 overshoots by exp(-pi 0.8 / 0.6) = 1.5 % and settles in about 4 / (zeta omega) = 20 ms;
    # friction may add as much.
    rig = Rig(rig_parameters(), contact=False)
    w = []
    for _ in range(100):
        rig.advance(0.001, 0.001)
        w.append(rig.state.w_tr)
    assert max(w) < 1.03e-3
    assert w[10] == pytest.approx(1e-3, rel=0.05)
    assert w[-1] == pytest.approx(1e-3, abs=5e-6)


def test_chirp_in_contact_follows_the_model(rig_parameters: Any) -> None:
    # The measured contact force is taken off by the control law: a rig in contact is the same PT2, within 1 %.
    parameters = rig_parameters()
    u = 0.5 * excitation(1000, 0.002, 0.03)
    model = simulate_pt2(39.5, 0.79, 0.002, u)
    error = ride(Rig(parameters), u) - model
    assert np.sqrt((error[:, 0] ** 2).mean() / (model[:, 0] ** 2).mean()) < 0.01
    assert np.sqrt((error[:, 1] ** 2).mean() / (model[:, 1] ** 2).mean()) < 0.05


def test_unknown_force_of_200_newton_is_rejected(rig_parameters: Any) -> None:
    # 200 N on 8 kg is 25 m/s^2; the observer's 200 Hz leave it about 3 ms, 25 / 2 (3 ms)^2 = 0.11 mm; without the
    # observer 200 N / (m omega^2) = 0.4 mm would stay.
    rig = Rig(rig_parameters(), contact=False)
    drive = rig.plant.drive
    rig.plant = rig.plant._replace(drive=drive._replace(gravity=drive.gravity + 200.0 / drive.mass))
    deviation = []
    for _ in range(250):
        rig.advance(0.0, 0.0)
        deviation.append(abs(rig.state.w_tr))
    assert max(deviation) < 0.2e-3
    assert max(deviation[50:]) < 5e-6
    assert rig.memory.estimate[2] == pytest.approx(-200.0, abs=2.0)


def test_current_limit_is_respected_and_nothing_winds_up(rig_parameters: Any) -> None:
    # 10 mm ask for 630 m/s^2 while the current allows 150: saturation for several ms. A loop that winds up overshoots
    # by what it integrated meanwhile; this one stays at the few percent of a PT2 of damping 0.8.
    changes = {"cycle_time": 2e-4, "inner_steps": 1}
    rig = Rig(rig_parameters(changes), contact=False)
    w, current, saturated = [], [], 0
    for _ in range(2000):
        rig.advance(0.01, 0.01)
        state = rig.state
        w.append(state.w_tr)
        current.append(state.current)
        saturated += state.saturated
    assert np.abs(current).max() <= 30.0
    assert saturated > 10
    assert max(w) < 0.0105
    assert w[-1] == pytest.approx(0.01, abs=5e-6)
    assert w[500] == pytest.approx(0.01, abs=1e-4)
