"""Laws of the nonlinear frame: closed forms, and that friction and stops only take energy."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from phil_base.parameters import ParameterError
from test_rig_sim.mounting import mount
from test_rig_sim.pantographs.frame import AMBIENT, Frame, air_spring, bellows_volume, end_stops, frame_force, friction
from test_rig_sim.pantographs.motion import Pantograph, rate
from test_rig_sim.pantographs.statics import set_up

FRAME = Frame(
    friction=6.0,
    breakaway=9.0,
    stribeck_speed=0.05,
    friction_speed=0.01,
    stop_stiffness=2e4,
    stop_damping=300.0,
    lower_stop=-0.3,
    upper_stop=0.25,
    area=3.4e-4,
    area_slope=5e-5,
    volume=1.5e-3,
    exponent=1.2,
    inertia_slope=0.2,
)
HEIGHTS = st.floats(-0.4, 0.4)
Array = np.ndarray


def bellows_energy(frame: Frame, lift: float, h: float) -> float:
    """Energy of the gas and of the ambient air in J, 0 at h = 0: minus the integral of pressure over volume."""
    V0, V = frame.volume, bellows_volume(frame.volume, frame.area, frame.area_slope, h)
    p0, n = AMBIENT + lift / frame.area, frame.exponent
    gas = p0 * V0 * math.log(V / V0) if n == 1.0 else p0 * V0**n * (V ** (1.0 - n) - V0 ** (1.0 - n)) / (1.0 - n)
    return AMBIENT * (V - V0) - gas


@pytest.mark.parametrize("lift", [0.0, 70.0, 150.0])
@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4])
def test_air_spring_at_nominal_height(lift: float, exponent: float) -> None:
    frame = FRAME._replace(exponent=exponent)
    assert air_spring(frame, 0.0, lift) == pytest.approx(lift, rel=1e-12, abs=1e-12)
    # Closed form of its rate there: -n (p_0 + F/A) A^2 / V and what the leverage changes. Central difference: 1e-7.
    stiffness = (air_spring(frame, 1e-5, lift) - air_spring(frame, -1e-5, lift)) / 2e-5
    pressure = AMBIENT + lift / frame.area
    expected = -exponent * pressure * frame.area**2 / frame.volume + lift / frame.area * frame.area_slope
    assert stiffness == pytest.approx(expected, rel=1e-6)


@given(h=HEIGHTS, lift=st.floats(0.0, 200.0), exponent=st.sampled_from([1.0, 1.2, 1.4]))
def test_air_spring_is_the_gradient_of_the_gas_s_energy(h: float, lift: float, exponent: float) -> None:
    # So it creates no energy. Central difference over 0.1 mm of an energy of some 50 J: 1e-6 N by curvature, 1e-9 by
    # rounding.
    frame = FRAME._replace(exponent=exponent)
    step = 1e-4
    slope = (bellows_energy(frame, lift, h + step) - bellows_energy(frame, lift, h - step)) / (2.0 * step)
    assert air_spring(frame, h, lift) == pytest.approx(-slope, abs=1e-5)


def test_without_bellows_the_actuator_s_force_does_not_know_the_height() -> None:
    assert {air_spring(FRAME._replace(area=0.0), h, 80.0) for h in (-0.3, 0.0, 0.2)} == {80.0}


@given(st.floats(-5.0, 5.0))
def test_friction_opposes_motion_and_is_bounded(v: float) -> None:
    assert friction(FRAME, v) * v <= 0.0
    assert friction(FRAME, -v) == -friction(FRAME, v)
    assert abs(friction(FRAME, v)) <= FRAME.breakaway


def test_friction_goes_from_breakaway_to_coulomb() -> None:
    # tanh is 1 to 1e-8 from ten times the build-up speed on; the Stribeck part is exp(-(v / v_S)^2).
    frame = FRAME._replace(friction_speed=1e-3)
    for v in (0.01, 0.03, 0.1):
        assert friction(frame, v) == pytest.approx(-(6.0 + 3.0 * math.exp(-((v / 0.05) ** 2))), rel=1e-7)
    assert friction(frame, 1.0) == pytest.approx(-6.0, rel=1e-12)
    assert friction(frame._replace(breakaway=0.0), 0.02) == pytest.approx(-6.0, rel=1e-12)
    assert friction(frame._replace(friction=0.0), 0.02) == 0.0


@given(h=HEIGHTS, v=st.floats(-3.0, 3.0))
def test_stops_only_push_and_only_beyond(h: float, v: float) -> None:
    force = end_stops(FRAME, h, v)
    if -0.3 <= h <= 0.25:
        assert force == 0.0
    else:
        assert force * h <= 0.0
    assert frame_force(FRAME._replace(stop_stiffness=0.0), h, v, 0.0) == pytest.approx(
        air_spring(FRAME, h, 0.0) + friction(FRAME, v)
    )


@given(
    amplitude=st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=4),
    phase=st.lists(st.floats(0.0, 6.3), min_size=4, max_size=4),
    frequency=st.floats(0.1, 8.0),
)
@settings(max_examples=60)
@pytest.mark.slow
def test_friction_and_stops_take_energy_on_every_closed_path(
    amplitude: list[float], phase: list[float], frequency: float
) -> None:
    # A periodic motion of four harmonics; the frame without its bellows gives nothing back over one period. Friction
    # alone takes F_C times the way but for the smoothing; the sum over 4000 instants is good to 1e-3 of the stops
    # energy.
    w, n = 2.0 * math.pi * frequency, 4000
    t = np.arange(n) / (n * frequency)
    harmonics = [(i + 1, a, phase[i]) for i, a in enumerate(amplitude)]
    h = sum(a * np.sin(i * w * t + p) for i, a, p in harmonics)
    v = sum(a * i * w * np.cos(i * w * t + p) for i, a, p in harmonics)
    frame = FRAME._replace(area=0.0)
    power = np.array([frame_force(frame, *pair, 0.0) * pair[1] for pair in zip(h, v, strict=True)])
    rubbed = np.array([friction(frame, speed) * speed for speed in v])
    stored = 0.5 * frame.stop_stiffness * np.maximum(0.0, np.maximum(h - 0.25, -0.3 - h)).max() ** 2
    assert power.mean() / frequency <= rubbed.mean() / frequency + 1e-3 * stored + 1e-12
    assert rubbed.max() <= 0.0


@njit
def energies(p: Pantograph, x: Array, lift: float, h: float, steps: int, shown: Array) -> None:
    """Runge-Kutta steps of h (s) without contact; shown (steps, m) takes the state before each."""
    slopes = np.empty((4, x.size))
    for k in range(steps):
        shown[k] = x
        for i in range(4):
            stage = x + (h if i == 3 else 0.5 * h) * slopes[i - 1] if i > 0 else x.copy()
            rate(p, stage, lift, 0.0, 0.0, 0.0, slopes[i])
        x += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])


def energy(p: Pantograph, x: Array, lift: float) -> float:
    """Energy of the pantograph in J: both masses, their spring, bellows, stops, lift by the air."""
    frame = p.frame
    h = x[0] - frame.rest
    beyond = max(0.0, h - frame.upper_stop, frame.lower_stop - h)
    kinetic = 0.5 * p.mass[0] * (1.0 + frame.inertia_slope * h) * x[2] ** 2 + 0.5 * p.mass[1] * x[3] ** 2
    springs = 0.5 * p.stiffness[1, 1] * (x[1] - x[0]) ** 2 + 0.5 * frame.stop_stiffness * beyond**2
    return float(kinetic + springs + bellows_energy(frame, lift, h) - frame.air * h)


@given(
    place=st.tuples(st.floats(-0.35, 0.3), st.floats(-0.02, 0.02)),
    speed=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)),
    lift=st.floats(0.0, 200.0),
)
@settings(max_examples=40, deadline=None)
@pytest.mark.slow
def test_the_pantograph_creates_no_energy(
    rig_parameters: Any, place: tuple[float, float], speed: tuple[float, float], lift: float
) -> None:
    # Any motion, into the stops as well. Runge-Kutta takes energy in smooth motion; a stop that is met within a step
    # of 0.1 ms is seen too late by half a step at most, k v^2 h^2 / 8 = 1e-4 J at 2 m/s.
    bare = mount(rig_parameters({"pantograph": "nonlinear", "nonlinear_frame.inertia_slope": 0.2}))
    p = set_up(bare, 120.0, 5e4)
    frame = p.frame.rest + place[0]
    x, shown = np.array([frame, frame + place[1], *speed]), np.empty((8000, 4))
    energies(p, x, lift, 1e-4, 8000, shown)
    found = np.array([energy(p, state, lift) for state in shown[::10]])
    assert np.diff(found).max() <= 1e-4
    assert found[-1] < found[0] + 1e-9


@pytest.mark.slow
def test_without_dissipation_the_energy_stays(rig_parameters: Any) -> None:
    # Only bellows, changing inertia and springs: Runge-Kutta's own loss, (w h)^5 / 144 a step with w = 30/s, is 1e-15.
    changes = {"friction": 0.0, "stop_stiffness": 0.0, "inertia_slope": 0.4, "area_slope": 1e-4}
    bare = mount(rig_parameters({"pantograph": "nonlinear", **{f"nonlinear_frame.{k}": v for k, v in changes.items()}}))
    p = set_up(bare, 120.0, 5e4)
    p.damping[:] = 0.0
    x, shown = np.array([p.frame.rest, p.frame.rest + 0.01, 0.3, -0.2]), np.empty((8000, 4))
    energies(p, x, 10.0, 1e-4, 8000, shown)
    found = np.array([energy(p, state, 10.0) for state in shown[::10]])
    assert np.ptp(shown[:, 0]) > 0.05
    assert found == pytest.approx(found[0], abs=1e-9)


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"volume": 1e-4}, "volume"),
        ({"area_slope": -2e-3}, "area"),
        ({"inertia_slope": -1.0, "upper_stop": 1.5}, "inertia_slope"),
    ],
)
def test_impossible_frames_are_named(rig_parameters: Any, changes: dict[str, float], word: str) -> None:
    with pytest.raises(ParameterError, match=rf"nonlinear_frame.*{word}"):
        rig_parameters({f"nonlinear_frame.{name}": value for name, value in changes.items()})
