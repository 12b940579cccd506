"""Static equilibrium of the endless periodic line in closed form, and the unstressed dropper lengths that give it.

Both wires are beams under tension that carry their weight and point loads (`periodic_beam`), over one period of the
line with all its spans. Unknowns are the forces F of the droppers, the forces R of the masts and the heights W_0 of
both wires; they follow from one small linear system, so the static shape does not depend on any mesh:

    a dropper without given length   contact(zeta_i) = demanded height of the clamp (parabola of the span's pre_sag)
    a dropper of given length l_0    carrier(zeta_i) - contact(zeta_i) - F_i/k_d = l_0  if taut,  F_i = 0  if slack
    a mast                           carrier(zeta_m) = encumbrance
    balance                          sum F = weight of the contact wire,  sum R = weight of everything.

Where the lengths are computed, l_0 = carrier - contact - F/k_d. Which droppers of given length are taut is found by an
active set. Half of a dropper's mass hangs as a point weight on either wire, at the clamp. The mass of a steady arm is
carried by its own support and the arm is unloaded at rest, so arms have no part in the statics.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model.line import Line
from catenary_model.periodic_beam import PeriodicBeam, green

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Indices = NDArray[np.int64]

DROPPER, MAST, STEADY_ARM = 0, 1, 2
"""Kinds of `Sites`."""

_TOLERANCE = 1e-12
"""Elongation (m) up to which a dropper counts as neither taut nor slack."""
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

    def contact(self, zeta: Array) -> Array:
        """Height of the contact wire at track positions zeta, m."""
        return self.contact_beam.value(zeta)

    def contact_slope(self, zeta: Array) -> Array:
        """Slope of the contact wire at track positions zeta, 1."""
        return self.contact_beam.slope(zeta)

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


def solve(line: Line) -> Statics:
    """Solve the static equilibrium; compute the unstressed lengths that the line does not give.

    A contact wire without any dropper hangs from nothing: it is taken as level, its weight is left out.

    Raises StaticsError (a ValueError) naming the dropper if a computed length is not positive or not taut, or if the
    given lengths leave no equilibrium.
    """
    droppers = _Droppers.of(line)
    mast_at = np.array(line.span_starts)
    encumbrance = np.array([span.mast.encumbrance for span in line.spans])
    n, m, P, g = droppers.at.size, mast_at.size, line.period, line.gravity
    half = 0.5 * g * droppers.mass

    # unknowns: F (n), R (m), W_0 of the carrier, W_0 of the contact wire (only with droppers)
    carrier_at = np.concatenate((droppers.at, mast_at))
    carrier_green = green(carrier_at[:, None] - carrier_at[None, :], P, line.carrier)[0]
    contact_green = green(droppers.at[:, None] - droppers.at[None, :], P, line.contact)[0]
    carrier_rows = np.zeros((n + m, n + m + 2))  # carrier's height at clamps and masts, by the unknowns
    carrier_rows[:, :n], carrier_rows[:, n : n + m] = -carrier_green[:, :n], carrier_green[:, n:]
    carrier_rows[:, n + m] = 1.0
    carrier_known = -carrier_green[:, :n] @ half
    contact_rows = np.zeros((n, n + m + 2))
    contact_rows[:, :n], contact_rows[:, n + m + 1] = contact_green, 1.0
    contact_known = -contact_green @ half

    system, rhs = np.zeros((n + m + 2, n + m + 2)), np.zeros(n + m + 2)
    given = ~np.isnan(droppers.length)
    system[:n] = contact_rows
    system[:n][given] -= carrier_rows[:n][given]
    system[:n, :n] += np.diag(np.where(given, 1.0 / droppers.stiffness, 0.0))
    rhs[:n] = np.where(given, carrier_known[:n] - droppers.length, droppers.height) - contact_known
    system[n : n + m], rhs[n : n + m] = carrier_rows[n:], encumbrance - carrier_known[n:]
    system[n + m, :n], system[n + m, n : n + m] = -1.0, 1.0
    rhs[n + m] = line.carrier.mass_per_length * g * P + half.sum()
    system[n + m + 1, :n] = 1.0
    rhs[n + m + 1] = line.contact.mass_per_length * g * P + half.sum()
    if not n:
        system, rhs = system[:-1, :-1], rhs[:-1]

    x, taut = one_sided(system, rhs, np.append(given, np.zeros(system.shape[0] - n, dtype=np.bool_)))
    force, mast = np.where(np.abs(x[:n]) <= _TOLERANCE * droppers.stiffness, 0.0, x[:n]), x[n : n + m]
    carrier = PeriodicBeam(line.carrier, P, carrier_at, np.append(-force - half, mast), float(x[n + m]))
    contact = PeriodicBeam(line.contact, P, droppers.at, force - half, float(x[n + m + 1]) if n else 0.0)
    distance = carrier.value(droppers.at) - contact.value(droppers.at)
    elongation = np.where(taut[:n], force / droppers.stiffness, distance - droppers.length)
    length = np.where(given, droppers.length, distance - elongation)
    _refuse_impossible(line, droppers.name, force, length)
    return Statics(line, _sites(line, droppers, mast_at, force, mast, elongation, length), contact, carrier)


def one_sided(system: Array, rhs: Array, may_slacken: Flags, taut: Flags | None = None) -> tuple[Array, Flags]:
    """Solve system x = rhs where flagged unknowns are tensions of one-sided springs.

    The row of such an unknown reads (its elongation without force) - (what its force changes) = 0, signed so that
    rhs - system x without its own force is the elongation (m). It holds where x > 0; where not, x = 0 and the
    elongation is negative. Block principal pivoting (Judice and Pires 1994): all that disagree change at once, one by
    one where that does not settle. `taut` is the state to begin with, all taut by default.

    Returns x and the flags of what is taut. Raises StaticsError without an equilibrium.
    """
    on = np.ones(rhs.size, dtype=np.bool_) if taut is None else taut | ~may_slacken
    fewest, patience = rhs.size + 1, _PATIENCE
    for _ in range(50 + 4 * int(may_slacken.sum())):
        active = np.flatnonzero(on)
        x = np.zeros(rhs.size)
        try:
            x[active] = np.linalg.solve(system[np.ix_(active, active)], rhs[active])
        except np.linalg.LinAlgError:
            break
        lacking = rhs - system @ x
        # a tension as an elongation: times the compliance of its own row
        wrong = may_slacken & (np.where(on, -x * np.abs(np.diag(system)), lacking) > _TOLERANCE)
        count = int(wrong.sum())
        if not count:
            x[may_slacken & (x < 0.0)] = 0.0
            return x, on
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
