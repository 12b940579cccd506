"""Sudden events and the car body: what acts on the pantograph beside the contact, alone and through the rig."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phil_base.parameters import ParameterError
from test_rig_sim.car_body import CarBody, shaper
from test_rig_sim.events import Change, Uplift, knock, pressure_share
from test_rig_sim.loads import Loads
from test_rig_sim.pantographs.motion import Load
from test_rig_sim.rig import Rig
from test_rig_sim.step import load_between

PERIOD = 0.002
DROP = {"events.pressure_time": 1.0, "events.pressure_share": 0.6, "events.pressure_ramp": 0.4}
QUIET = {"load_cell.noise": 0.0, "run_in": 0.0, "initial_force_share": 1.0}
Array = np.ndarray


def forces(rig: Rig, cycles: int) -> Array:
    found = []
    for _ in range(cycles):
        rig.advance(0.0, 0.0)
        found.append(rig.state.f_contact)
    return np.array(found)


def static(lift: float, uplift: float = 120.0) -> float:
    """Contact force of EN 50318's pantograph under a drive at 0, set up for an uplift force; springs in series, N."""
    compliance = 1.0 / 5e4 + 1.0 / 4200.0
    return (lift + 50.0 * uplift * compliance) / (1.0 + 50.0 * compliance)


# Pressure -------------------------------------------------------------------------------------------------------


def test_pressure_goes_down_and_comes_back(rig_parameters: Any) -> None:
    events = rig_parameters({**DROP, "events.pressure_return_time": 3.0}).events
    share = [pressure_share(events, t) for t in (0.0, 1.0, 1.2, 1.4, 2.0, 3.0, 3.2, 3.4, 9.0)]
    assert share == pytest.approx([1.0, 1.0, 0.8, 0.6, 0.6, 0.6, 0.8, 1.0, 1.0])
    assert pressure_share(rig_parameters({}).events, 1.2) == 1.0


def test_contact_force_settles_at_the_lowered_pressure(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters({**QUIET, **DROP}))
    f = forces(rig, 5000)
    # 0.05 N: what the encoder lets the drive creep, and the frame's slowest motion (1.4 s) after 8.6 s.
    assert f[:490] == pytest.approx(static(120.0), abs=0.05)
    assert f[-500:] == pytest.approx(static(72.0), abs=0.05)
    # A change of pressure, no jump: 48 N in 0.4 s with at most pi/2 of the mean slope, and the frame's own motion.
    assert np.abs(np.diff(f)).max() < 3.0 * 48.0 * PERIOD / 0.4


def test_uplift_force_can_be_changed_while_riding(rig_parameters: Any) -> None:
    rig = Rig(rig_parameters(QUIET))
    forces(rig, 100)
    rig.set_uplift_force(80.0)
    f = forces(rig, 50)
    rig.set_uplift_force(100.0)  # before the first change is over
    f = np.append(f, forces(rig, 5000))
    assert f[-500:] == pytest.approx(static(100.0), abs=0.05)
    # 40 N in 0.2 s; the second change begins where the first one was left, and with a slope of zero.
    assert np.abs(np.diff(f)).max() < 3.0 * 40.0 * PERIOD / 0.2
    rig.reset()
    # It is the rig's uplift force from now on: the nominal height is that of 100 N.
    assert forces(rig, 100) == pytest.approx(100.0, abs=0.01)


@given(
    force=st.floats(10.0, 300.0),
    changes=st.lists(st.tuples(st.floats(0.0, 3.0), st.floats(10.0, 300.0)), max_size=4),
    raised=st.lists(st.floats(0.0, 3.0), max_size=3),
    air=st.floats(0.0, 60.0),
)
@pytest.mark.slow
def test_lift_never_jumps(
    rig_parameters: Any, force: float, changes: list[tuple[float, float]], raised: list[float], air: float
) -> None:
    # Whatever comes on top of what: within a cycle at most pi/2 of the steepest ramps of force, run-in and pressure.
    uplift = Uplift(force, rig_parameters(DROP).events, 0.5, 0.1)
    orders = sorted([(t, "force", value) for t, value in changes] + [(t, "up or down", 0.0) for t in raised])
    lift = []
    for k in range(2000):
        t = k * PERIOD
        while orders and orders[0][0] <= t:
            _, what, value = orders.pop(0)
            if what == "force":
                uplift.change(value, t)
            elif len(orders) % 2:
                uplift.lift(t)
            else:
                uplift.lower(t)
        lift.append(uplift.at(t, air))
    steepest = 300.0 / 0.2 + 360.0 / 0.5 + 0.4 * 300.0 / 0.4
    assert np.abs(np.diff(lift)).max() <= 0.5 * math.pi * steepest * PERIOD


def test_a_lowered_pantograph_carries_nothing_until_it_is_raised(rig_parameters: Any) -> None:
    loads = Loads(rig_parameters({"run_in": 0.5}), 25.0)
    assert loads.reset(lowered=True).lift == -25.0  # the actuator holds back what the air lifts
    assert [loads.next().lift for _ in range(100)] == [-25.0] * 100
    loads.lift_pantograph()
    lift = np.array([loads.next().lift for _ in range(300)])
    assert (np.diff(lift[:250]) > 0.0).all()
    assert (lift[249:] == 120.0).all()
    loads.lower_pantograph()
    assert [loads.next().lift for _ in range(260)][-1] == -25.0
    assert loads.reset().lift == pytest.approx(0.1 * (120.0 + 25.0) - 25.0)


def test_a_change_of_no_duration_is_a_step() -> None:
    change = Change(1.0, 2.0, 3.0, 0.0)
    assert (change.at(2.999), change.at(3.0)) == (1.0, 2.0)


# Knock ----------------------------------------------------------------------------------------------------------


@given(impulse=st.floats(0.1, 20.0), duration=st.floats(0.004, 0.5))
def test_a_knock_has_its_impulse_exactly(rig_parameters: Any, impulse: float, duration: float) -> None:
    changes = {"events.knock_time": 0.1, "events.knock_impulse": impulse, "events.knock_duration": duration}
    blow = knock(rig_parameters(changes).events, PERIOD)
    force = np.array([blow.force(k) for k in range(600)])
    # Straight lines between the cycles: the trapezoidal sum is the integral.
    assert PERIOD * 0.5 * (force[1:] + force[:-1]).sum() == pytest.approx(impulse, rel=1e-9)
    assert (force >= 0.0).all()
    assert not force[:51].any()
    assert not force[51 + round(duration / PERIOD) :].any()


def test_contact_is_lost_by_a_knock_and_returns(rig_parameters: Any) -> None:
    changes = {"events.knock_time": 0.5, "events.knock_impulse": 6.0, "events.knock_duration": 0.01}
    # Head and contact spring are hardly damped in themselves; with this dashpot the bouncing is over within seconds.
    rig = Rig(rig_parameters({**QUIET, **changes, "contact.damping": 200.0}))
    f, place, speed, drive = [], [], [], []
    for _ in range(4000):
        rig.advance(0.0, 0.0)
        displacement, velocity = rig.pantograph_state()
        f.append(rig.state.f_contact)
        place.append(float(displacement[-1]))
        speed.append(float(velocity[-1]))
        drive.append(float(rig.memory.state[0]))
    force, gap = np.array(f), np.array(drive) - np.array(place)
    assert force[:249] == pytest.approx(120.0, abs=0.01)
    # No force while apart, none that pulls (the dashpot would, just before they part), and contact again.
    assert not force[gap >= 0.0].any()
    assert (force >= 0.0).all()
    apart = np.flatnonzero(force == 0.0)
    assert apart[0] < 260
    assert apart.size > 10
    assert apart[-1] < 2000
    # The head of 7.2 kg leaves with what the impulse gave it, less what the springs took meanwhile.
    assert 0.5 < -min(speed) * 7.2 / 6.0 < 1.0
    assert force[-500:] == pytest.approx(120.0, abs=0.1)


def test_a_knock_acts_on_the_head_and_not_on_the_drive(rig_parameters: Any) -> None:
    # Without contact the drive must not notice at all.
    changes = {"events.knock_time": 0.1, "events.knock_impulse": 6.0}
    struck, left = (Rig(rig_parameters({**QUIET, **c}), contact=False) for c in (changes, {}))
    for rig in (struck, left):
        for _ in range(100):
            rig.advance(0.0, 0.0)
    assert struck.state == left.state
    assert struck.pantograph_state()[0][-1] < left.pantograph_state()[0][-1] - 0.01


# Car body -------------------------------------------------------------------------------------------------------


def ride(parameters: Any, cycles: int) -> Array:
    body = CarBody(parameters.car_body, PERIOD)
    return np.array([(0.0, 0.0), *(body.next() for _ in range(cycles))])


MOVING = {
    "car_body.bounce_amplitude": 0.01,
    "car_body.bounce_frequency_hz": 1.1,
    "car_body.pitch_amplitude": 0.006,
    "car_body.random_rms": 0.004,
    "car_body.random_cut_off_hz": 2.0,
}


def test_car_body_rests_by_default(rig_parameters: Any) -> None:
    assert not ride(rig_parameters({}), 500).any()


def test_car_body_moves_continuously_and_begins_at_rest(rig_parameters: Any) -> None:
    place, rate = ride(rig_parameters(MOVING), 5000).T
    # Simpson needs the middle, so two cycles at a time; the random part's third derivative is white noise.
    moved = PERIOD / 3.0 * (rate[:-2:2] + 4.0 * rate[1:-1:2] + rate[2::2])
    assert np.diff(place[::2]) == pytest.approx(moved, abs=5e-7)
    assert np.abs(np.diff(rate)).max() < 0.02
    assert abs(place[1]) < 1e-6
    assert np.ptp(place) > 0.02


@pytest.mark.parametrize("cut_off", [0.1, 3.0, 20.0])
def test_random_part_is_stationary_with_the_stated_rms(cut_off: float) -> None:
    # P = A P A' + S S' and P_00 = rms^2: exact, so no long ride has to show it. Rounding of entries up to w^4.
    found = shaper(0.004, cut_off, PERIOD)
    covariance = found.stationary @ found.stationary.T
    after = found.transition @ covariance @ found.transition.T + found.spread @ found.spread.T
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert after / scale == pytest.approx(covariance / scale, abs=1e-9)
    assert math.sqrt(covariance[0, 0]) == pytest.approx(0.004, rel=1e-9)
    # Three equal low-passes: 1/(1 + (w/w_c)^2)^3 has rate rms = w_c / sqrt(3) times the rms itself.
    assert math.sqrt(covariance[1, 1] / covariance[0, 0]) == pytest.approx(2.0 * math.pi * cut_off / math.sqrt(3.0))
    assert np.linalg.eigvals(found.transition) == pytest.approx(math.exp(-2.0 * math.pi * cut_off * PERIOD), rel=1e-4)


def test_random_part_of_a_long_ride_has_its_rms(rig_parameters: Any) -> None:
    # 400 s of a signal of some 2 Hz: about 800 independent values, 2.5 % for one sigma; four of them.
    place = ride(rig_parameters({"car_body.random_rms": 0.004, "car_body.random_cut_off_hz": 2.0}), 200000)[:, 0]
    assert place[500:].std() == pytest.approx(0.004, rel=0.1)


def test_car_body_of_two_equal_rides_is_equal_to_the_last_bit(rig_parameters: Any) -> None:
    first = ride(rig_parameters(MOVING), 500)
    assert np.array_equal(first, ride(rig_parameters(MOVING), 500))
    assert not np.array_equal(first, ride(rig_parameters({**MOVING, "car_body.seed": 2}), 500))
    rig = Rig(rig_parameters(MOVING))
    f = forces(rig, 200)
    rig.reset()
    assert np.array_equal(forces(rig, 200), f)


def test_between_two_cycles_the_load_goes_on_smoothly() -> None:
    start, end = Load(100.0, 0.01, 0.2, 0.0), Load(110.0, 0.0104, 0.21, 8.0)
    at = [load_between(start, end, share, PERIOD) for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert at[0] == pytest.approx(start)
    assert at[4] == pytest.approx(end)
    assert (at[2].lift, at[2].knock) == (105.0, 4.0)
    # The rate is that of the place: a cubic, for which Simpson's rule is exact.
    moved = PERIOD / 12.0 * (at[0].base_rate + 4.0 * at[1].base_rate + at[2].base_rate)
    assert at[2].base - at[0].base == pytest.approx(moved, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({**DROP, "events.pressure_return_time": 1.2}, "events.*pressure_return_time = 1.2"),
        ({"events.pressure_share": -0.1}, "events.pressure_share"),
        ({"car_body.random_rms": -1.0}, "car_body.random_rms"),
    ],
)
def test_impossible_events_are_named(rig_parameters: Any, changes: dict[str, float], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        rig_parameters(changes)
