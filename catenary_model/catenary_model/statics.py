"""Static equilibrium of the endless periodic line in closed form, and the unstressed dropper lengths that give it.

Both wires are beams under tension that carry their weight and point loads, over one period of the line with all its
spans. Unknowns are the forces F of the droppers, the forces R of the masts and the heights of both wires; they follow
from one sparse linear system without any mesh (`suspension`), with one law per force:

    a dropper without given length   contact(zeta_i) = demanded height of the clamp (its sag, or the span's parabola)
    a dropper of given length l_0    carrier(zeta_i) - contact(zeta_i) - F_i/k_d = l_0  if taut,  F_i = 0  if slack
    a mast                           carrier(zeta_m) = encumbrance.

Where the lengths are computed, l_0 = carrier - contact - F/k_d. Which droppers of given length are taut is found by an
active set. Half of a dropper's mass and a clamp hang as a point weight on either wire. A rope whose stiffness is EA/l_0
or whose mass is that of its length is cut anew until nothing changes (`_cut`); what it weighs moves its own length by
some 1e-4 of that. The mass of a steady arm is carried by its own support and the arm is unloaded at rest, so arms have
no part in the statics.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from catenary_model.line import Dropper, Line
from catenary_model.periodic_beam import PeriodicBeam
from catenary_model.point_masses import PointMasses, apart, loaded, rising
from catenary_model.stitched import CARRIER, StitchedCarrier, Strand
from catenary_model.suspension import Hung, LoadedWire, Shape, Suspension, incidence

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]
T = TypeVar("T")

DROPPER, MAST, STEADY_ARM, POINT_MASS = 0, 1, 2, 3
"""Kinds of `Sites`."""

_TOLERANCE = 1e-11
"""Elongation (m) up to which a dropper counts as neither taut nor slack: beyond the rounding of 1000 spans."""
_PATIENCE = 10
_CUT = 1e-13
"""Change of a dropper's length (m) at which its rope counts as cut, and how often that is tried."""
_CUTS = 60


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
    """DROPPER, MAST, STEADY_ARM or POINT_MASS."""
    stiffness: Array
    """N/m."""
    carrier_mass: Array
    """Mass that moves with the carrier or stitch wire, kg: a dropper's upper clamp and half of the dropper."""
    contact_mass: Array
    """Mass that moves with the contact wire, kg: a dropper's lower clamp and half of it, a steady arm, a point mass."""
    force: Array
    """At rest, N: tension of a dropper (0 is slack), upward force of a mast on the carrier, 0 for an arm."""
    elongation: Array
    """Of a dropper at rest against its unstressed length, m; negative is slack; 0 for all others."""
    length: Array
    """Unstressed length l_0 of a dropper, m; 0 for all others."""
    stitch: Indices
    """Span whose stitch wire a dropper hangs from; -1 for all that sits on carrier or contact wire."""


@dataclass(frozen=True)
class Statics:
    """The line at rest under its own weight. Heights are measured from the nominal height of the contact wire."""

    line: Line
    sites: Sites
    contact_beam: PeriodicBeam
    """Contact wire with what acts on it: at every clamp the dropper's force less half of the dropper's weight."""
    carrier_beam: Shape
    stitch_wires: tuple[Strand, ...] = ()
    """Shapes of the stitch wires of one period, by rising place."""

    def __post_init__(self) -> None:
        for field in fields(self.sites):
            getattr(self.sites, field.name).flags.writeable = False

    def contact(self, zeta: Array) -> Array:
        """Height of the contact wire at track positions zeta, m."""
        return self.contact_beam.value(zeta)

    def carrier(self, zeta: Array) -> Array:
        """Height of the carrier at track positions zeta, m."""
        return self.carrier_beam.value(zeta)

    def stitch(self, zeta: Array) -> Array:
        """Height of the stitch wires at track positions zeta, m; NaN where there is none."""
        height = np.full(np.shape(zeta), np.nan)
        for wire in self.stitch_wires:
            height = np.where(np.isnan(height), wire.value(zeta), height)
        return height

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
    carrier_mass: Array
    contact_mass: Array
    length: Array
    height: Array
    stitch: Indices
    name: list[tuple[int, int]]

    @classmethod
    def of(cls, line: Line) -> _Droppers:
        rows, stitch, name = [], [], []
        for i, (start, span) in enumerate(zip(line.span_starts, line.spans, strict=True)):
            for j, d in enumerate(span.droppers):
                given = np.nan if d.length is None else d.length
                rows.append(
                    (start + d.position, d.stiffness, d.carrier_mass, d.contact_mass, given, span.clamp_height(d))
                )
                wire = line.stitch_of(i, j)
                stitch.append(CARRIER if wire is None else wire)
                name.append((i, j))
        at, stiffness, on_carrier, on_contact, length, height = np.array(rows, dtype=np.float64).reshape(-1, 6).T
        return cls(at, stiffness, on_carrier, on_contact, length, height, np.array(stitch, dtype=np.int64), name)


@lru_cache(maxsize=8)
def solve(line: Line) -> Statics:
    """Solve the static equilibrium; compute the unstressed lengths that the line does not give.

    A contact wire without any dropper hangs from nothing: it is taken as level, its weight is left out. Who asks again
    for an equal line gets the same object, whose arrays cannot be written to.

    Raises StaticsError (a ValueError) naming the dropper if a computed length is not positive or not taut, or if the
    given lengths leave no equilibrium.
    """
    if not _has_ropes(line):
        return _solve(line)
    rest = _solve(_cut(line, [span.mast.encumbrance for span in line.spans for _ in span.droppers]))
    for _ in range(_CUTS):
        before = rest.dropper_lengths
        rest = _solve(_cut(line, before.tolist()))
        if np.abs(rest.dropper_lengths - before).max() <= _CUT:
            return dataclasses.replace(rest, line=line)
    raise StaticsError("the droppers' lengths do not settle: their ropes are too soft or too heavy")


@lru_cache(maxsize=8)
def built(line: Line) -> Line:
    """Return the line with every dropper's rope in its stiffness and the masses of its clamps, as it hangs at rest.

    A line that gives both for itself is returned as it is. Raises StaticsError.
    """
    return _cut(line, solve(line).dropper_lengths.tolist()) if _has_ropes(line) else line


def _has_ropes(line: Line) -> bool:
    return any(dropper.needs_length for span in set(line.spans) for dropper in span.droppers)


def _cut(line: Line, lengths: list[float]) -> Line:
    """Cut the ropes of all droppers to these lengths (m), or to the ones that the line gives."""
    each = iter(lengths)

    def cut(dropper: Dropper) -> Dropper:
        length = next(each)
        return dropper.cut(length if dropper.length is None else dropper.length)

    spans = tuple(dataclasses.replace(span, droppers=tuple(map(cut, span.droppers))) for span in line.spans)
    return dataclasses.replace(line, spans=spans)


def _solve(line: Line) -> Statics:
    """Solve a line whose droppers have their stiffnesses and masses."""
    droppers = _Droppers.of(line)
    mast_at = np.array(line.span_starts)
    hung = _hung(line, droppers, mast_at)
    given = ~np.isnan(droppers.length)
    n = given.size
    encumbrance = np.array([span.mast.encumbrance for span in line.spans])
    on_carrier, on_contact = _height_rows(line, hung, droppers.at, mast_at)
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
    force, own, own_contact = hung.split(x)
    tension = np.where(np.abs(force[:n]) <= _TOLERANCE * droppers.stiffness, 0.0, force[:n])
    force = np.concatenate((np.where(given, np.maximum(tension, 0.0), tension), force[n:]))
    carrier, contact = hung.carrier.beam(force, own), hung.contact.beam(force, own_contact)
    stitches = hung.carrier.stitches(own) if isinstance(hung.carrier, StitchedCarrier) else ()
    above = hung.carrier_height[on_carrier[:n]] @ x if stitches else carrier.value(droppers.at)
    distance_at_rest = above - contact.value(droppers.at)
    elongation = np.where(taut, force[:n] / droppers.stiffness, distance_at_rest - droppers.length)
    length = np.where(given, droppers.length, distance_at_rest - elongation)
    _refuse_impossible(line, droppers.name, force[:n], length)
    sites = _sites(line, droppers, mast_at, force[:n], force[n:], elongation, length)
    return Statics(line, sites, contact, carrier, stitches)


def _hung(line: Line, droppers: _Droppers, mast_at: Array) -> Suspension:
    """Both wires with their weights, for the forces of the droppers and of the masts."""
    n, m, P, g = droppers.at.size, mast_at.size, line.period, line.gravity
    every, masses = np.arange(n + m), PointMasses.of(line)
    signed = sparse.csr_array(sparse.diags_array(np.where(every < n, -1.0, 1.0)))
    place, known = np.concatenate((droppers.at, mast_at)), np.concatenate((-g * droppers.carrier_mass, np.zeros(m)))
    carrier: Hung
    if line.stitched:
        loads = apart((place, signed, known), masses.at, -g * masses.carrier)
        hangs = np.concatenate((droppers.stitch, np.full(loads[0].size - n, CARRIER)))
        carrier = StitchedCarrier(line, 1, loads[0], hangs, *loads[1:], g)
    else:
        loads = rising(loaded((place, signed, known), masses.at, -g * masses.carrier))
        carrier = LoadedWire(line.carrier, P, *loads, line.carrier.mass_per_length * g)
    up = incidence(n, np.arange(n), np.arange(n), n + m)
    loads = (droppers.at, up, -g * droppers.contact_mass)
    loads = rising(loaded(loads, masses.at, -g * masses.contact)) if masses.at.size else loads
    return Suspension(carrier, LoadedWire(line.contact, P, *loads, line.contact.mass_per_length * g))


def _height_rows(line: Line, hung: Suspension, dropper_at: Array, mast_at: Array) -> tuple[Indices, Indices]:
    """Which load on the carrier belongs to every dropper and mast, and on the contact wire to every dropper."""
    if line.stitched:
        return np.arange(dropper_at.size + mast_at.size), np.searchsorted(hung.contact.at, dropper_at)
    on_carrier = np.searchsorted(hung.carrier.at, np.concatenate((dropper_at, mast_at)))
    return on_carrier, np.searchsorted(hung.contact.at, dropper_at)


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
            sag = span.droppers[j].sag
            key, value = ("pre_sag", span.pre_sag) if sag is None else ("sag", sag)
            raise StaticsError(
                f"would have to push ({F:.1f} N) to hold its clamp at the height that {key} = {value:g} m demands: "
                f"choose another {key}, position or length",
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
    masses = PointMasses.of(line)
    n, m, a, p = droppers.at.size, mast_at.size, len(arms), masses.at.size
    position = np.concatenate((droppers.at, mast_at, [at for at, _ in arms], masses.at))
    kind = np.repeat(np.array([DROPPER, MAST, STEADY_ARM, POINT_MASS], dtype=np.int64), (n, m, a, p))
    order = np.lexsort((kind, position))

    def column(of_droppers: Array, of_masts: Array, of_arms: list[float], of_masses: Array | None = None) -> Array:
        rest = np.zeros(p) if of_masses is None else of_masses
        return np.concatenate((of_droppers, of_masts, of_arms, rest))[order]

    none, no_arms = np.zeros(m), [0.0] * a
    return Sites(
        position=position[order],
        kind=kind[order],
        stiffness=column(
            droppers.stiffness,
            np.array([span.mast.stiffness for span in line.spans]),
            [arm.stiffness for _, arm in arms],
        ),
        carrier_mass=column(droppers.carrier_mass, none, no_arms, masses.carrier),
        contact_mass=column(droppers.contact_mass, none, [arm.mass for _, arm in arms], masses.contact),
        force=column(force, mast, no_arms),
        elongation=column(elongation, none, no_arms),
        length=column(length, none, no_arms),
        stitch=np.concatenate((droppers.stitch, np.full(m + a + p, CARRIER)))[order],
    )
