"""Static equilibrium of the endless periodic line in closed form, and the unstressed dropper lengths that give it.

Both wires are beams under tension that carry their weight and point loads, over one period of the line with all its
spans. Unknowns are the forces F of the droppers, the forces R of the masts and the heights of both wires; they follow
from one sparse linear system without any mesh (`suspension`), with one law per force:

    a dropper without given length   contact(zeta_i) = demanded height of the clamp (parabola of the span's pre_sag)
    a dropper of given length l_0    carrier(zeta_i) - contact(zeta_i) - F_i/k_d = l_0  if taut,  F_i = 0  if slack
    a mast                           carrier(zeta_m) = encumbrance.

Where the lengths are computed, l_0 = carrier - contact - F/k_d. Which droppers of given length are taut is found by an
active set. Half of a dropper's mass hangs as a point weight on either wire, at the clamp. The mass of a steady arm is
carried by its own support and the arm is unloaded at rest, so arms have no part in the statics.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from catenary_model.line import Line
from catenary_model.periodic_beam import PeriodicBeam
from catenary_model.suspension import LoadedWire, Suspension, incidence

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
T = TypeVar("T")

DROPPER, MAST, STEADY_ARM = 0, 1, 2
"""Kinds of `Sites`."""

_TOLERANCE = 1e-11
"""Elongation (m) up to which a dropper counts as neither taut nor slack: beyond the rounding of 1000 spans."""
_PATIENCE = 10


class StaticsError(ValueError):
    """A line has no static equilibrium of the wanted kind; `span` and `dropper` say where (None: the whole line)."""

    def __init__(self, problem: str, span: int | None = None, dropper: int | None = None) -> None:
        """Name the entry in front of the problem."""
        where = "spans" if span is None else f"spans[{span}]" + ("" if dropper is None else f".droppers[{dropper}]")
        super().__init__(f"{where}: {problem}")
        self.problem, self.span, self.dropper = problem, span, dropper


@dataclass(frozen=True)
class Sites:
    """Everything that touches the wires within one period, by rising position; arrays of equal length."""

    position: Array
    """Track position in [0, period), m; a mast comes before the steady arm at the same place."""
    kind: Indices
    """DROPPER, MAST or STEADY_ARM."""
    stiffness: Array
    """N/m."""
    mass: Array
    """Mass of a dropper (half of it on either wire) or of a steady arm (all of it on the contact wire), kg; else 0."""
    force: Array
    """At rest, N: tension of a dropper (0 is slack), upward force of a mast on the carrier, 0 for an arm."""
    elongation: Array
    """Of a dropper at rest against its unstressed length, m; negative is slack; 0 for all others."""
    length: Array
    """Unstressed length l_0 of a dropper, m; 0 for all others."""


@dataclass(frozen=True)
class Statics:
    """The line at rest under its own weight. Heights are measured from the nominal height of the contact wire."""

    line: Line
    sites: Sites
    contact_beam: PeriodicBeam
    """Contact wire with what acts on it: at every clamp the dropper's force less half of the dropper's weight."""
    carrier_beam: PeriodicBeam

    def __post_init__(self) -> None:
        for field in fields(self.sites):
            getattr(self.sites, field.name).flags.writeable = False

    def contact(self, zeta: Array) -> Array:
        """Height of the contact wire at track positions zeta, m."""
        return self.contact_beam.value(zeta)

    def carrier(self, zeta: Array) -> Array:
        """Height of the carrier at track positions zeta, m."""
        return self.carrier_beam.value(zeta)

    @property
    def dropper_positions(self) -> Array:
        """Track positions of the droppers of one period, m."""
        return self._of_droppers(self.sites.position)

    @property
    def dropper_forces(self) -> Array:
        """Tensions F_s at rest, N; 0 is slack."""
        return self._of_droppers(self.sites.force)

    @property
    def dropper_elongations(self) -> Array:
        """Static length minus unstressed length, m; negative is slack."""
        return self._of_droppers(self.sites.elongation)

    @property
    def dropper_lengths(self) -> Array:
        """Unstressed lengths l_0, m."""
        return self._of_droppers(self.sites.length)

    def _of_droppers(self, column: Array) -> Array:
        rows: Array = column[self.sites.kind == DROPPER]
        return rows


@dataclass(frozen=True)
class _Droppers:
    """All droppers of one period as arrays; `length` is NaN where it is to be computed."""

    at: Array
    stiffness: Array
    mass: Array
    length: Array
    height: Array
    name: list[tuple[int, int]]

    @classmethod
    def of(cls, line: Line) -> _Droppers:
        rows, name = [], []
        for i, (start, span) in enumerate(zip(line.span_starts, line.spans, strict=True)):
            for j, d in enumerate(span.droppers):
                given = np.nan if d.length is None else d.length
                demanded = clamp_height(d.position, span.length, span.pre_sag)
                rows.append((start + d.position, d.stiffness, d.mass, given, demanded))
                name.append((i, j))
        at, stiffness, mass, length, height = np.array(rows, dtype=np.float64).reshape(-1, 5).T
        return cls(at, stiffness, mass, length, height, name)


def clamp_height(position: float, length: float, pre_sag: float) -> float:
    """Demanded height (m) of a clamp at this position (m) in a span: level, or a parabola from mast to mast."""
    s = position / length
    return -4.0 * pre_sag * s * (1.0 - s)


@lru_cache(maxsize=8)
def solve(line: Line) -> Statics:
    """Solve the static equilibrium; compute the unstressed lengths that the line does not give.

    A contact wire without any dropper hangs from nothing: it is taken as level, its weight is left out. Who asks again
    for an equal line gets the same object, whose arrays cannot be written to.

    Raises StaticsError (a ValueError) naming the dropper if a computed length is not positive or not taut, or if the
    given lengths leave no equilibrium.
    """
    droppers = _Droppers.of(line)
    mast_at = np.array(line.span_starts)
    hung = _hung(line, droppers, mast_at)
    given = ~np.isnan(droppers.length)
    n = given.size
    encumbrance = np.array([span.mast.encumbrance for span in line.spans])
    on_carrier, on_contact = _height_rows(hung, droppers.at, mast_at)
    both = np.arange(n, dtype=np.int64)
    side = np.concatenate((np.where(given, -droppers.length, droppers.height), encumbrance))
    carrier_known, contact_known = hung.carrier_known[on_carrier], hung.contact_known[on_contact]
    side[:n] -= contact_known - np.where(given, carrier_known[:n], 0.0)
    side[n:] -= carrier_known[n:]
    clamps, masts = hung.contact_height[on_contact], hung.carrier_height[on_carrier[n:]]
    distance = clamps - hung.carrier_height[on_carrier[:n]]
    spring = hung.force_rows(both, 1.0 / droppers.stiffness)[:n]
    alone = hung.force_rows(both, np.ones(n))[:n]

    def try_out(taut: Flags) -> tuple[Array, Array]:
        """Solve for these taut droppers; return the solution, and tension or slack as an elongation (m)."""
        pick = [sparse.diags_array(mask.astype(np.float64)) for mask in (~given, given & taut, given & ~taut)]
        laws = pick[0] @ clamps + pick[1] @ (distance + spring) + pick[2] @ alone
        wanted = side.copy()
        wanted[:n][given & ~taut] = 0.0
        x = hung.factor(sparse.csr_array(sparse.vstack([laws, masts]))).solve(np.concatenate((wanted, hung.side)))
        apart = -(distance @ x) + side[:n]
        return x, np.where(given, np.where(taut, x[:n] / droppers.stiffness, apart), 0.0)

    taut, x = one_sided(try_out, np.ones(n, dtype=np.bool_))
    force, string, contact_string = hung.split(x)
    tension = np.where(np.abs(force[:n]) <= _TOLERANCE * droppers.stiffness, 0.0, force[:n])
    force = np.concatenate((np.where(given, np.maximum(tension, 0.0), tension), force[n:]))
    carrier, contact = hung.carrier.beam(force, string), hung.contact.beam(force, contact_string)
    distance_at_rest = carrier.value(droppers.at) - contact.value(droppers.at)
    elongation = np.where(taut, force[:n] / droppers.stiffness, distance_at_rest - droppers.length)
    length = np.where(given, droppers.length, distance_at_rest - elongation)
    _refuse_impossible(line, droppers.name, force[:n], length)
    return Statics(line, _sites(line, droppers, mast_at, force[:n], force[n:], elongation, length), contact, carrier)


def _hung(line: Line, droppers: _Droppers, mast_at: Array) -> Suspension:
    """Both wires with their weights, for the forces of the droppers and of the masts."""
    n, m, P, g = droppers.at.size, mast_at.size, line.period, line.gravity
    half = 0.5 * g * droppers.mass
    place = np.concatenate((droppers.at, mast_at))
    order = np.argsort(place)
    every = np.arange(n + m)
    signed = sparse.csr_array(sparse.diags_array(np.where(every < n, -1.0, 1.0)))
    known = np.concatenate((-half, np.zeros(m)))
    carrier = LoadedWire(line.carrier, P, place[order], signed[order], known[order], line.carrier.mass_per_length * g)
    up = incidence(n, np.arange(n), np.arange(n), n + m)
    return Suspension(carrier, LoadedWire(line.contact, P, droppers.at, up, -half, line.contact.mass_per_length * g))


def _height_rows(hung: Suspension, dropper_at: Array, mast_at: Array) -> tuple[Indices, Indices]:
    """Which load on the carrier belongs to every dropper and mast, and on the contact wire to every dropper."""
    on_carrier = np.searchsorted(hung.carrier.at, np.concatenate((dropper_at, mast_at)))
    return on_carrier, np.arange(dropper_at.size)


def one_sided(try_out: Callable[[Flags], tuple[T, Array]], taut: Flags) -> tuple[Flags, T]:
    """Find which one-sided springs are taut; return their flags and the solution that goes with them.

    `try_out` solves for given flags; it returns its solution and an elongation (m) per spring: what its tension
    stretches it by where it is taken as taut, how much too long the place is that it has where it is taken as slack.
    One that is negative though taut, or positive though slack, disagrees (0 for what never slackens). Block principal
    pivoting (Judice and Pires 1994): all that disagree change at once, one by one where that does not settle. `taut`
    is the state to begin with. Raises StaticsError without an equilibrium.
    """
    on = taut.copy()
    fewest, patience = taut.size + 1, _PATIENCE
    for _ in range(50 + 4 * taut.size):
        try:
            solution, elongation = try_out(on)
        except RuntimeError:  # singular: nothing holds a wire
            break
        wrong = np.where(on, -elongation, elongation) > _TOLERANCE
        count = int(wrong.sum())
        if not count:
            return on, solution
        if count < fewest:
            fewest, patience = count, _PATIENCE
        elif patience:
            patience -= 1
        else:
            wrong[: int(np.flatnonzero(wrong)[-1])] = False
        on = on ^ wrong
    raise StaticsError("the given dropper lengths leave no static equilibrium")


def _refuse_impossible(line: Line, name: list[tuple[int, int]], force: Array, length: Array) -> None:
    """Raise StaticsError if a dropper whose length is computed would have to push or be shorter than nothing."""
    for (i, j), F, l_0 in zip(name, force, length, strict=True):
        span = line.spans[i]
        if span.droppers[j].length is not None:
            continue
        if F < 0.0 or (F == 0.0 and line.gravity > 0.0):
            raise StaticsError(
                f"would have to push ({F:.1f} N) to hold its clamp at the height that pre_sag = {span.pre_sag:g} m "
                "demands: choose another pre_sag, position or length",
                *(i, j),
            )
        if l_0 <= 0.0:
            raise StaticsError(
                f"would be {l_0:.3f} m long: the mast's encumbrance = {span.mast.encumbrance:g} m is too small", i, j
            )


def _sites(
    line: Line, droppers: _Droppers, mast_at: Array, force: Array, mast: Array, elongation: Array, length: Array
) -> Sites:
    arms = [(at, span.steady_arm) for at, span in zip(mast_at, line.spans, strict=True) if span.steady_arm is not None]
    n, m, a = droppers.at.size, mast_at.size, len(arms)
    position = np.concatenate((droppers.at, mast_at, [at for at, _ in arms]))
    kind = np.repeat(np.array([DROPPER, MAST, STEADY_ARM], dtype=np.int64), (n, m, a))
    order = np.lexsort((kind, position))

    def column(of_droppers: Array, of_masts: Array, of_arms: list[float]) -> Array:
        return np.concatenate((of_droppers, of_masts, of_arms))[order]

    none, no_arms = np.zeros(m), [0.0] * a
    return Sites(
        position=position[order],
        kind=kind[order],
        stiffness=column(
            droppers.stiffness,
            np.array([span.mast.stiffness for span in line.spans]),
            [arm.stiffness for _, arm in arms],
        ),
        mass=column(droppers.mass, none, [arm.mass for _, arm in arms]),
        force=column(force, mast, no_arms),
        elongation=column(elongation, none, no_arms),
        length=column(length, none, no_arms),
    )
