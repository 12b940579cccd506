"""Operating modes: every event in every mode, and motions without a bump whatever happens."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rig_rules import LIMITS, RETRACT, RULES, TOUCH, TS, Drive, fresh

from test_rig_sim.motion import clip, gentle
from test_rig_sim.supervisor import FOLLOWING, Mode, Ramp, Supervisor

IN_CONTACT, APART = 100.0, 0.0


def cycles(rig: Supervisor, count: int, f_tr: float = IN_CONTACT, command: bool = True) -> Ramp:
    """Let a drive that follows at once go on; commands stay where the reference is."""
    ramp = Ramp(0.0, 0.0)
    for _ in range(count):
        here = rig._reference
        ramp = rig.follow(here, here) if command else rig.bridge()
        rig.watch(ramp.end, 0.0, f_tr, 0.0, False)
    return ramp


def at(mode: Mode) -> Supervisor:
    """Bring a supervisor into a mode, by the way that leads there."""
    rig = fresh(touching=mode is not Mode.APPROACHING)
    if mode is Mode.POSITION:
        rig.select("position")
        cycles(rig, 1)
    elif mode is Mode.APPROACHING:
        cycles(rig, 1, APART)
    elif mode in FOLLOWING:
        cycles(rig, 1)
        cycles(rig, {Mode.TRACKING: 0, Mode.BRIDGING: 1, Mode.HOLDING: 2}[mode], command=False)
    elif mode is Mode.LANDING:
        rig.land()
    elif mode is Mode.RETRACTING:
        rig._reference = 0.1
        rig.retract("test")
    elif mode is Mode.STOPPED:
        rig.finish()
    assert rig.mode is mode
    return rig


def follow(rig: Supervisor) -> None:
    here = rig._reference
    rig.follow(here, here)


def land(rig: Supervisor) -> None:
    rig.land()


EVENTS: dict[str, Callable[[Supervisor], object]] = {
    "follow": follow,
    "bridge": lambda rig: rig.bridge(),
    "hold": lambda rig: rig.select("hold"),
    "position": lambda rig: rig.select("position"),
    "impedance": lambda rig: rig.select("impedance"),
    "land": land,
    "trip": lambda rig: rig.watch(0.0, 0.0, 2000.0, 0.0, False),
    "stop": lambda rig: rig.retract("emergency stop"),
    "finish": lambda rig: rig.finish(),
}
H, T, B, G, R, S, P, A, L = (
    Mode.HOLD,
    Mode.TRACKING,
    Mode.BRIDGING,
    Mode.HOLDING,
    Mode.RETRACTING,
    Mode.STOPPED,
    Mode.POSITION,
    Mode.APPROACHING,
    Mode.LANDING,
)
# One row a mode, one column an event, in the order of EVENTS.
TABLE = {
    H: (T, H, H, P, H, L, R, R, S),
    T: (T, B, H, P, T, L, R, R, S),
    B: (T, G, H, P, B, L, R, R, S),
    G: (T, G, H, P, G, L, R, R, S),
    P: (P, P, H, P, H, L, R, R, S),
    A: (A, A, H, P, A, L, R, R, S),
    L: (L, L, L, L, L, L, R, R, S),
    R: (R, R, R, R, R, R, R, R, S),
    S: (S, S, S, S, S, S, S, S, S),
}


@pytest.mark.parametrize("mode", list(Mode), ids=lambda mode: mode.name)
@pytest.mark.parametrize("event", list(EVENTS))
def test_every_event_in_every_mode(mode: Mode, event: str) -> None:
    rig = at(mode)
    EVENTS[event](rig)
    assert rig.mode is TABLE[mode][list(EVENTS).index(event)]


def test_hold_brakes_from_the_speed_of_the_drive_and_follows_no_command() -> None:
    rig, drive = fresh(entry_cycles=0), Drive()
    for k in range(200):
        drive.follow(rig.follow(0.3 * k * TS, 0.3 * (k + 1) * TS))
        rig.watch(drive.w, drive.v, IN_CONTACT, 0.0, False)
    assert drive.v == pytest.approx(0.3, rel=1e-6)
    rig.select("hold")
    most = 0.0
    for _ in range(400):
        drive.follow(rig.follow(0.0, 0.0))
        rig.watch(drive.w, drive.v, IN_CONTACT, 0.0, False)
        most = max(most, abs(drive.acceleration))
    assert rig.mode is Mode.HOLD
    assert abs(drive.v) < 1e-9
    # v^2 / 2a = 9 mm from 0.12 m on (and a cycle of sampling).
    assert drive.w == pytest.approx(0.12 + 0.3**2 / (2.0 * RULES.pace.acceleration), abs=1e-3)
    # The loop's response to a ramp in acceleration does not overshoot it by more than a few percent.
    assert most < 1.1 * RULES.pace.acceleration


def test_in_hold_missing_commands_do_no_harm() -> None:
    rig = fresh("hold")
    cycles(rig, 100, command=False)
    assert rig.mode is Mode.HOLD
    rig.select("impedance")
    cycles(rig, RULES.late_limit - 1, command=False)
    assert rig.moving
    cycles(rig, 1, command=False)
    assert rig.reason.startswith("5 successive cycles without a usable command")


def test_position_goes_to_the_start_follows_the_trajectory_and_holds() -> None:
    rig = fresh("position", reference=0.05)
    ends = []
    while rig.mode is Mode.POSITION:
        ends.append(cycles(rig, 1, command=False).end)
    samples = RULES.trajectory
    assert ends[-len(samples) : -1] == pytest.approx(samples[1:], abs=0.0)
    assert rig.mode is Mode.HOLD
    rig.select("position")  # once more
    cycles(rig, 10)
    assert rig.mode is Mode.POSITION


@pytest.mark.parametrize("elsewhere", [-0.03, 0.02])
def test_way_into_commands_is_gentle_even_if_they_are_elsewhere(elsewhere: float) -> None:
    rig, drive = fresh("hold", reference=0.05), Drive(0.05)
    rig.select("impedance")
    most, end = 0.0, 0.05
    for _ in range(RULES.entry_cycles):
        ramp = rig.follow(0.05 + elsewhere, 0.05 + elsewhere)
        assert abs(ramp.start - end) <= LIMITS.speed * TS
        end = ramp.end
        drive.follow(ramp)
        rig.watch(drive.w, drive.v, IN_CONTACT, 0.0, False)
        most = max(most, abs(drive.acceleration))
    # At the end of a cycle the reference may be ahead by what the drive gains at the full acceleration meanwhile; one
    # that gains less then has up to 2 zeta omega a Ts = 0.8 a more.
    assert 0.8 * RULES.entry_acceleration < most < 1.8 * RULES.entry_acceleration
    # 30 mm from rest to rest at 60 m/s^2 take 45 ms; 50 cycles are 100 ms.
    assert drive.w == pytest.approx(0.05 + elsewhere, abs=2e-3)


def test_soft_start_comes_down_until_the_force_says_so_and_hands_over() -> None:
    rig = fresh(reference=TOUCH.gap, touching=False)
    ramp = cycles(rig, 200, APART)
    assert rig.mode is Mode.APPROACHING
    assert (ramp.end - ramp.start) / TS == pytest.approx(-TOUCH.speed)
    cycles(rig, TOUCH.cycles - 1, TOUCH.force)
    cycles(rig, 1, APART)  # a single sample says nothing
    cycles(rig, TOUCH.cycles, TOUCH.force)
    assert rig.mode is Mode.APPROACHING and rig.touching
    before = rig._reference
    ramp = rig.follow(before, before)
    assert rig.mode is Mode.TRACKING
    assert ramp == (before, before)


def test_soft_start_without_a_pantograph_retracts() -> None:
    rig = fresh(touching=False)
    cycles(rig, 6000, APART)
    assert rig.reason == "no contact down to touch.lowest = -0.2 m"
    assert rig.mode is Mode.STOPPED


def test_impedance_after_the_contact_was_lost_begins_with_a_soft_start() -> None:
    rig = fresh()
    cycles(rig, 10)
    rig.select("hold")
    cycles(rig, 10, APART)
    rig.select("impedance")
    cycles(rig, 1, APART)
    assert rig.mode is Mode.APPROACHING


def test_landing_goes_on_until_the_contact_is_lost_and_a_gap_further() -> None:
    rig = fresh()
    cycles(rig, 10)
    assert rig.land()
    cycles(rig, 500)
    parted = rig._reference
    cycles(rig, TOUCH.cycles, APART)
    cycles(rig, 100, APART)
    cycles(rig, 50, IN_CONTACT)  # the head comes after it
    assert rig.mode is Mode.LANDING
    cycles(rig, 1500, APART)
    assert rig.mode is Mode.STOPPED and rig.landed and rig.reason == ""
    assert rig._reference > parted + TOUCH.gap
    assert not rig.land()


def test_landing_that_does_not_part_retracts() -> None:
    rig = fresh()
    cycles(rig, 10)
    rig.land()
    cycles(rig, 3200)
    assert rig.reason == "still in contact at touch.highest = 0.25 m"


def test_late_commands_do_not_stop_a_landing() -> None:
    rig = fresh()
    cycles(rig, 10)
    rig.land()
    cycles(rig, 100, command=False)
    assert rig.mode is Mode.LANDING


def test_commands_beyond_the_soft_limits_are_cut_and_counted() -> None:
    rig = fresh(reference=0.295, entry_cycles=0)
    assert rig.follow(0.295, 0.31) == Ramp(0.295, 0.3)
    assert rig.limited == 1
    # At most 3 m/s: 6 mm a cycle.
    assert rig.follow(0.3, 0.28).end == pytest.approx(0.294, abs=1e-12)
    assert rig.limited == 2


@pytest.mark.parametrize("speed", [-3.5, -0.4, 0.4, 3.5])
def test_retract_brakes_from_the_measured_state_first(speed: float) -> None:
    """A drive that runs away from its reference: the motion begins where the drive is, with the speed it has."""
    rig, drive = fresh(entry_cycles=0), Drive()
    rig.follow(0.0, 0.0)
    drive.w, drive.v = 0.1, speed
    rig.watch(drive.w, drive.v, IN_CONTACT, 0.0, False)
    rig.retract("emergency stop")
    accelerations, speeds = [], []
    for _ in range(3000):
        ramp = rig.bridge()
        speeds.append((ramp.end - ramp.start) / TS)
        drive.follow(ramp)
        accelerations.append(drive.acceleration)
        rig.watch(drive.w, drive.v, IN_CONTACT, 0.0, False)
    # The reference starts with the drive's speed, less what one cycle of braking takes, and first comes to a stop.
    assert speeds[0] == pytest.approx(speed, abs=RETRACT.braking * TS + 1e-12)
    stopped = next(i for i, found in enumerate(speeds) if found == 0.0)
    assert stopped == math.ceil(abs(speed) / (RETRACT.braking * TS) - 1e-9) - 1
    assert all(a * math.copysign(1.0, speed) >= 0.0 for a in speeds[:stopped])
    # At the beginning the loop may need what `bumpless` leaves it, then braking with a little overshoot.
    assert max(map(abs, accelerations)) < 1.15 * RETRACT.braking
    assert rig.mode is Mode.STOPPED
    assert drive.w == pytest.approx(RETRACT.position, abs=1e-6)


@pytest.mark.parametrize("state", [(0.1, 0.0), (0.0, 0.4), (math.nan, math.nan)])
def test_a_drive_that_does_not_come_to_rest_is_reported(state: tuple[float, float]) -> None:
    rig = fresh(reference=0.1)
    rig.retract("emergency stop")
    cycles = 0
    while rig.mode is Mode.RETRACTING:
        rig.bridge()
        rig.watch(*state, IN_CONTACT, 0.0, False)
        cycles += 1
        assert cycles < 2000  # half a second for the way, a second of patience
    assert cycles * TS > 1.4
    assert rig.reason == "emergency stop; the drive does not come to rest: take its power away"


@pytest.mark.parametrize("state", [(math.nan, 0.2), (0.2, math.nan), (math.inf, math.inf)])
def test_retract_on_a_measurement_that_is_not_finite_starts_at_the_reference(state: tuple[float, float]) -> None:
    rig = fresh(entry_cycles=0)
    rig.follow(0.0, 0.001)
    rig.watch(*state, IN_CONTACT, 0.0, False)
    assert rig.mode is Mode.RETRACTING
    ramp = rig.bridge()
    assert ramp.start == 0.001
    assert 0.0 <= (ramp.end - ramp.start) / TS <= RETRACT.speed


def test_what_the_drive_may_need_at_once_is_bounded() -> None:
    response = RULES.response
    low, high = gentle(response, 0.1, 0.5, 60.0)
    for reference in (low, high):
        assert abs(response.stiffness * (reference - 0.1 - response.lead * 0.5)) == pytest.approx(60.0)
    assert (clip(0.0, low, high), clip(1.0, low, high), clip(0.1 + response.lead * 0.5, low, high)) == (
        low,
        high,
        0.1 + response.lead * 0.5,
    )


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("follow"), st.floats(-0.35, 0.35)),
        st.tuples(st.just("near"), st.floats(-0.004, 0.004)),
        st.tuples(st.sampled_from(["bridge", "hold", "position", "impedance", "land", "stop"]), st.just(0.0)),
        st.tuples(st.just("run"), st.integers(1, 200).map(float)),
        st.tuples(st.just("force"), st.sampled_from([APART, IN_CONTACT])),
        st.tuples(st.just("predict"), st.floats(-0.35, 0.35)),
    ),
    max_size=60,
)
OWN = {
    Mode.HOLD: RULES.pace.acceleration,
    Mode.POSITION: RULES.pace.acceleration,
    Mode.APPROACHING: TOUCH.acceleration,
    Mode.LANDING: TOUCH.acceleration,
    Mode.RETRACTING: RETRACT.braking,
}


@given(STEPS, st.booleans(), st.sampled_from(["hold", "position", "impedance"]))
@settings(max_examples=150)
@pytest.mark.slow
def test_whatever_happens_the_reference_makes_no_jump_and_nothing_rearms(
    steps: list[tuple[str, float]], touching: bool, operation: str
) -> None:
    rig = fresh(operation, touching=touching, late_limit=20)
    drive, force = Drive(), IN_CONTACT if touching else APART
    speed, end, given_up = 0.0, 0.0, Mode.HOLD
    trajectory = max(abs(b - a) for a, b in pairwise(RULES.trajectory.tolist())) / TS
    for kind, value in steps:
        before_way = rig.mode
        count = int(value) if kind == "run" else 1
        if kind in ("hold", "position", "impedance"):
            rig.select(kind)
        elif kind == "land":
            rig.land()
        elif kind == "stop":
            rig.retract("emergency stop")
        elif kind == "force":
            force = value
        elif kind == "predict":
            rig.predict(value)
        for _ in range(count):
            way, begun = rig.mode, rig._reference
            if kind == "follow" and rig.admissible(value, value):
                ramp = rig.follow(value, value)
            elif kind in ("near", "run"):
                ramp = rig.follow(begun + value * 0.01, begun + value * 0.01)
            else:
                ramp = rig.bridge(kind == "follow")
            mode, slope = rig.mode, (ramp.end - ramp.start) / TS
            # No jump but the one to a drive that has lost its reference, and that one is where the drive is.
            coasting = drive.w + RULES.response.lead * drive.v
            reach = RETRACT.braking / RULES.response.stiffness
            reach += 1e-12
            assert abs(ramp.start - end) <= LIMITS.speed * TS + 1e-12 or abs(abs(ramp.start - coasting) - reach) < 1e-9
            assert abs(slope) * TS <= 2.0 * LIMITS.speed * TS + 1e-12 or mode is Mode.RETRACTING
            if way in OWN and mode in (way, Mode.HOLD) and before_way is way:
                # Speeds follow each other within the acceleration allowed, after a trajectory within its own.
                allowed = OWN[way] * TS if way is not Mode.POSITION else max(OWN[way] * TS, 2.0 * trajectory)
                assert abs(slope - speed) <= allowed + 1e-9
            before_way = way
            speed, end = slope, ramp.end
            if mode is Mode.STOPPED:
                assert ramp.start == ramp.end or given_up is not Mode.STOPPED
            if given_up is Mode.STOPPED:
                assert mode is Mode.STOPPED
            if given_up is Mode.RETRACTING:
                assert mode in (Mode.RETRACTING, Mode.STOPPED)
            given_up = mode
            drive.follow(ramp)
            rig.watch(drive.w, drive.v, force, 0.0, False)
            # A command that leaps may throw the drive beyond its limits: then it has tripped, and says so.
            if abs(drive.w) > LIMITS.trip_position or abs(drive.v) > LIMITS.trip_speed:
                assert not rig.moving
