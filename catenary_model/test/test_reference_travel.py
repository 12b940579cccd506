"""Rides whose speed changes, on the catenary-fixed line: closed forms, energy, continuity, refinement."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.optimize import brentq
from test_reference_laws import TS, energy, line_without_loss, pulse, reference
from test_reference_step import CONFIG, PANTOGRAPH

from catenary_model.elements import shape_derivatives
from catenary_model.line import CARRIER_3_1, CONTACT_3_1, Line, Span, Wire
from catenary_model.reference import Config, Reference
from catenary_model.travel import Travel, TravelError, constant, over_place, over_time, start_cruise_brake


def ride_of(travel: Travel | None, **changes: object) -> tuple[Reference, np.ndarray]:
    r = Reference(Config(**{**CONFIG.__dict__, "travel": travel, **changes}))
    return r, r.ride(PANTOGRAPH, 0.5, ramp=0.1).F


@pytest.mark.parametrize(
    "travel",
    [
        constant(60.0),
        over_time([0.0, 9.0], [60.0, 60.0]),
        over_place([0.0, 300.0], [60.0, 60.0]),
        start_cruise_brake(60.0, acceleration=1.0, braking=1.0, cruise_time=9.0, start_speed=60.0),
    ],
)
def test_a_journey_at_constant_speed_is_the_ride_at_that_speed_to_the_last_bit(travel: Travel) -> None:
    one, plain = ride_of(None)
    other, journey = ride_of(travel)
    np.testing.assert_array_equal(journey, plain)
    np.testing.assert_array_equal(one.state.q, other.state.q)


def string_error(h: float, ts: float) -> tuple[float, float]:
    """Largest errors of the contact point (over all steps) and of the wire (at the end), over the largest deflection.

    d'Alembert: every point has risen by what the force had given, I/(2 rhoA c), when the last news from it left,

        w(x, t) = I(tau)/(2 rhoA c),   c (t - tau) = |x - s(tau)|,     I = integral of F

    which at the force itself is tau = t, however it moves.
    """
    wire = Wire(mass_per_length=1.35, damping=0.0, bending_stiffness=1e-3, tension=20e3)
    journey = over_time([0.0, 0.4, 0.8, 1.2], [10.0, 90.0, 90.0, 0.0])
    line = Line(contact=wire, spans=(Span(60.0, ()),))
    r = Reference(
        Config(line=line, travel=journey, spans=8, start_position=180.0, element_length=h, time_step=ts, speed=0.0)
    )
    steps = round(1.2 / ts)
    t = ts * np.arange(1, steps + 1)
    record = r.push(50.0 * np.sin(np.pi * t / 1.6) ** 2)

    def impulse(time: float) -> float:
        return 50.0 * (0.5 * time - 1.6 / (4.0 * math.pi) * math.sin(2.0 * math.pi * time / 1.6))

    c = wire.wave_speed
    per = 2.0 * wire.mass_per_length * c
    at_force = np.array([impulse(x) for x in t]) / per
    end = float(t[-1])
    exact = []
    for x in r.mesh.zeta:
        late = lambda tau, x=x: c * (end - tau) - abs(x - 180.0 - journey.at(tau)[0])  # noqa: E731
        exact.append(impulse(brentq(late, 0.0, end)) / per if late(0.0) > 0.0 else 0.0)
    error = np.abs(r.heights()[1] - np.array(exact)).max()
    return float(np.abs(record.w - at_force).max() / at_force.max()), float(error / at_force.max())


def test_a_string_under_a_force_that_accelerates_and_brakes() -> None:
    """10, 90, 90, 0 m/s with up to 225 m/s^2, against the closed form; halved steps and elements halve the error.

    First order: a force in the middle of a step acts for the whole of it, and its kink lies inside an element. The
    height under it lags by half a step's rise, 0.16 % here with 0.5 ms.
    """
    coarse, fine = string_error(1.0, 1e-3), string_error(0.5, 5e-4)
    assert max(fine) < 0.002
    assert fine[0] < 0.6 * coarse[0]
    assert fine[1] < 0.6 * coarse[1]


def test_energy_balance_of_every_step_while_the_speed_changes() -> None:
    """Newmark 1/4, 1/2 without damping, clamped: the line gains what the force does on it, to rounding.

    In a step that is the mean of the forces, each at its own place, times the wire's displacement there. In time it is
    the power of the head, F dw/dt, less that of the train, F s' w_x, whose speed it takes.
    """
    journey = over_time([0.0, 0.08, 0.2], [5.0, 60.0, 20.0])
    r = reference(line=line_without_loss(), ends="clamped", start_position=87.3, travel=journey)
    forces = pulse(200, 20.0)

    def lift(zeta: float) -> float:
        return r.height(zeta) - r.height_at_rest(zeta)

    before, zeta, work, power, worst = 0.0, 87.3, 0.0, 0.0, 0.0
    last = 0.0
    for k in range(forces.size):
        now = 87.3 + journey.at(TS * (k + 1))[0]
        if k == 0:
            r.reset()
        old = lift(zeta), lift(now)
        record = r.push(forces[k : k + 1], fresh=False)
        assert record.slack[0] == 0
        assert record.zeta[0] == now
        assert record.speed[0] == journey.at(TS * (k + 1))[1]
        done = 0.5 * ((forces[k - 1] if k else 0.0) * (lift(zeta) - old[0]) + forces[k] * (lift(now) - old[1]))
        total = energy(r)
        worst = max(worst, abs(total - before - done))
        e, _ = r.mesh.locate(now)
        slope = shape_derivatives(np.array([(now - r.mesh.start) / r.mesh.h - e]), r.mesh.h)[1][:, 0]
        static = record.speed[0] * float(slope @ r.static[:, e : e + 2].T.ravel())
        drag = record.speed[0] * float(slope @ r.state.q[0, 2:, e : e + 2].T.ravel())
        given = forces[k] * (record.v[0] - static - drag)
        power += 0.5 * TS * (last + given)
        before, zeta, work, last = total, now, work + done, given
    assert before > 0.01
    assert work == pytest.approx(before, rel=1e-9)
    # the displacements are kept to 1e-16 of 10 mm, which stiffness turns into energy
    assert worst < 1e-9 * before + 1e-12
    # order 2 in a step of 1 ms under a push of 60 ms
    assert power == pytest.approx(before, rel=3e-3)


def test_the_contact_force_goes_on_where_the_acceleration_jumps() -> None:
    """Two journeys that part at 0.2 s, one braking from then on with 60 m/s^2: the same force before, to the last bit.

    Then the places part with a tau^2/2, and so do the forces: two steps after the jump their difference falls to a
    quarter when the step is halved. Did the force jump, it would not fall at all.
    """
    cruise, brakes = over_time([0.0, 0.2, 0.5], [60.0, 60.0, 60.0]), over_time([0.0, 0.2, 0.5], [60.0, 60.0, 42.0])
    first = []
    for ts in (1e-3, 5e-4, 2.5e-4):
        F, G = (ride_of(journey, time_step=ts)[1] for journey in (cruise, brakes))
        at = round(0.2 / ts)
        np.testing.assert_array_equal(F[: at - 1], G[: at - 1])
        first.append(np.abs(F[at + 1] - G[at + 1]))
        assert np.abs(F - G).max() > 5.0
    assert first[0] < 0.05
    assert first[1] < first[0] / 3.0
    assert first[2] < first[1] / 3.0


@pytest.mark.slow
def test_start_and_stop_converge_with_mesh_and_step() -> None:
    """From rest over 40 m/s to rest: each halving of element and step brings force and height nearer to the finest."""
    journey = start_cruise_brake(40.0, acceleration=20.0, braking=20.0, distance=100.0, jerk=80.0)
    grid = np.arange(0.2, journey.end, 0.01)
    runs = []
    for h, ts in ((1.0, 1e-3), (0.5, 5e-4), (0.25, 2.5e-4), (0.125, 1.25e-4)):
        r = Reference(Config(travel=journey, spans=6, start_position=110.0, element_length=h, time_step=ts))
        record = r.ride(PANTOGRAPH, journey.end, ramp=0.2)
        assert r.unsettled_steps == 0
        assert record.speed[-1] == pytest.approx(0.0, abs=1e-9)
        smooth = np.convolve(record.F, np.full(round(0.04 / ts), ts / 0.04), mode="same")
        runs.append((np.interp(grid, record.t, smooth), np.interp(grid, record.t, record.w)))
    errors = [[np.sqrt(((x - y) ** 2).mean()) for x, y in zip(run, runs[-1], strict=True)] for run in runs[:-1]]
    assert errors[0][0] > 1.5 * errors[1][0] > 2.0 * errors[2][0]
    assert errors[0][1] > 1.5 * errors[1][1] > 2.0 * errors[2][1]
    assert errors[2][0] < 0.02 * runs[-1][0].std()
    assert errors[2][1] < 2e-4


@pytest.mark.slow
def test_after_a_stop_the_force_is_that_of_a_pantograph_at_rest() -> None:
    """Place changes no more, and F = f_up - k_1 y_1 with the head where it is; wires damped to come to rest."""
    wires = {
        "carrier": dataclasses.replace(CARRIER_3_1, damping=20.0),
        "contact": dataclasses.replace(CONTACT_3_1, damping=20.0),
    }
    journey = over_time([0.0, 2.0], [30.0, 0.0])
    r = Reference(Config(line=Line(**wires), travel=journey, spans=6, element_length=1.0, time_step=1e-3))
    record = r.ride(PANTOGRAPH, 20.0)
    stands = record.t >= 2.0
    np.testing.assert_allclose(record.zeta[stands], 120.0, rtol=1e-12)
    frame = (260.0 + 4200.0 * record.head[-1]) / 4250.0
    # the slowest motion, of 0.6/s or faster, leaves 2e-5 of 260 N after 18 s
    assert record.F[-1] == pytest.approx(260.0 - 50.0 * frame, abs=0.05)


def test_a_journey_too_fast_for_the_line_or_off_the_mesh_is_refused() -> None:
    with pytest.raises(TravelError, match=r"travel: speed = 110 m/s at t = 1 s: allowed is 0 to 109.5 m/s"):
        Config(travel=over_time([0.0, 1.0], [0.0, 110.0]))
    with pytest.raises(ValueError, match="contact point"):
        ride_of(over_time([0.0, 0.1], [60.0, 109.0]), start_position=85.0)
