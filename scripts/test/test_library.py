"""The closed loop as a library: its settings, its rides, what an operator and an observer can do, own controllers."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import FrozenInstanceError, fields

import numpy as np
import pytest

from energy_monitor.contact_quality import contact_quality_of
from impedance_mpc.controller import Command, EnvironmentReading, RigReading
from impedance_mpc.switching import ENVIRONMENTS
from phil_base.parameters import ParameterError
from phil_loop import ClosedLoop, Moment, Record, resolve, settings
from phil_loop.events import control, correction, emergency_stop, environment, land, operation, uplift_force
from test_rig_sim.supervisor import Mode

QUICK = {"run_in": 0.2}


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    return ClosedLoop(settings(speed_kmh=250, duration=1.0, test_rig_sim=QUICK))


def columns(record: Record) -> dict[str, np.ndarray]:
    found = {}
    for group in ("rig", "true", "wire", "command", "ramp", "books"):
        part = getattr(record, group)
        found |= {f"{group}.{entry.name}": getattr(part, entry.name) for entry in fields(part)}
    return found


def assert_equal(first: Record, second: Record) -> None:
    for (name, one), other in zip(columns(first).items(), columns(second).values(), strict=True):
        np.testing.assert_array_equal(one, other, name)
    assert (first.outcome, first.reason) == (second.outcome, second.reason)


# Settings ------------------------------------------------------------------------------------------------------


def test_settings_by_keyword_are_those_of_the_command_line() -> None:
    found = settings(
        speed_kmh=200,
        pantograph="three_mass",
        seed=3,
        rig="harsh",
        impedance_mpc={"control": "integrated", "weights": {"position": 2.0}},
    )
    overrides = {
        "catenary_model": {"speed_kmh": 200},
        "test_rig_sim": {"pantograph": "three_mass", "seed": 3},
        "impedance_mpc": {"control": "integrated", "weights.position": 2.0},
    }
    assert found == resolve(None, overrides, "harsh")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"speed_kmh": -1}, "catenary_model: parameter 'speed_kmh' = -1 is not allowed: a number from"),
        ({"rig": "soft"}, "--rig: there is no rig 'soft' (rigs: "),
        ({"speed_khm": 200}, "settings: there is no 'speed_khm'; did you mean 'speed_kmh'?"),
        ({"impedance_mpc": {"contrl": 1}}, "impedance_mpc: parameter 'contrl' = 1 is unknown; did you mean 'control'?"),
        ({"impedance_mpc": "integrated"}, "settings: 'impedance_mpc' = 'integrated' is not allowed: a mapping"),
        ({"line": "nowhere"}, "nowhere"),
    ],
)
def test_what_is_wrong_in_settings_is_said_in_one_line(given: dict, said: str) -> None:
    with pytest.raises(ParameterError) as caught:
        settings(**given)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_the_library_loads_nothing_of_ros() -> None:
    code = (
        "import sys; from phil_loop import ClosedLoop, settings; import phil_loop.events; "
        "ClosedLoop(settings()); found = [m for m in sys.modules if m.split('.')[0] in "
        "('rclpy', 'phil_interfaces', 'std_msgs', 'builtin_interfaces')]; assert not found, found"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


# Rides ---------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_two_rides_of_one_loop_are_equal_to_the_bit_whatever_happened_in_between(loop: ClosedLoop) -> None:
    first = loop.ride()
    loop.ride(0.4, {0.1: [environment("reduced"), control("cascaded"), uplift_force(80.0)], 0.2: emergency_stop})
    assert_equal(first, loop.ride())
    assert first.cycles == 500 and first.outcome == "through" and first.reason == ""
    assert first.time[-1] == pytest.approx(0.998)


def test_a_longer_ride_begins_as_a_shorter_one(loop: ClosedLoop) -> None:
    short, long = loop.ride(0.2), loop.ride(0.4)
    assert (short.cycles, long.cycles) == (100, 200)
    for name, column in columns(short).items():
        kept = 99 if name.startswith("ramp") else 100  # the last cycle moves nothing
        np.testing.assert_array_equal(column[:kept], columns(long)[name][:kept], name)
    assert np.isnan(short.ramp.end[-1]) and not np.isnan(long.ramp.end[99])


def test_a_record_cannot_be_changed_by_name(loop: ClosedLoop) -> None:
    record = loop.ride(0.01)
    with pytest.raises(FrozenInstanceError):
        record.outcome = "landed"  # type: ignore[misc]


def test_the_parts_are_timed_if_that_is_asked_for(loop: ClosedLoop) -> None:
    assert loop.ride(0.1).times is None
    times = loop.ride(0.1, timed=True).times
    assert times is not None
    assert (times.controller > 0).all() and (times.catenary > 0).all() and (times.rig[:-1] > 0).all()


def test_an_endless_ride_is_refused_in_one_line() -> None:
    endless = ClosedLoop(settings(duration=0.0))
    with pytest.raises(ParameterError, match="'duration' = 0"):
        endless.ride()
    assert endless.ride(0.02).cycles == 10


# Events --------------------------------------------------------------------------------------------------------


def test_an_event_is_done_before_the_command_of_its_cycle(loop: ClosedLoop) -> None:
    record = loop.ride(
        events={100: environment("mass_spring_damper"), 0.4: environment("catenary"), 0.6: operation("hold")}
    )
    active = record.command.environment
    assert active[99] == active[200] == ENVIRONMENTS.index("catenary")
    assert set(active[100:200]) == {ENVIRONMENTS.index("mass_spring_damper")}
    assert record.rig.mode[300] == Mode.TRACKING and set(record.rig.mode[301:]) == {Mode.HOLD}


def test_the_correction_force_is_switched_off_and_on(loop: ClosedLoop) -> None:
    off = loop.ride(events={0.2: correction(False), 0.8: correction(True)}).command.f_cor
    assert np.abs(off[:100]).max() > 0.0 and np.abs(off[401:]).max() > 0.0
    assert not off[100:400].any()


@pytest.mark.slow
def test_a_landing_ends_the_ride_where_the_drive_rests() -> None:
    landing = ClosedLoop(settings(duration=1.0, test_rig_sim={**QUICK, "land_at_end": True}))
    by_itself = landing.ride()
    assert by_itself.outcome == "landed" and by_itself.cycles > 500
    assert by_itself.rig.mode[500] == Mode.LANDING and by_itself.rig.mode[-1] == Mode.STOPPED
    assert by_itself.true.f_contact[-1] == 0.0
    asked = landing.ride(events={0.5: land})
    assert asked.outcome == "landed" and asked.rig.mode[251] == Mode.LANDING


def test_an_emergency_stop_is_a_retract_with_its_reason(loop: ClosedLoop) -> None:
    record = loop.ride(6.0, {0.5: emergency_stop})
    assert (record.outcome, record.reason) == ("retracted", "emergency stop")
    assert record.rig.mode[251] == Mode.RETRACTING and record.cycles < 3000


@pytest.mark.parametrize("when", [-1, -0.5, float("nan"), True, "1"])
def test_an_event_has_a_time(loop: ClosedLoop, when: float) -> None:
    with pytest.raises(ValueError, match="neither a cycle"):
        loop.ride(0.1, {when: land})


def test_an_event_that_cannot_be_is_refused(loop: ClosedLoop) -> None:
    for action, said in (
        (environment("water"), "environment 'water' is none of"),
        (operation("fly"), "operating mode 'fly' is none of"),
        (control("none"), "'control' = 'none' is not allowed"),
        (uplift_force(-5.0), "'uplift_force' = -5.0 is not allowed"),
    ):
        with pytest.raises(ValueError, match=said):
            loop.ride(0.1, {0.05: action})


# Observers and own controllers ---------------------------------------------------------------------------------


def test_an_observer_sees_each_cycle_with_its_states_command_and_program() -> None:
    seen, gradients = [], []

    def look(moment: Moment) -> None:
        assert moment.loop.catenary.w_cat == moment.wire.w
        seen.append((moment.cycle, moment.following, moment.rig.w_true, moment.wire.displacement[0], moment.command))
        control = moment.loop.control
        assert control is not None
        gradients.append(control.switch.controller.problem.gradient.copy())

    watched = ClosedLoop(settings(duration=0.2), observers=[look])
    record = watched.ride()
    assert [entry[0] for entry in seen] == list(range(100))
    assert [entry[1] for entry in seen] == [False] + [True] * 99
    np.testing.assert_array_equal([entry[2] for entry in seen], record.true.w_true)
    np.testing.assert_array_equal([entry[4].u_tr for entry in seen], record.command.u_tr)
    assert len({gradient.tobytes() for gradient in gradients}) == 100


def test_an_observer_changes_nothing_and_may_end_the_ride(loop: ClosedLoop) -> None:
    def stop(moment: Moment) -> None:
        if moment.cycle == 49:
            moment.loop.stop()

    watched = ClosedLoop(loop.settings, observers=[stop])
    record, plain = watched.ride(), loop.ride(0.1)
    assert record.outcome == "stopped" and record.cycles == 50
    for name, column in columns(plain).items():
        np.testing.assert_array_equal(column, columns(record)[name], name)


class Follower:
    """Sends the drive where the wire is, and gives the wire the force that is measured."""

    def __init__(self, ts: float) -> None:
        self.ts = ts
        self.resets = 0

    def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
        return Command(u_tr=wire.w, u_tr_next=wire.w + self.ts * wire.v, f_cat=rig.f_tr)

    def reset(self) -> None:
        self.resets += 1


@pytest.mark.slow
def test_an_own_controller_takes_the_place_of_ours() -> None:
    """It is the cascaded control without its approach: the same forces and motion within what that makes."""
    own = ClosedLoop(settings(duration=1.0), Follower(0.002))
    ours = ClosedLoop(settings(duration=1.0, impedance_mpc={"control": "cascaded", "approach_time": 0.0}))
    record, cascaded = own.ride(), ours.ride()
    assert record.outcome == "through"
    for name in ("rig.w_tr", "rig.f_tr", "wire.w_cat", "command.f_cat", "books.e_tr", "books.work_cat"):
        np.testing.assert_array_equal(columns(record)[name], columns(cascaded)[name], name)
    with pytest.raises(ValueError, match="has no environments"):
        own.ride(events={0.1: environment("reduced")})


def test_a_controller_without_its_methods_is_refused() -> None:
    with pytest.raises(TypeError, match="has no method 'command'"):
        ClosedLoop(settings(), object())  # type: ignore[arg-type]


def test_a_force_that_is_none_ends_the_ride_as_it_would_hold_up_the_nodes() -> None:
    class Lost(Follower):
        def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
            return Command(f_cat=float("nan"))

    record = ClosedLoop(settings(duration=1.0), Lost(0.002)).ride()
    assert (record.outcome, record.reason, record.cycles) == ("stuck", "command 0: f_cat = nan N", 1)


def test_without_limits_the_drive_gets_each_command_as_it_is() -> None:
    class Wild(Follower):
        def command(self, rig: RigReading, wire: EnvironmentReading, following: bool) -> Command:
            at = 0.3 if self.resets % 2 else -0.3
            self.resets += 1
            return Command(u_tr=at, u_tr_next=-at, f_cat=rig.f_tr)

    free = ClosedLoop(settings(duration=0.1), Wild(0.002), limits=False).ride()
    np.testing.assert_array_equal(free.ramp.start[:-1], free.command.u_tr[:-1])
    np.testing.assert_array_equal(free.ramp.end[:-1], free.command.u_tr_next[:-1])
    bound = ClosedLoop(settings(duration=0.5), Wild(0.002)).ride()
    assert bound.outcome != "through" or bound.rig.mode[-1] == Mode.RETRACTING


def test_contact_statistics_are_those_of_the_monitor(loop: ClosedLoop) -> None:
    record = loop.ride()
    assert record.contact_statistics(0.5) == contact_quality_of(record.rig.f_tr, 0.002, 0.5, 2.0)
    assert record.contact_statistics().samples == 0  # shorter than the monitor's run-in
    assert record.contact_statistics(0.5, true=True) == contact_quality_of(record.true.f_contact, 0.002, 0.5, 2.0)
