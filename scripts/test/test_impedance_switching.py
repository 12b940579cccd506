"""Switching the environment during a ride, with the catenary, the controllers and the simulated rig."""

import itertools
from typing import NamedTuple

import numpy as np
import pytest

from impedance_mpc.switching import ENVIRONMENTS
from phil_loop import ClosedLoop, settings
from phil_loop.events import Events, environment

pytestmark = pytest.mark.slow  # all look at the same long ride

TS = 0.002
SWITCHES = {1500: "mass_spring_damper", 2250: "reduced", 3000: "catenary", 3750: "reduced", 4500: "mass_spring_damper"}
CYCLES = 5250


class Seen(NamedTuple):
    """Columns that the tests look at; `v_drive` is the simulated drive's own."""

    environment: np.ndarray
    start: np.ndarray
    end: np.ndarray
    w_tr: np.ndarray
    v_drive: np.ndarray
    f_contact: np.ndarray
    w_env: np.ndarray
    v_env: np.ndarray
    w_cat: np.ndarray
    f_cat: np.ndarray
    delta_work: np.ndarray


def ride(loop: ClosedLoop, cycles: int, events: Events) -> Seen:
    speeds: list[float] = []
    loop.observers[:] = [lambda moment: speeds.append(float(moment.loop.rig.memory.state[1]))]
    going = loop.begin(0.0, events)
    going.run(cycles)
    found = going.record()
    return Seen(
        found.command.environment, found.ramp.start, found.ramp.end, found.rig.w_tr, np.array(speeds),
        found.true.f_contact, found.command.w_env, found.command.v_env, found.wire.w_cat, found.wire.f_cat,
        found.books.delta_work,
    )  # fmt: skip


@pytest.fixture(scope="module")
def loop() -> ClosedLoop:
    return ClosedLoop(settings())


@pytest.fixture(scope="module")
def record(loop: ClosedLoop) -> Seen:
    return ride(loop, CYCLES, {k + 1: environment(name) for k, name in SWITCHES.items()})


def acceleration(record: Seen) -> np.ndarray:
    return np.diff(record.v_drive) / TS


def jumps(record: Seen) -> np.ndarray:
    return record.start[1:] - record.end[:-1]


def test_the_environments_are_those_that_were_chosen(record: Seen) -> None:
    for k, name in SWITCHES.items():
        assert record.environment[k] != record.environment[k + 1] == ENVIRONMENTS.index(name)


def test_a_switch_is_no_harder_on_drive_and_pantograph_than_the_ride_is(record: Seen) -> None:
    """Reference, acceleration and force of 0.2 s after each switch, against the ride on the catenary before (2 s)."""
    normal = slice(500, 1500)
    for k in SWITCHES:
        after = slice(k, k + 100)
        assert np.abs(jumps(record)[after]).max() < np.abs(jumps(record)[normal]).max()
        assert np.abs(acceleration(record)[after]).max() < np.abs(acceleration(record)[normal]).max()
        assert record.f_contact[after].max() < record.f_contact[normal].max()
        assert record.f_contact[after].min() > 0.5 * record.f_contact[normal].min()


def test_an_own_environment_begins_with_place_and_velocity_of_the_one_before(record: Seen) -> None:
    """Nothing but one cycle of motion lies between the last reading of one and the first of the other.

    What a cycle can add is v Ts, and 60 m/s^2 Ts in velocity; the wire's velocity is rougher than that, by the kinks
    that run along it (0.1 m/s).
    """
    for k, name in SWITCHES.items():
        if name != "catenary":
            assert abs(record.w_env[k + 1] - record.w_env[k]) < 0.4 * TS
            assert abs(record.v_env[k + 1] - record.v_env[k]) < 0.15


def test_the_drive_follows_each_environment(record: Seen) -> None:
    """Once the gap is closed (0.5 s): a millimetre, of 40 mm of motion on the catenary."""
    begins = [0, *SWITCHES]
    for a, b in itertools.pairwise([*begins, CYCLES]):
        settled = slice(a + 300, b)
        assert np.abs(record.w_tr[settled] - record.w_env[settled]).max() < 1e-3


def test_the_catenary_goes_on_under_the_contact_force_meanwhile(record: Seen) -> None:
    """It is stepped with the predicted contact force: the same mean, and never left without."""
    for k, name in SWITCHES.items():
        if name == "catenary":
            continue
        away = slice(k + 2, k + 740)
        # The prediction of one cycle is off by no more than the force changes within two.
        change = np.abs(record.f_contact[2:] - record.f_contact[:-2]).max()
        assert np.abs(record.f_cat[away] - record.f_contact[away]).max() < change
        assert record.f_cat[away].mean() == pytest.approx(record.f_contact[away].mean(), rel=0.01)
        assert record.w_cat[away].std() > 3e-3  # droppers and masts pass: it has not stopped


def test_the_energy_error_of_the_books_stays_small_over_all_switches(loop: ClosedLoop, record: Seen) -> None:
    """1 % of what was exchanged: the way through the gap back to the catenary is the largest part."""
    assert abs(record.delta_work[-1]) < 0.01 * loop.commander.books.exchanged_energy


def test_two_equal_rides_with_switches_are_equal_to_the_bit() -> None:
    names = ("mass_spring_damper", "reduced", "catenary")
    events = {100 * (i + 1): environment(name) for i, name in enumerate(names)}
    found = [ride(ClosedLoop(settings()), 400, events) for _ in range(2)]
    for first, second in zip(*found, strict=True):
        np.testing.assert_array_equal(first, second)


def test_warming_up_changes_nothing() -> None:
    """Neither the environment that the parameters chose nor a bit of the ride."""
    cold, warm = (ClosedLoop(settings(impedance_mpc={"environment": "reduced"})) for _ in range(2))
    assert warm.control is not None
    warm.control.switch.warm_up()
    first, second = ride(cold, 100, {}), ride(warm, 100, {})
    assert set(second.environment) == {ENVIRONMENTS.index("reduced")}
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_reset_goes_back_to_cycle_0_and_keeps_the_choice(loop: ClosedLoop, record: Seen) -> None:
    assert loop.control is not None
    switch = loop.control.switch
    switch.reset()
    assert switch.active == 0  # until the first cycle, which swaps
    assert switch.books.exchanged_energy == 0.0
    assert ENVIRONMENTS[switch._wanted] == "mass_spring_damper"
    with pytest.raises(ValueError, match="nonsense"):
        switch.select("nonsense")
