"""The rig as a whole: static contact, run-in, load cell, determinism."""

import math
from typing import Any

import numpy as np
import pytest

from test_rig_sim.force_observer import force_observer, observe_force
from test_rig_sim.load_cell import encode, lag, load_cell, sense
from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.rig import Rig, RigSample


def samples(rig: Rig, cycles: int) -> list[RigSample]:
    found = [rig.state]
    for _ in range(cycles):
        rig.advance(0.0, 0.0)
        found.append(rig.state)
    return found


@pytest.mark.parametrize("name", PANTOGRAPHS)
@pytest.mark.parametrize("force", [70.0, 120.0, 180.0])
@pytest.mark.slow
def test_mean_contact_force_of_a_resting_drive_is_the_uplift_force(
    rig_parameters: Any, name: str, force: float
) -> None:
    # 0.5 N of noise, low-passed, over 500 correlated samples: 0.02 N; 0.2 N leaves room for the hardly damped
    # upper modes of the three-mass pantograph.
    rig = Rig(rig_parameters({"pantograph": name, "uplift_force": force, "imperfections.load_cell_bias": False}))
    for _ in range(1500):
        rig.advance(0.0, 0.0)
    f = np.array([s.f_tr for s in samples(rig, 1000)])
    assert f.mean() == pytest.approx(force + rig.plant.pantograph.frame.air, abs=0.2)
    assert abs(rig.state.w_tr) < 5e-6


def test_contact_comes_in_softly(rig_parameters: Any) -> None:
    quiet = {"imperfections.load_cell_noise": False, "imperfections.load_cell_bias": False}
    rig = Rig(rig_parameters({**quiet, "pantograph": "en50318"}))
    f = np.array([s.f_tr for s in samples(rig, 600)])
    # 10 % of the uplift force, and what the frame's spring adds below its rest position (50 N/m times 28 mm).
    assert f[0] == pytest.approx(12.0 + 1.4, abs=0.2)
    # The drive does not jump: start in equilibrium, no overshoot above 5 %.
    assert np.abs(np.diff(f)).max() < 1.0
    assert f.max() < 1.05 * 120.0


def test_two_rides_with_one_seed_are_equal_to_the_last_bit(rig_parameters: Any) -> None:
    def ride(seed: int) -> list[RigSample]:
        rig = Rig(rig_parameters({"seed": seed}))
        found = []
        for k in range(200):
            rig.advance(0.01 * math.sin(0.03 * k), 0.01 * math.sin(0.03 * (k + 1)))
            found.append(rig.state)
        return found

    assert ride(3) == ride(3)
    assert ride(3) != ride(4)


def test_reset_goes_back_to_cycle_zero(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters())
    first = samples(rig, 100)
    rig.reset()
    assert samples(rig, 100) == first


def test_load_cell_has_the_sensor_s_step_response() -> None:
    # Exact sampling: the answer to a step is that of w^2/(s^2 + 2 zeta w s + w^2) at every sample, whatever the step.
    omega, damping, step = 2.0 * math.pi * 2000.0, 0.7, 1e-4
    cell, memory = load_cell(0.0, 0.0, 2000.0, damping, step), np.zeros(2)
    y = [sense(cell, memory, 1.0, 1.0) for _ in range(12)]
    t = step * np.arange(1, 13)
    root = omega * math.sqrt(1.0 - damping**2)
    decay = np.exp(-damping * omega * t)
    exact = 1.0 - decay * (np.cos(root * t) + damping * omega / root * np.sin(root * t))
    assert y == pytest.approx(exact, abs=1e-12)


def test_load_cell_shows_a_ramp_by_its_lag_too_late() -> None:
    cell, memory = load_cell(0.0, 0.0, 2000.0, 0.7, 1e-4), np.zeros(2)
    y = [sense(cell, memory, 100.0 * 1e-4 * k, 100.0 * 1e-4 * (k + 1)) for k in range(200)]
    assert 200e-4 - y[-1] / 100.0 == pytest.approx(lag(2000.0, 0.7), rel=1e-9)
    assert lag(2000.0, 0.7) == pytest.approx(1.114e-4, rel=1e-3)


def test_load_cell_without_dynamics_shows_its_input() -> None:
    cell, memory = load_cell(0.0, 0.0, 0.0, 0.7, 1e-4), np.zeros(2)
    assert [sense(cell, memory, 3.0, force) for force in (5.0, -2.0)] == [5.0, -2.0]
    assert lag(0.0, 0.7) == 0.0


def test_load_cell_feels_the_uncompensated_plate(rig_parameters: Any) -> None:
    # Away from contact the reading is what accelerates 0.4 of 2 kg, without bias and noise; 60 rad/s against the
    # sensor's 12000: 0.5 %, and the differences over 2 ms as much.
    quiet = {f"imperfections.{name}": False for name in ("load_cell_noise", "load_cell_bias", "encoder")}
    rig = Rig(rig_parameters({**quiet, "load_cell.plate_mass": 2.0, "load_cell.compensation": 0.6}), contact=False)
    reading, speed = [], []
    for k in range(400):
        rig.advance(0.005 * math.sin(0.12 * k), 0.005 * math.sin(0.12 * (k + 1)))
        reading.append(rig.state.f_raw)
        speed.append(rig.state.v_true)
    acceleration = np.gradient(speed, 0.002)[200:-1]
    force = np.array(reading)[200:-1]
    share = -(force @ acceleration) / (acceleration @ acceleration)
    assert share == pytest.approx(0.8, rel=0.03)


def test_noise_and_bias_of_the_load_cell(rig_parameters: Any) -> None:
    # Without the plate's inertia, which also shows.
    changes = {"imperfections.load_cell_inertia": False, "load_cell.bias": 5.0, "run_in": 0.0}
    rig = Rig(rig_parameters(changes))
    for _ in range(1000):
        rig.advance(0.0, 0.0)
    found = samples(rig, 4000)
    error = np.array([s.f_raw - s.f_contact for s in found])
    # 4000 independent samples: mean to 0.008 N, deviation to 1.1 %; four of these.
    assert error.mean() == pytest.approx(5.0, abs=0.032)
    assert error.std() == pytest.approx(0.5, rel=0.045)
    # The observer takes away what lies above its bandwidth: (1 + 4 zeta^2) w / (8 zeta) = 1400 Hz of 2500.
    assert np.std([s.f_tr - s.f_contact for s in found]) < 0.4


def test_force_observer_follows_a_ramp_without_lag() -> None:
    # Of a ramp that comes in 0.11 ms late, the observer makes the ramp itself: type 2 and a lead of that length.
    observer, memory = force_observer(400.0, 0.8, 1.114e-4, 2e-4), np.zeros(2)
    y = [observe_force(observer, memory, 1000.0 * (2e-4 * k - 1.114e-4)) for k in range(1, 301)]
    assert y[-1] == pytest.approx(1000.0 * 2e-4 * 300, rel=1e-9)


@pytest.mark.parametrize(("bandwidth", "damping"), [(250.0, 0.8), (400.0, 0.8), (400.0, 1.3)])
def test_force_observer_has_the_poles_that_were_asked_for(bandwidth: float, damping: float) -> None:
    observer = force_observer(bandwidth, damping, 0.0, 2e-4)
    step = np.empty((2, 2))
    for j in range(2):
        memory = np.eye(2)[j]
        observe_force(observer, memory, 0.0)
        step[:, j] = memory
    s = np.log(np.linalg.eigvals(step).astype(complex)) / 2e-4
    omega = 2.0 * math.pi * bandwidth
    assert np.poly(s).real == pytest.approx([1.0, 2.0 * damping * omega, omega**2], rel=1e-9)


def test_force_observer_of_a_slow_force_is_right_to_the_square_of_the_frequency() -> None:
    # The filter's own expansion: 1 + (1 - alpha) / beta (w T)^2, less than (10 / 400)^2 for 10 Hz through 400 Hz, and
    # no lag worth a microsecond.
    observer, memory = force_observer(400.0, 0.8, 0.0, 2e-4), np.zeros(2)
    t = 2e-4 * np.arange(5000)
    y = np.array([observe_force(observer, memory, math.cos(2.0 * math.pi * 10.0 * time)) for time in t])
    gain = 2.0 * (y * np.exp(-2j * math.pi * 10.0 * t))[2500:].mean()
    excess = (1.0 - observer.alpha) / (observer.beta * 2e-4) * (2.0 * math.pi * 10.0 * 2e-4) ** 2
    assert abs(gain) - 1.0 == pytest.approx(excess, rel=0.02)
    assert excess < (10.0 / 400.0) ** 2
    assert abs(np.angle(gain)) / (2.0 * math.pi * 10.0) < 1e-6


def test_too_fast_a_force_observer_is_refused() -> None:
    with pytest.raises(ValueError, match="1000 Hz"):
        force_observer(1000.0, 0.8, 0.0, 2e-4)


def test_encoder_rounds_to_its_step() -> None:
    assert encode(1.26e-6, 1e-6) == pytest.approx(1e-6)
    assert encode(-1.6e-6, 1e-6) == pytest.approx(-2e-6)
    assert encode(1.26e-6, 0.0) == 1.26e-6


def test_after_a_cycle_the_reference_is_the_one_at_its_end(rig_parameters: Any) -> None:
    # The controller weighs the step from this reference to its next one: the start would be one cycle old.
    rig = Rig(rig_parameters({}))
    rig.advance(0.0005, 0.001)
    assert rig.state.reference == pytest.approx(0.001, abs=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 3, 5])
def test_commands_act_later_by_whole_cycles(rig_parameters: Any, delay: int) -> None:
    def ride(delay: int) -> list[float]:
        rig = Rig(rig_parameters({"command_delay": delay, "seed": 4}), contact=False)
        found = []
        for k in range(60):
            rig.advance(*(0.01 * math.sin(0.1 * max(0, i)) for i in (k - (5 - delay), k + 1 - (5 - delay))))
            found.append(rig.state.w_tr)
        return found

    # Delayed by the rig, or by who sends them: the same ride to the last bit.
    assert ride(delay) == ride(5)


def test_the_reference_that_is_shown_is_the_newest_one_that_was_accepted(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({"command_delay": 2}), contact=False)
    for k in range(2):
        rig.advance(0.001 * k, 0.001 * (k + 1))
        assert rig.state.reference == 0.001 * (k + 1)
    # None of it has reached the drive.
    assert abs(rig.state.w_tr) < 5e-6


@pytest.mark.parametrize("name", ["ideal", "nominal", "harsh"])
def test_every_rig_holds_its_place_and_shows_the_contact_force(rig_named: Any, name: str) -> None:
    # At rest in contact: no imperfection makes the drive wander by more than some steps of its encoder, nor the
    # observed force by more than bias and noise.
    parameters = rig_named(name)
    rig = Rig(parameters)
    for _ in range(1000):
        rig.advance(0.0, 0.0)
    found = samples(rig, 500)
    assert np.abs([s.w_tr for s in found]).max() <= 5.0 * parameters.encoder_resolution
    error = np.array([s.f_tr - s.f_contact for s in found])
    bias = parameters.load_cell.bias if parameters.imperfections.load_cell_bias else 0.0
    assert error.mean() == pytest.approx(bias, abs=0.2)
    assert error.std() < 1.2 * parameters.load_cell.noise


@pytest.mark.parametrize("name", ["ideal", "harsh"])
def test_two_rides_of_every_rig_are_equal_to_the_last_bit(rig_named: Any, name: str) -> None:
    def ride() -> list[RigSample]:
        rig = Rig(rig_named(name, {"command_delay": 1}))
        found = []
        for k in range(200):
            rig.advance(0.01 * math.sin(0.03 * k), 0.01 * math.sin(0.03 * (k + 1)))
            found.append(rig.state)
        return found

    assert ride() == ride()
