"""How a train travels: its place, speed and acceleration at any instant, exactly consistent with each other.

A journey is a sequence of phases of constant jerk (constant acceleration, constant speed). In phase i, tau = t - t_i,

    s = s_i + v_i tau + a_i tau^2 / 2 + j_i tau^3 / 6,     v = ds/dt,     a = dv/dt,

so v is the derivative of s as written, not by differences; s and v are continuous, a may jump (to the right: the new
phase holds from its first instant on). Place is counted from where the journey begins, at t = 0; after the last phase
the train keeps its speed. All kinds are made of phases:

    constant             one phase
    over_time            speed in straight lines over time: constant acceleration between two points
    over_place           points (place, speed) with constant acceleration in between, v^2 in straight lines over place:
                         of all simple laws the one that gets away from a standstill
    start_cruise_brake   given accelerations, ramps of the acceleration if a jerk is given

`motion` is compiled and allocates nothing: whoever steps a model, in whatever frame, holds `Travel.table` and asks it
for position and speed at its instant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line
from phil_base.clear_words import ClearError
from phil_base.kernels import njit

Array = NDArray[np.float64]

T, S, V, A, J = range(5)
"""Rows of `Travel.table`."""
FASTEST = 0.9
"""Share of the slower wave speed of a line that a journey may reach: beyond, waves hardly run ahead any more."""
ACCELERATION = (1e-3, 20.0)
"""Range of a given acceleration or braking, m/s^2."""
JERK = (1e-3, 100.0)
"""Range of a given jerk, m/s^3."""


class TravelError(ClearError):
    """A journey cannot be travelled; the text is one line: entry, value, what is allowed."""


class Words(NamedTuple):
    """How a message names the entries of a journey; {} is the number of a point."""

    points: str = "points"
    time: str = "times[{}]"
    place: str = "places[{}]"
    speed: str = "speeds[{}]"
    start_speed: str = "start_speed"
    cruise_speed: str = "cruise_speed"
    end_speed: str = "end_speed"
    acceleration: str = "acceleration"
    braking: str = "braking"
    jerk: str = "jerk"
    distance: str = "distance"
    cruise_time: str = "cruise_time"
    unit: str = "m/s"
    """Of all speeds."""
    per: float = 1.0
    """How many of it are 1 m/s."""


SI = Words()


@njit(cache=True, fastmath=False)
def motion(table: Array, t: float) -> tuple[float, float, float]:
    """Return place (m), speed (m/s) and acceleration (m/s^2) at the time t (s); `table` is (5, phases)."""
    low, high = 0, table.shape[1]
    while high - low > 1:
        middle = (low + high) // 2
        if table[T, middle] <= t:
            low = middle
        else:
            high = middle
    tau = t - table[T, low]
    v, a, j = table[V, low], table[A, low], table[J, low]
    place = table[S, low] + tau * (v + tau * (0.5 * a + tau * (j / 6.0)))
    # a train that comes to rest has rounding left on its last instants, but does not roll back
    return place, max(0.0, v + tau * (a + tau * (0.5 * j))), a + tau * j


@njit(cache=True, fastmath=False)
def _motions(table: Array, t: Array, into: Array) -> None:
    for i in range(t.size):
        into[0, i], into[1, i], into[2, i] = motion(table, t[i])


@dataclass(frozen=True)
class Travel:
    """A journey.

    >>> journey = start_cruise_brake(60.0, acceleration=0.5, braking=0.8, distance=10_000.0)
    >>> journey.at(journey.end)[1]
    0.0
    """

    table: Array
    """Beginning (s), and place, speed, acceleration and jerk there, of every phase; (5, phases)."""

    @property
    def end(self) -> float:
        """Time at which the last phase begins, from which on the speed is constant, s; 0 if it always is."""
        return float(self.table[T, -1])

    @property
    def distance(self) -> float:
        """Place at `end`, m."""
        return float(self.table[S, -1])

    @property
    def fastest(self) -> float:
        """Highest speed at any time, m/s."""
        return max(speed for _, speed in self._peaks())

    def at(self, t: float) -> tuple[float, float, float]:
        """Return place (m), speed (m/s) and acceleration (m/s^2) at the time t (s). Raises TravelError before 0."""
        self._not_before(t)
        place, speed, acceleration = motion(self.table, float(t))
        return float(place), float(speed), float(acceleration)

    def over(self, t: Array) -> Array:
        """Return place, speed and acceleration at all times t (s), (3, n). Raises TravelError before 0."""
        times = np.ascontiguousarray(t, dtype=np.float64)
        if times.size:
            self._not_before(float(times.min()))
        found = np.zeros((3, times.size))
        _motions(self.table, times, found)
        return found

    def refuse_too_fast(self, line: Line) -> None:
        """Raise TravelError if the journey is anywhere faster than `fastest_on` the line."""
        most = fastest_on(line)
        for t, speed in self._peaks():
            if speed > most:
                raise TravelError(f"travel: speed = {speed:g} m/s at t = {t:g} s: allowed is {_upto(most, SI)}")

    def _peaks(self) -> Iterator[tuple[float, float]]:
        """Times and speeds of all phases' beginnings and of the extremes within them."""
        for i, (t, _, v, a, j) in enumerate(self.table.T.tolist()):
            yield t, v
            inside = self.table[T, i + 1] - t if i + 1 < self.table.shape[1] else 0.0
            if j != 0.0 and 0.0 < -a / j < inside:
                yield t - a / j, v - 0.5 * a * a / j

    @staticmethod
    def _not_before(t: float) -> None:
        if not (math.isfinite(t) and t >= 0.0):
            raise TravelError(f"t = {t:g} s: allowed is a time from 0 s, where the journey begins")


def fastest_on(line: Line) -> float:
    """Return the highest speed of a journey on this line, `FASTEST` of its slower wave speed, m/s."""
    return FASTEST * min(line.carrier.wave_speed, line.contact.wave_speed)


def constant(speed: float, most: float = math.inf, words: Words = SI) -> Travel:
    """Travel at one speed (m/s), from 0 to `most`. Raises TravelError."""
    _speed(words.cruise_speed, speed, most, words)
    return Travel(np.array([[0.0], [0.0], [speed], [0.0], [0.0]]))


def over_time(times: Sequence[float], speeds: Sequence[float], most: float = math.inf, words: Words = SI) -> Travel:
    """Travel with speeds (m/s, 0 to `most`) in straight lines over rising times (s) from 0 on. Raises TravelError."""
    _points(times, speeds, words.time, "s", "time", most, words)
    phases = [
        (after - before, (now - last) / (after - before), 0.0, now)
        for before, after, last, now in zip(times, times[1:], speeds, speeds[1:], strict=False)
    ]
    return _joined(speeds[0], phases)


def over_place(places: Sequence[float], speeds: Sequence[float], most: float = math.inf, words: Words = SI) -> Travel:
    """Travel with speeds (m/s, 0 to `most`) at rising places (m) from 0 on, constant acceleration between two of them.

    Raises TravelError, also where both speeds are 0: the next place would never be reached.
    """
    _points(places, speeds, words.place, "m", "place", most, words)
    phases = []
    for i in range(1, len(places)):
        mean = 0.5 * (speeds[i - 1] + speeds[i])
        if mean == 0.0:
            raise TravelError(
                f"{words.speed.format(i)} = 0 {words.unit}: allowed is more than 0, or the train, at rest at "
                f"{words.place.format(i - 1)} as well, never gets there"
            )
        duration = (places[i] - places[i - 1]) / mean
        phases.append((duration, (speeds[i] - speeds[i - 1]) / duration, 0.0, speeds[i]))
    return _joined(speeds[0], phases)


def start_cruise_brake(
    cruise_speed: float,
    *,
    acceleration: float,
    braking: float,
    distance: float | None = None,
    cruise_time: float | None = None,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    jerk: float | None = None,
    most: float = math.inf,
    words: Words = SI,
) -> Travel:
    """Accelerate, cruise and brake; speeds in m/s, accelerations (both positive) in m/s^2.

    The cruise ends so that the train has its end speed after `distance` (m), or lasts `cruise_time` (s); one of both is
    given. With a `jerk` (m/s^3) the acceleration rises and falls in straight lines, as far as there is speed to gain.
    Raises TravelError.
    """
    for name, speed, high in (
        (words.cruise_speed, cruise_speed, most),
        (words.start_speed, start_speed, cruise_speed),
        (words.end_speed, end_speed, cruise_speed),
    ):
        _speed(name, speed, high, words)
    if cruise_speed == 0.0:
        raise TravelError(f"{words.cruise_speed} = 0 {words.unit}: allowed is more than 0: there would be no journey")
    for name, value, (low, high), unit in (
        (words.acceleration, acceleration, ACCELERATION, "m/s^2"),
        (words.braking, braking, ACCELERATION, "m/s^2"),
        (words.jerk, jerk, JERK, "m/s^3"),
    ):
        if value is not None and not low <= value <= high:
            raise TravelError(f"{name} = {value:g} {unit}: allowed is {low:g} to {high:g} {unit}")
    start = _ramp(start_speed, cruise_speed, acceleration, jerk)
    brake = _ramp(cruise_speed, end_speed, braking, jerk)
    if (distance is None) == (cruise_time is None):
        given = "none" if distance is None else "both"
        raise TravelError(f"{words.distance}, {words.cruise_time}: allowed is one of both; {given} is given")
    if distance is not None:
        least = _joined(start_speed, start).distance + _joined(cruise_speed, brake).distance
        if not least <= distance < math.inf:
            raise TravelError(
                f"{words.distance} = {distance:g} m: allowed is at least {least:g} m: start and brake take that much"
            )
        cruise_time = (distance - least) / cruise_speed
    assert cruise_time is not None
    if not 0.0 <= cruise_time < math.inf:
        raise TravelError(f"{words.cruise_time} = {cruise_time:g} s: allowed is a time from 0 s")
    return _joined(start_speed, [*start, (cruise_time, 0.0, 0.0, cruise_speed), *brake])


_Phase = tuple[float, float, float, float]
"""Duration (s), acceleration (m/s^2) at its beginning, jerk (m/s^3), and the speed at its end (m/s)."""


def _ramp(before: float, after: float, most: float, jerk: float | None) -> list[_Phase]:
    """Go from one speed to another with at most this acceleration."""
    change = abs(after - before)
    sign = 1.0 if after > before else -1.0
    if change == 0.0:
        return []
    if jerk is None:
        return [(change / most, sign * most, 0.0, after)]
    rise = min(most / jerk, math.sqrt(change / jerk))
    peak = jerk * rise
    held = max(0.0, change / peak - rise)
    part = sign * 0.5 * peak * rise
    return [
        (rise, 0.0, sign * jerk, before + part),
        (held, sign * peak, 0.0, after - part),
        (rise, sign * peak, -sign * jerk, after),
    ]


def _joined(speed: float, phases: Sequence[_Phase]) -> Travel:
    """Put phases one behind the other and the last speed behind them; what lasts no time is left out."""
    rows = []
    t = place = 0.0
    for duration, acceleration, jerk, after in phases:
        if t + duration > t:
            rows.append((t, place, speed, acceleration, jerk))
            place += duration * (speed + duration * (0.5 * acceleration + duration * (jerk / 6.0)))
            t += duration
        speed = after
    rows.append((t, place, speed, 0.0, 0.0))
    return Travel(np.ascontiguousarray(np.array(rows, dtype=np.float64).T))


def _points(
    along: Sequence[float], speeds: Sequence[float], name: str, unit: str, what: str, most: float, words: Words
) -> None:
    """Refuse points that are none, do not begin at 0, do not rise, or have a speed out of range."""
    if len(along) != len(speeds):
        raise TravelError(
            f"{words.points}: {len(along)} {what}s, {len(speeds)} speeds: allowed is one speed for each {what}"
        )
    if not along:
        raise TravelError(f"{words.points}: there are none; allowed is at least one")
    for i, value in enumerate(along):
        if i == 0 and value != 0.0:
            raise TravelError(f"{name.format(0)} = {value:g} {unit}: allowed is 0 {unit}: a journey begins there")
        if i and not along[i - 1] < value < math.inf:
            before = f"{along[i - 1]:g} {unit}, that of the point before it"
            raise TravelError(f"{name.format(i)} = {value:g} {unit}: allowed is more than {before}")
        _speed(words.speed.format(i), speeds[i], most, words)


def _speed(name: str, speed: float, most: float, words: Words) -> None:
    if not (0.0 <= speed <= most and math.isfinite(speed)):
        raise TravelError(f"{name} = {speed * words.per:g} {words.unit}: allowed is {_upto(most, words)}")


def _upto(most: float, words: Words) -> str:
    return f"0 to {most * words.per:.4g} {words.unit}" if math.isfinite(most) else f"at least 0 {words.unit}, finite"
