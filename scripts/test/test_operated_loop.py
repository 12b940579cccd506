"""Operating modes with catenary, controller and simulated rig: soft start, landing, hold, position, stops."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from phil_loop import ClosedLoop, settings
from phil_loop.events import Action, emergency_stop, land, operation
from test_rig_sim.supervisor import FOLLOWING, Mode

TS = 0.002
STATIC = 120.0
RETRACT_REACH = 2e-3
"""m, largest lead of the reference in this ride: 100 m/s^2 over omega^2."""


class Seen(NamedTuple):
    """Columns that the tests look at; `v_drive` is the simulated drive's own."""

    mode: np.ndarray
    start: np.ndarray
    end: np.ndarray
    w_tr: np.ndarray
    v_drive: np.ndarray
    f_contact: np.ndarray
    w_env: np.ndarray
    w_cat: np.ndarray
    delta_work: np.ndarray


def ride(cycles: int, events: dict[int, Action], rig: dict[str, Any] | None = None) -> tuple[ClosedLoop, Seen]:
    """Ride so many cycles, or until the drive rests."""
    speeds = []
    loop = ClosedLoop(
        settings(test_rig_sim=rig or {}), observers=[lambda moment: speeds.append(moment.loop.rig.memory.state[1])]
    )
    going = loop.begin(0.0, events)
    going.run(cycles)
    found = going.record()
    columns = [
        found.rig.mode, found.ramp.start, found.ramp.end, found.rig.w_tr, np.array(speeds), found.true.f_contact,
        found.command.w_env, found.wire.w_cat, found.books.delta_work,
    ]  # fmt: skip
    return loop, Seen(*columns)


def begins(record: Seen, mode: Mode) -> list[int]:
    """First cycles of each time in this mode."""
    inside = record.mode == mode
    return [k for k in range(1, len(inside)) if inside[k] and not inside[k - 1]]


def acceleration(record: Seen, cycles: slice) -> float:
    return float(np.abs(np.diff(record.v_drive[cycles])).max() / TS)


@pytest.mark.parametrize("pantograph", ["en50318", "three_mass"])
@pytest.mark.slow
def test_soft_start_and_landing(pantograph: str) -> None:
    """From apart over the ride to apart again; the touch is a fraction of the static force of 120 N."""
    loop, record = ride(4500, {2500: land}, {"start": "apart", "pantograph": pantograph})
    (down,), (up,), (stop,) = (begins(record, mode) for mode in (Mode.APPROACHING, Mode.LANDING, Mode.STOPPED))
    touched = begins(record, Mode.TRACKING)[0]
    assert down == 1 and touched < up < stop
    assert record.f_contact[:10].max() == 0.0
    # Head of 7.2 (7.5) kg against 0.02 m/s: a half sine of sqrt(k m) v = 12 N.
    assert record.f_contact[: touched + 1].max() < 15.0
    assert record.f_contact[: touched + 50].max() < 0.4 * STATIC
    # Then the drive goes from the head (30 mm up) to the wire, at up to 0.1 m/s, and meets the head again.
    assert record.f_contact[: touched + 250].max() < STATIC
    # The handover is no harder than the ride, and the ride is one.
    riding = slice(touched + 750, up)
    assert acceleration(record, slice(touched - 1, touched + 100)) < acceleration(record, riding)
    # The wire is lifted by 40 mm in the mean, which takes 2 to 6 N off (frame springs of 50 and 160 N/m).
    assert record.f_contact[riding].mean() == pytest.approx(STATIC, rel=0.08)
    assert np.abs(record.w_tr[riding] - record.w_env[riding]).max() < 1e-3
    # The reference makes no jump where the drive goes its own way.
    own = slice(up + 1, stop)
    assert np.abs(record.start[own] - record.end[up : stop - 1]).max() < 1e-12
    assert acceleration(record, slice(up - 1, stop)) < acceleration(record, riding)
    assert record.f_contact[stop:].max() == 0.0
    assert loop.rig_cycle.supervisor.landed and loop.rig_cycle.supervisor.reason == ""
    # A wire that nobody lifts goes back to where it hangs.
    for _ in range(500):
        loop.catenary.step(0.0)
    assert abs(loop.catenary.w_cat) < 0.03


@pytest.mark.slow
def test_hold_and_position_during_a_ride_and_back() -> None:
    settings = {"trajectory.center": 0.05, "trajectory.amplitude": 0.01, "trajectory.duration": 2.0}
    events = {
        1500: operation("hold"),
        2000: operation("impedance"),
        2750: operation("position"),
        3500: operation("impedance"),
    }
    loop, record = ride(4250, events, settings)
    pace = loop.rig_cycle.supervisor._rules.pace
    normal = slice(500, 1500)
    assert loop.rig_cycle.supervisor.mode in FOLLOWING and loop.rig_cycle.supervisor.reason == ""
    for first, mode, last in ((1501, Mode.HOLD, 2000), (2751, Mode.POSITION, 3500)):
        assert set(record.mode[first : last + 1]) == {mode}
        # Reference: no jump but the first one, which takes the acceleration of the moment away; speed: what the drive
        # had (its observer is good to 10 mm/s), then within the acceleration.
        own = slice(first - 1, last)
        assert np.abs(record.start[own] - record.end[first - 2 : last - 1]).max() < RETRACT_REACH
        assert np.abs(record.start[own][1:] - record.end[own][:-1]).max() < 1e-12
        slope = (record.end[own] - record.start[own]) / TS
        assert abs(slope[0] - record.v_drive[first - 1]) < pace.acceleration * TS + 0.01
        assert np.abs(np.diff(slope)).max() < 2.5 * pace.acceleration * TS  # the trajectory's own: 0.4 m/s^2 and fade
        assert acceleration(record, slice(first - 1, last)) < acceleration(record, normal)
    for back in (2001, 3501):
        assert set(record.mode[back : back + 500]) <= set(FOLLOWING)
        after = slice(back - 1, back + 100)
        assert acceleration(record, after) < 1.5 * acceleration(record, normal)
        assert record.f_contact[after].max() < 1.2 * record.f_contact[normal].max()
        settled = slice(back + 300, back + 700)
        assert np.abs(record.w_tr[settled] - record.w_env[settled]).max() < 1e-3
    assert record.w_tr[3200] == pytest.approx(loop.rig.memory.signals[0], abs=0.1)
    # Books stand still while the drive goes its own way.
    assert record.delta_work[2000] == pytest.approx(record.delta_work[1502], abs=1e-12)
    assert record.delta_work[3500] == pytest.approx(record.delta_work[2752], abs=1e-12)


@pytest.mark.slow
def test_position_follows_its_trajectory() -> None:
    """A sine of 1 Hz: the loop's lag of 2 zeta / omega + dead time of 7 ms is 0.5 mm of 10 mm."""
    settings = {"operating_mode": "position", "trajectory.center": -0.05, "trajectory.duration": 4.0}
    loop, record = ride(2600, {}, settings)
    begin = next(k for k in range(1, 2600) if record.end[k] == -0.05 == record.start[k])
    k = np.arange(begin + 600, begin + 1400)
    wanted = -0.05 + 0.01 * np.sin(2.0 * np.pi * TS * (k - begin - 1))
    assert np.abs(record.end[k] - wanted).max() < 3e-4
    assert np.abs(record.w_tr[k] - wanted).max() < 1e-3
    assert loop.rig_cycle.supervisor.mode is Mode.HOLD
    assert record.end[-1] == pytest.approx(-0.05, abs=1e-9)


@pytest.mark.parametrize("cause", ["emergency stop", "load cell", "saturation"])
@pytest.mark.slow
def test_a_stop_ends_clear_of_the_pantograph_whatever_the_cause(cause: str) -> None:
    def strike(loop: ClosedLoop) -> None:
        state = loop.rig.state
        if cause == "emergency stop":
            emergency_stop(loop)
        elif cause == "load cell":
            loop.rig_cycle.supervisor.watch(state.w_tr, state.v_tr, 1500.0, state.current, False)
        else:
            for _ in range(100):
                loop.rig_cycle.supervisor.watch(state.w_tr, state.v_tr, state.f_tr, 30.0, True)

    loop, record = ride(2600, {1200: strike}, {})
    (first,) = begins(record, Mode.RETRACTING)
    assert first == 1201
    assert record.mode[-1] == Mode.STOPPED
    assert loop.rig_cycle.supervisor.reason
    assert record.w_tr[-1] == pytest.approx(0.2, abs=1e-3)
    # Where it rests, the head of a pantograph that goes down does not reach it for long.
    resting = [loop.rig_cycle.bridge(refused=False).f_contact for _ in range(700)]
    assert max(resting[500:]) == 0.0
    assert acceleration(record, slice(1202, 2600)) < 60.0
    # With the pantograph going down while the drive goes up the force only falls; the wire's swing is on it.
    assert record.f_contact[1201:].max() < 250.0
