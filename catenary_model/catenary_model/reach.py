"""Where the contact wire is, at rest and under a steady push: whether a line can be ridden and a drive gets there."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary_model import statics
from catenary_model.line import Line
from catenary_model.statics import DROPPER, STEADY_ARM, Statics, StaticsError
from catenary_model.stiffness import PushedLine

Array = NDArray[np.float64]

FAR = 0.5
"""Height (m) beyond which a node that does not know its drive warns: the largest pre-sag of a line file."""
_PER_GAP = 10
"""Places between two loads on the contact wire at which its height is looked at."""
_NEIGHBOURS = 5
"""Spans on either side of a push that are taken along: it is felt no further."""


@dataclass(frozen=True)
class Place:
    """A height of the contact wire and where it is."""

    height: float
    """Above the nominal height, m."""
    position: float
    """Track position within the period, m."""
    span: int
    """Span of the line, from 0."""

    def words(self, line: Line) -> str:
        """Say height and place: track position and span."""
        side = "below" if self.height < 0.0 else "above"
        where = f"{self.position:.1f} m, span {self.span + 1} of {len(line.spans)}"
        return f"{abs(self.height):.3g} m {side} its nominal height (at {where})"


def _place(line: Line, height: float, position: float) -> Place:
    span = int(np.searchsorted(np.array(line.span_starts), position, side="right")) - 1
    return Place(float(height), float(position), max(span, 0))


def refuse_unridable(rest: Statics) -> None:
    """Raise StaticsError if nothing holds the contact wire, or if it hangs through the carrier."""
    sites = rest.sites
    if not ((sites.kind == DROPPER) | (sites.kind == STEADY_ARM) & (sites.stiffness > 0.0)).any():
        raise StaticsError(
            "the contact wire hangs from nothing: it has neither droppers nor steady arms with a stiffness, so any "
            "push lifts it without end (no static stiffness)"
        )
    zeta = _looked_at(rest)
    clearance = rest.carrier(zeta) - rest.contact(zeta)
    least = int(clearance.argmin())
    if clearance[least] <= 0.0:
        place = _place(rest.line, clearance[least], zeta[least])
        raise StaticsError(
            f"the carrier hangs {-clearance[least]:.2f} m below the contact wire at "
            f"{zeta[least] - rest.line.span_starts[place.span]:.1f} m: the mast's encumbrance is too small",
            place.span,
        )


def lowest_and_highest(rest: Statics) -> tuple[Place, Place]:
    """Lowest and highest place of the contact wire at rest."""
    zeta = _looked_at(rest)
    height = rest.contact(zeta)
    low, high = (_place(rest.line, height[i], zeta[i]) for i in (int(height.argmin()), int(height.argmax())))
    return low, high


def lifted(rest: Statics, force: float) -> Place:
    """Highest place of the contact wire where a steady force (N, up) lifts it, tried where it is held least.

    That is in the middle of the longest stretch between two droppers or arms that hold it, and of the longest span.
    Raises StaticsError if nothing holds it, or if a push is felt too far away.
    """
    line, sites = rest.line, rest.sites
    holds = (sites.kind == DROPPER) & (sites.force > 0.0) | (sites.kind == STEADY_ARM) & (sites.stiffness > 0.0)
    at = sites.position[holds]
    if not at.size:
        raise StaticsError(
            "no dropper carries the contact wire (gravity = 0 leaves all of them slack), nothing holds it"
        )
    gap = np.diff(at, append=at[:1] + line.period)
    wide, span = int(gap.argmax()), int(np.argmax([span.length for span in line.spans]))
    tried = (at[wide] + 0.5 * gap[wide]) % line.period, line.span_starts[span] + 0.5 * line.spans[span].length
    found = []
    for position in tried:
        here = _place(line, 0.0, position)
        part, first = _around(line, here.span)
        start = line.span_starts[first]
        uplift = PushedLine(statics.solve(part)).push((position - start) % line.period, force).uplift
        found.append(dataclasses.replace(here, height=float(rest.contact(np.array(position))) + uplift))
    return max(found, key=lambda place: place.height)


def beyond_reach(line: Line, low: float, high: float, force: float) -> str:
    """Say where the contact wire leaves low .. high (m), what a drive reaches, at rest or pushed; empty if nowhere.

    `force` is the mean contact force of a ride (N). Raises StaticsError if the line has no equilibrium.
    """
    rest = statics.solve(line)
    lowest, highest = lowest_and_highest(rest)
    if lowest.height < low:
        reached = f"{-low:g} m" if low < 0.0 else f"down to {low:g} m above it"
        return f"the contact wire hangs {lowest.words(line)}, the drive reaches {reached}"
    reached = f"{high:g} m" if high > 0.0 else f"up to {-high:g} m below it"
    if highest.height > high:
        return f"the contact wire hangs {highest.words(line)}, the drive reaches {reached}"
    try:
        top = lifted(rest, force)
    except StaticsError as error:
        return error.problem
    return (
        f"{force:g} N lift the contact wire to {top.words(line)}, the drive reaches {reached}"
        if top.height > high
        else ""
    )


def far_from_nominal(rest: Statics) -> str:
    """Say where the contact wire at rest is further from its nominal height than `FAR`; empty if nowhere."""
    place = max(lowest_and_highest(rest), key=lambda place: abs(place.height))
    return f"the contact wire hangs {place.words(rest.line)}" if abs(place.height) > FAR else ""


def _looked_at(rest: Statics) -> Array:
    """Track positions that leave out no sag: every load on the contact wire, every mast, and places between."""
    line = rest.line
    edges = np.unique(np.concatenate((rest.contact_beam.at, np.array(line.span_starts), [line.period])))
    return np.unique(np.linspace(edges[:-1], edges[1:], _PER_GAP + 1))


def _around(line: Line, span: int) -> tuple[Line, int]:
    """Spans around one as a line of their own, and the first of them; all of a short or a stitched line."""
    n = len(line.spans)
    if n <= 2 * _NEIGHBOURS + 1 or line.stitched:  # cut out, a stitch wire could lose its other half
        return line, 0
    first = (span - _NEIGHBOURS) % n
    spans = tuple(line.spans[(first + i) % n] for i in range(2 * _NEIGHBOURS + 1))
    return dataclasses.replace(line, spans=spans), first
