"""The real-time step: accuracy, passivity, books, contact."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.rig import Rig
from test_rig_sim.step import force_of, integrate, memory_for, slope

PERIOD = 2e-4


@pytest.mark.parametrize("name", PANTOGRAPHS)
def test_integration_agrees_with_solve_ivp(rig_parameters: Any, name: str) -> None:
    # Head lands on the drive at 0.5 m/s and bounces, drive is pushed by a current. Each change of contact costs the
    # fixed step up to k v h^2 / m = 4e-5 m/s of speed in the worst case; 1 um and 0.1 mm/s are 0.01 % of the motion.
    plant = Rig(rig_parameters({"pantograph": name})).plant
    n = plant.pantograph.mass.size
    start = np.zeros(2 + 2 * n)
    start[2 : 2 + n] = -0.002
    start[2 + n :] = 0.5
    current, lift, duration = 1.5, 60.0, 0.2

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        out = np.empty_like(y)
        slope(plant, y, current, lift, out)
        return out

    exact = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=1e-10, atol=1e-12, max_step=5e-5).y[:, -1]
    state, memory = start.copy(), memory_for(n)
    integrate(plant, state, memory.scratch, current, lift, 0.5 * PERIOD, 2 * round(duration / PERIOD))
    assert state[: 2 + n] == pytest.approx(exact[: 2 + n], abs=1e-6)
    assert state == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("name", PANTOGRAPHS)
@given(data=st.data())
@settings(max_examples=15, deadline=None)
def test_pantograph_and_contact_create_no_energy(rig_parameters: Any, name: str, data: Any) -> None:
    # A free drive without current, weight and cogging. Runge-Kutta loses energy in smooth motion; a change of contact
    # within a step may gain some 1e-7 of it.
    parameters = rig_parameters({"pantograph": name, "drive.gravity": 0.0, "drive.cogging_amplitude": 0.0})
    plant = Rig(parameters).plant
    n = plant.pantograph.mass.size
    place = st.floats(-0.05, 0.05)
    speed = st.floats(-1.0, 1.0)
    state = np.array(
        [data.draw(place), data.draw(speed)]
        + [data.draw(place) for _ in range(n)]
        + [data.draw(speed) for _ in range(n)]
    )
    scratch = memory_for(n).scratch

    def energy() -> float:
        q, v = state[2 : 2 + n], state[2 + n :]
        penetration = max(0.0, q[-1] - state[0])
        return float(
            0.5 * plant.drive.mass * state[1] ** 2
            + 0.5 * (plant.pantograph.mass * v**2).sum()
            + 0.5 * q @ plant.pantograph.stiffness @ q
            + 0.5 * plant.contact.stiffness * penetration**2
        )

    before = energy()
    allowed = 1e-6 * before + 1e-12
    for _ in range(400):
        integrate(plant, state, scratch, 0.0, 0.0, 0.5 * PERIOD, 2)
        after = energy()
        assert after <= before + allowed
        before = after


@given(seed=st.integers(0, 1000), amplitude=st.floats(0.001, 0.1))
@settings(max_examples=10, deadline=None)
def test_contact_of_a_wild_ride_never_pulls(rig_parameters: Any, seed: int, amplitude: float) -> None:
    rig = Rig(rig_parameters({"run_in": 0.1}))
    random = np.random.default_rng(seed)
    for _ in range(100):
        u = amplitude * random.uniform(-1.0, 1.0, 2)
        rig.advance(float(u[0]), float(u[1]))
        assert rig.state.f_contact >= 0.0
        assert rig.state.f_contact == force_of(rig.plant, rig.memory.state)


def test_contact_is_lost_when_the_drive_runs_away(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({"run_in": 0.0}))
    forces = []
    for k in range(100):
        rig.advance(0.003 * k, 0.003 * (k + 1))
        forces.append(rig.state.f_contact)
    # The head of 7.2 kg under 120 N cannot follow 1.5 m/s at once.
    assert min(forces) == 0.0


def test_work_and_impulse_are_the_integrals_at_the_inner_rate(rig_parameters: Any) -> None:
    # One inner step a cycle shows every sample; the same trapezoidal sums, but for rounding.
    rig = Rig(rig_parameters({"cycle_time": 2e-4, "inner_steps": 1, "run_in": 0.05}))
    whole = Rig(rig_parameters({"run_in": 0.05}))
    u = 0.01 * np.sin(2.0 * np.pi * 2.0 * np.arange(101) * 0.002)
    force, speed, true_power = [rig.state.f_raw], [rig.state.v_tr], [0.0]
    for k in range(100):
        whole.advance(float(u[k]), float(u[k + 1]))
        for j in range(10):
            rig.advance(*(float(u[k] + share * (u[k + 1] - u[k])) for share in (0.1 * j, 0.1 * (j + 1))))
            force.append(rig.state.f_raw)
            speed.append(rig.state.v_tr)
            true_power.append(rig.state.f_contact * rig.memory.state[1])
    f, v = np.array(force), np.array(speed)
    work = PERIOD * 0.5 * (f[1:] * v[1:] + f[:-1] * v[:-1]).sum()
    assert rig.state.work == pytest.approx(work, rel=1e-9)
    assert rig.state.impulse == pytest.approx(PERIOD * 0.5 * (f[1:] + f[:-1]).sum(), rel=1e-9)
    # Against true force and speed: noise of 0.5 N at 5 kHz over 0.2 s leaves some 1e-4 J of it.
    exact = PERIOD * (np.array(true_power)[1:] + np.array(true_power)[:-1]).sum() * 0.5
    assert rig.state.work == pytest.approx(exact, rel=5e-3)
    # Ten inner steps in one cycle see the ramp of the uplift force as ten chords of one: 0.1 %.
    assert whole.state.work == pytest.approx(rig.state.work, rel=1e-3)


def test_impulse_of_a_resting_rig_is_uplift_force_times_time(rig_parameters: Any) -> None:
    # Starts in equilibrium, so nothing moves but by the encoder's rounding: 0.01 %.
    rig = Rig(rig_parameters({"load_cell.noise": 0.0, "run_in": 0.0, "initial_force_share": 1.0}))
    for _ in range(500):
        rig.advance(0.0, 0.0)
    assert rig.state.impulse == pytest.approx(120.0 * 1.0, rel=1e-4)
    assert rig.state.work == pytest.approx(0.0, abs=1e-3)
