"""The real-time step: accuracy, passivity, books, contact."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from test_rig_sim.pantographs import PANTOGRAPHS
from test_rig_sim.pantographs.chain import chain
from test_rig_sim.pantographs.motion import Load, states
from test_rig_sim.pantographs.statics import set_up
from test_rig_sim.rig import Rig
from test_rig_sim.step import force_of, integrate, memory_for, slope

PERIOD = 2e-4


@pytest.mark.parametrize("name", PANTOGRAPHS)
@pytest.mark.slow
def test_integration_agrees_with_solve_ivp(rig_parameters: Any, name: str) -> None:
    # Head lands on the drive at 0.5 m/s and bounces, drive is pushed by a current and shakes the structure. Each change
    # of contact costs the fixed step up to k v h^2 / m = 4e-5 m/s of speed in the worst case; 1 um and 0.1 mm/s are
    # 0.01 % of the motion.
    plant = Rig(rig_parameters({"pantograph": name})).plant
    m, modes = states(plant.pantograph), plant.structure.modes
    n, first = m // 2, 2 + 2 * modes
    start = np.zeros(first + m)
    start[first : first + n] = -0.002
    start[first + n :] = 0.5
    current, load, duration = 1.5, Load(60.0), 0.2

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        out = np.empty_like(y)
        slope(plant, y, current, load, out)
        return out

    exact = solve_ivp(rate, (0.0, duration), start, method="DOP853", rtol=1e-10, atol=1e-12, max_step=5e-5).y[:, -1]
    state, memory = start.copy(), memory_for(m, modes)
    integrate(plant, state, memory.scratch, current, load, 0.5 * PERIOD, 2 * round(duration / PERIOD))
    places = [0, *range(2, 2 + modes), *range(first, first + n)]
    assert modes == 2
    assert np.abs(exact[2 : 2 + modes]).min() > 1e-9
    assert state[places] == pytest.approx(exact[places], abs=1e-6)
    assert state == pytest.approx(exact, abs=1e-4)


@pytest.mark.parametrize("name", ["en50318", "three_mass"])
@given(data=st.data())
@settings(max_examples=15, deadline=None)
@pytest.mark.slow
def test_pantograph_contact_and_structure_create_no_energy(rig_parameters: Any, name: str, data: Any) -> None:
    # A free drive without current, weight and cogging; its friction shakes the structure. Runge-Kutta loses energy in
    # smooth motion; a change of contact within a step may gain some 1e-7 of it.
    parameters = rig_parameters({"pantograph": name, "drive.gravity": 0.0, "imperfections.cogging": False})
    plant = Rig(parameters).plant
    # Springs unloaded at zero, so that the energy is that of the stiffness alone.
    plant = plant._replace(
        pantograph=plant.pantograph._replace(preload=0.0), structure=plant.structure._replace(rest_force=0.0)
    )
    n, modes = plant.pantograph.mass.size, plant.structure.modes
    first = 2 + 2 * modes
    place = st.floats(-0.05, 0.05)
    speed = st.floats(-1.0, 1.0)
    state = np.array(
        [data.draw(place), data.draw(speed)]
        + [0.01 * data.draw(place) for _ in range(modes)]
        + [0.1 * data.draw(speed) for _ in range(modes)]
        + [data.draw(place) for _ in range(n)]
        + [data.draw(speed) for _ in range(n)]
    )
    scratch = memory_for(2 * n, modes).scratch
    mass, stiffness = np.array(plant.structure.mass), np.array(plant.structure.stiffness)

    def energy() -> float:
        q, v = state[first : first + n], state[first + n :]
        shape, rate = state[2 : 2 + modes], state[2 + modes : first]
        penetration = max(0.0, q[-1] - state[0])
        return float(
            0.5 * plant.drive.mass * state[1] ** 2
            + 0.5 * (mass * (rate**2 + stiffness * shape**2)).sum()
            + 0.5 * (plant.pantograph.mass * v**2).sum()
            + 0.5 * q @ plant.pantograph.stiffness @ q
            + 0.5 * plant.contact.stiffness * penetration**2
        )

    before = energy()
    allowed = 1e-6 * before + 1e-12
    for _ in range(400):
        integrate(plant, state, scratch, 0.0, Load(), 0.5 * PERIOD, 2)
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
    force, speed, true_power, true_force = [rig.state.f_tr], [rig.state.v_tr], [0.0], [rig.state.f_contact]
    for k in range(100):
        whole.advance(float(u[k]), float(u[k + 1]))
        for j in range(10):
            rig.advance(*(float(u[k] + share * (u[k + 1] - u[k])) for share in (0.1 * j, 0.1 * (j + 1))))
            force.append(rig.state.f_tr)
            speed.append(rig.state.v_tr)
            true_power.append(rig.state.f_contact * rig.state.v_true)
            true_force.append(rig.state.f_contact)

    def trapezoid(values: list[float]) -> float:
        return PERIOD * (sum(values) - 0.5 * (values[0] + values[-1]))

    assert rig.state.work == pytest.approx(trapezoid([f * v for f, v in zip(force, speed, strict=True)]), rel=1e-9)
    assert rig.state.impulse == pytest.approx(trapezoid(force), rel=1e-9)
    # True ones are summed at twice that rate: a power that changes at up to 100 rad/s differs by (w T)^2 / 16 = 2.5e-5.
    assert rig.state.true_work == pytest.approx(trapezoid(true_power), rel=1e-4)
    assert rig.state.true_impulse == pytest.approx(trapezoid(true_force), rel=1e-5)
    # Against the true ones: the bias of 0.5 N over 0.2 s and 5 mm, and noise of some 1e-4 J.
    assert rig.state.impulse == pytest.approx(rig.state.true_impulse + 0.5 * 0.2, abs=0.01)
    assert rig.state.work == pytest.approx(rig.state.true_work, rel=5e-3, abs=0.5 * 0.02)
    # Ten inner steps in one cycle see the ramp of the uplift force as ten chords of one: 0.1 %.
    assert whole.state.true_work == pytest.approx(rig.state.true_work, rel=1e-3)


def test_true_work_is_what_the_pantograph_and_its_actuator_lost(rig_parameters: Any) -> None:
    # Energy of the pantograph alone: its lift's work - dissipation - work on the drive. Without its dashpots and with a
    # constant lift: stored energy + true work = lift times frame's way. Trapezoids of 0.1 ms: 1e-5 J, and 1e-5 of the
    # exchange.
    rig = Rig(rig_parameters({"run_in": 0.0, "initial_force_share": 1.0}))
    p = set_up(chain([15.0, 7.2], [50.0, 4200.0], [0.0, 0.0]), 120.0, 5e4)
    rig.plant = rig.plant._replace(pantograph=p)

    def stored() -> float:
        q, v = rig.pantograph_state()
        depth = max(0.0, q[-1] - rig.state.w_true)
        kinetic = 0.5 * (p.mass * v**2).sum()
        return float(kinetic + 0.5 * q @ p.stiffness @ q + 0.5 * 5e4 * depth**2 - (120.0 + p.preload) * q[0])

    start, exchanged = stored(), 0.0
    for k in range(500):
        before = rig.state.true_work
        rig.advance(0.01 * np.sin(0.05 * k), 0.01 * np.sin(0.05 * (k + 1)))
        exchanged += abs(rig.state.true_work - before)
        assert stored() + rig.state.true_work == pytest.approx(start, abs=1e-5 * exchanged + 1e-5)
    assert exchanged > 5.0


def test_impulse_of_a_resting_rig_is_uplift_force_times_time(rig_parameters: Any) -> None:
    # Starts in equilibrium, so nothing moves but by the encoder's rounding: 0.01 %.
    quiet = {"imperfections.load_cell_noise": False, "imperfections.load_cell_bias": False}
    rig = Rig(rig_parameters({**quiet, "run_in": 0.0, "initial_force_share": 1.0}))
    for _ in range(500):
        rig.advance(0.0, 0.0)
    assert rig.state.impulse == pytest.approx(120.0 * 1.0, rel=1e-4)
    assert rig.state.work == pytest.approx(0.0, abs=1e-3)
